"""One emulated robot beside a real one: its pose is added to the frames of the lab's own motion capture."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from msgspec.structs import replace as changed

from formation.pose import Motion, Pose, advance
from hil.emulator.lab_messages import frame_message
from hil.emulator.node import EmulatorNode, EmulatorState
from hil.nodes.capture_time import captured_ns
from hil.nodes.node import Counts, Outgoing, counted, diagnostics, named_counts, no_counts, outgoing
from hil.scenario.guarded import with_guards
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import TICK, Event
from hil.wire.messages import MalformedPayloadError, decode_as, to_ns

LAB_FRAMES = "abreast/lab_frames"
"""Frames of the lab, our messages already, without the emulated robot; spoken within the process only."""

_KEPT = 240
_PLACES = ("leader", "follower")


class Shown(NamedTuple):
    """The emulated body as a frame of the emulator's shows it, and how its robot moved then."""

    at_ns: int
    body: msg.RigidBody
    motion: Motion


@dataclass(slots=True, eq=False)
class BesideState:
    """The emulator's own state, and what its last frames showed; it changes in place."""

    lab: EmulatorState
    shown: deque[Shown] = field(default_factory=lambda: deque(maxlen=_KEPT))
    refused: Counts = field(default_factory=no_counts)


class BesideReal:
    """Step of an emulator of one robot of a pair; the other exists, and so does the motion capture.

    The emulated body is seen with the noise of ``[mocap]``, at the moments and with the delay, loss and clock
    of the lab's own frames. Where it is the leader it sets off as in an emulated lab; where it is the
    follower somebody else leads. There is no truth, as nobody knows that of the other.
    """

    name = EmulatorNode.name

    def __init__(self, scenario: Scenario, needs: frozenset[str]) -> None:
        self._robot = scenario.source.emulated
        self._place = _PLACES.index(self._robot)
        self._estimator = scenario.estimator
        mocap = changed(
            scenario.mocap, latency_s=0.0, jitter_s=0.0, loss=0.0, clock_offset_s=0.0, clock_drift_ppm=0.0,
            clock_jump_s=0.0, faults=(),
        )  # fmt: skip
        waits = needs if self._robot == "leader" else frozenset({"nobody"})
        # A follower that is emulated has a guard of its own; one that exists has it outside.
        guarded = scenario.guard.present and self._robot == "follower"
        self._node = EmulatorNode(with_guards(changed(scenario, mocap=mocap), guarded), waits)
        pair = self._node.topics
        leads = self._robot == "leader"
        own = (
            (pair.leader_odom, pair.leader_cmd_vel)
            if leads
            else (pair.odom, *({pair.cmd_vel} if guarded else ()))
        )
        self._spoken = {*own, *([pair.cmd_vel] if guarded else []), topics.DIAGNOSTICS, pair.side}
        self.subscribes = (*self._node.subscribes, LAB_FRAMES)

    def begin(self, now_ns: int) -> BesideState:
        """The robot stands at its start pose."""
        return BesideState(self._node.begin(now_ns))

    def due_ns(self, state: BesideState) -> int:
        """Time of the next thing in the emulated lab."""
        return self._node.due_ns(state.lab)

    def step(self, state: BesideState, event: Event, now_ns: int) -> tuple[BesideState, tuple[Outgoing, ...]]:
        """Let the robot go on, and complete a frame that comes."""
        of_lab = event.topic == LAB_FRAMES
        state.lab, said = self._node.step(state.lab, TICK if of_lab else event, now_ns)
        out = list(self._told(state, said))
        if of_lab:
            try:
                out += self._completed(state, decode_as(event.payload, msg.RigidBodies), now_ns)
            except MalformedPayloadError:
                state.refused = counted(state.refused, "malformed")
        return state, tuple(out)

    def report(self, state: BesideState, now_ns: int) -> Outgoing:
        """Diagnostics of the emulator; of a follower without what it would wait for as a leader."""
        if self._robot == "leader":
            return self._node.report(state.lab, now_ns)
        world = state.lab.plant.world()
        values: dict[str, object] = {
            "stopped": world.stopped,
            "frames": world.frames,
            "emulates": self._robot,
        }
        values |= named_counts("refused", state.lab.refused) | named_counts("refused", state.refused)
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, "", values), now_ns)

    def _told(self, state: BesideState, said: tuple[Outgoing, ...]) -> Iterator[Outgoing]:
        """What is passed on of what the emulated lab says; its frames are kept."""
        for message in said:
            if message.topic == topics.RIGID_BODIES:
                frame = decode_as(message.payload, msg.RigidBodies)
                motion = state.lab.robots[self._place].motion
                state.shown.append(Shown(to_ns(frame.header.stamp), frame.rigidbodies[self._place], motion))
            elif message.topic == topics.DIAGNOSTICS:
                (status,) = decode_as(message.payload, msg.DiagnosticArray).status
                own = status.name == f"abreast/{self.name}"
                yield self.report(state, message.stamp_ns) if own else message
            elif message.topic in self._spoken:
                yield message

    def _completed(self, state: BesideState, frame: msg.RigidBodies, now_ns: int) -> Iterator[Outgoing]:
        at_ns = captured_ns(self._estimator, to_ns(frame.header.stamp), now_ns)
        if not state.shown:
            return
        before = next((each for each in reversed(state.shown) if each.at_ns <= at_ns), state.shown[0])
        moved = _moved(before, max(0.0, (at_ns - before.at_ns) * 1e-9))
        bodies = [each for each in frame.rigidbodies if each.rigid_body_name != moved.rigid_body_name]
        whole = replace(frame, rigidbodies=[*bodies, moved])
        yield outgoing(topics.RIGID_BODIES, whole, to_ns(frame.header.stamp))


def _moved(shown: Shown, seconds: float) -> msg.RigidBody:
    """The body a moment later."""
    seen = shown.body.pose
    theta = 2.0 * math.atan2(seen.orientation.z, seen.orientation.w)
    place = Pose(seen.position.x, seen.position.y, theta)
    moved = advance(place, shown.motion.v, shown.motion.u, seconds)
    return frame_message(0, 0, [(shown.body.rigid_body_name, moved)]).rigidbodies[0]
