"""Writes what the emulated lab sends: frames, odometry, the leader's drive and the truth of each pair."""

from __future__ import annotations

from collections.abc import Iterator

from formation.records import columns_of
from hil.emulator.entries import tell_frame, tell_odometry, tell_truth
from hil.emulator.lab_messages import MOCAP_FRAME, odometry_frames
from hil.emulator.plant import Plant
from hil.nodes.node import Outgoing
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import typename_of
from hil.wire.templates import frame_template, odometry_template, truth_template
from hil.wire.topics import Topics
from hil.wire.writing import DriveWriter

_FRAME, _ODOMETRY, _TRUTH = (typename_of(kind) for kind in (msg.RigidBodies, msg.Odometry, msg.Truth))


class LabWriter:
    """Writes for robots with these bodies, the leader first, and the pairs that they make."""

    def __init__(self, bodies: tuple[str, ...], pairs: list[Topics]) -> None:
        self._count = len(bodies)
        self._frame = frame_template(MOCAP_FRAME, bodies)
        spaces = (pairs[0].leader, *(pair.follower for pair in pairs))
        topics_of_all = (pairs[0].leader_odom, *(pair.odom for pair in pairs))
        templates = (odometry_template(*odometry_frames(space)) for space in spaces)
        self._odometry = tuple(zip(topics_of_all, templates, strict=True))
        self._truths = [pair.truth for pair in pairs]
        self._truth = truth_template(MOCAP_FRAME)
        self._drives_topic = pairs[0].leader_cmd_vel
        self._drives = DriveWriter(pairs[0].leader, stamped=pairs[0].stamped)

    def frame(self, plant: Plant, slot: int, stamp_ns: int, number: int, at_ns: int) -> Outgoing:
        """The frame in a slot, captured ``at_ns`` by a clock that says ``stamp_ns``."""
        buffer, places_at = self._frame
        tell_frame(buffer, places_at, stamp_ns, number, plant.memory.seen, slot * self._count)
        return Outgoing(topics.RIGID_BODIES, _FRAME, buffer.tobytes(), at_ns)

    def odometry(self, plant: Plant, slot: int, stamp_ns: int) -> Iterator[Outgoing]:
        """The odometry in a slot that arrives by this time, of each robot that has any."""
        first = slot * self._count
        arrive_ns = columns_of(plant.memory.odometry)["arrives_ns"]
        for k, (topic, (buffer, numbers_at)) in enumerate(self._odometry):
            if arrive_ns[first + k] != stamp_ns:
                continue
            tell_odometry(buffer, numbers_at, stamp_ns, plant.memory.odometry, first + k)
            yield Outgoing(topic, _ODOMETRY, buffer.tobytes(), stamp_ns)

    def truths(self, plant: Plant, at_ns: int, number: int) -> Iterator[Outgoing]:
        """True states of each pair at the capture of a frame."""
        buffer, number_at = self._truth
        for k, topic in enumerate(self._truths):
            tell_truth(buffer, number_at, at_ns, number, plant.memory.robots, k)
            yield Outgoing(topic, _TRUTH, buffer.tobytes(), at_ns)

    def drives(self, plant: Plant, stamp_ns: int) -> Outgoing:
        """What the leader is told to drive."""
        payload = self._drives.write(plant.leader_goal, stamp_ns)
        return Outgoing(self._drives_topic, self._drives.typename, payload, stamp_ns)
