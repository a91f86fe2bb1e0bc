"""From the messages of a lab, in their order, transforms on ``/tf`` and markers on ``/scene``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from formation.pose import Pose
from hil.errors import AbreastError
from hil.nodes.node import Outgoing, outgoing
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from hil.scene.markers import Brush, Marker, MarkerArray
from hil.scene.pair_scene import FOLLOWER, LEADER, pair_markers, robot_markers
from hil.scene.pair_state import Heard, PairState
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import decode_as, header, to_ns, typename_of
from hil.wire.pose_sources import TFMessage, message_of, places_of, upright
from hil.wire.records import Placement

TF, SCENE = "/tf", "/scene"
WORLD = "world"
"""The frame that all others lie in."""

TYPES: Mapping[str, str] = {TF: typename_of(TFMessage), SCENE: typename_of(MarkerArray)}
"""Types of what the scene is told by."""

_TF_NS, _SCENE_NS = 16_000_000, 50_000_000
"""No more often than this, by the messages' own time: what eyes can follow."""

_LIFETIME_S = 0.5


class LabScene:
    """Hears what passes in a lab, or what passed by its log, and tells what a 3D panel is to show of it.

    Robots stand where the motion capture has them, under their names; without one, the follower where its
    odometry has it and the leader where the estimate has it from there. What was not heard of for a second
    is left out, as it may be gone.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._pairs = [PairState(link) for link in links_of(scenario)]
        self._scenario = scenario
        self._heard: dict[str, Heard[Pose]] = {}
        self._tf_ns = self._scene_ns = -_SCENE_NS
        self.topics = tuple({name: None for pair in self._pairs for name in pair.topics})

    def hear(self, topic: str, payload: bytes, now_ns: int) -> Iterator[Outgoing]:
        """Take in a message that was logged, or came, at a time; what is to be shown then, if anything.

        What cannot be read, or is not of this lab, is passed over.
        """
        try:
            self._note(topic, payload, now_ns)
        except (AbreastError, ValueError):
            return
        if now_ns < 0 or not (stands := self._stands(now_ns)):
            return
        if not 0 <= now_ns - self._tf_ns < _TF_NS:
            self._tf_ns = now_ns
            yield outgoing(TF, _transforms(stands, now_ns), now_ns)
        if not 0 <= now_ns - self._scene_ns < _SCENE_NS:
            self._scene_ns = now_ns
            markers: list[Any] = list(self._markers(stands, now_ns))
            yield outgoing(SCENE, MarkerArray(markers=markers), now_ns)

    def _stands(self, now_ns: int) -> dict[str, Pose]:
        """Where robots stand of which one has heard lately."""
        still = ((name, heard.still(now_ns)) for name, heard in self._heard.items())
        return {name: pose for name, pose in still if pose is not None}

    def _note(self, topic: str, payload: bytes, now_ns: int) -> None:
        if topic == topics.RIGID_BODIES:
            frame = decode_as(payload, msg.RigidBodies)
            source = self._scenario.source
            seen = {each.body: upright(each.place, source.up, source.scale) for each in places_of(frame)}
            stamp_ns = to_ns(frame.header.stamp)
            for pair in self._pairs:
                self._keep(pair.note_frame(stamp_ns, seen), now_ns)
            return
        for pair in self._pairs:
            if topic in pair.topics:
                self._keep(pair.note(topic, payload, now_ns), now_ns)

    def _keep(self, found: Mapping[str, Pose], now_ns: int) -> None:
        self._heard |= {name: Heard(pose, now_ns) for name, pose in found.items()}

    def _markers(self, stands: Mapping[str, Pose], now_ns: int) -> Iterator[Marker]:
        leaders = {self._pairs[0].link.leader}
        for name in stands:
            brush = Brush(name, now_ns, f"{name}/robot", _LIFETIME_S)
            yield from robot_markers(brush, LEADER if name in leaders else FOLLOWER)
        for pair in self._pairs:
            if (seen := pair.seen(now_ns, stands)) is not None:
                yield from pair_markers(
                    Brush(WORLD, now_ns, f"{pair.link.follower}/estimate", _LIFETIME_S), seen
                )


def _transforms(stands: Mapping[str, Pose], now_ns: int) -> msg.Message:
    placed = (
        (
            name,
            Placement(pose.x, pose.y, 0.0, 0.0, 0.0, math.sin(0.5 * pose.theta), math.cos(0.5 * pose.theta)),
        )
        for name, pose in stands.items()
    )
    return message_of("TFMessage", header(now_ns, WORLD), placed)
