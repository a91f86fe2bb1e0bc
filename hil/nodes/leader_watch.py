"""In the place of the leader's driver where a hand drives it, or it is a person: it sees when it sets off."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from hil.nodes.capture_time import captured_ns
from hil.nodes.leader_driver import NAME, stop_reason
from hil.nodes.node import Counts, Outgoing, counted, diagnostics, is_due, named_counts, no_counts, outgoing
from hil.nodes.start_barrier import NOBODY, Attendance, StartBarrier
from hil.scenario.links import bodies_of, links_of
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import MalformedPayloadError, decode_as, to_ns

SET_OFF_M = 0.01
"""A leader that is further than this from where it stood has set off [m], or six standard deviations."""

FRAMES_OFF = 3
"""So many frames in a row must say so: one may show another body."""

_DIAGNOSTICS_NS = 500_000_000


class Rest(NamedTuple):
    """Where the leader stood [m], and how many frames in a row have shown it elsewhere, the first when."""

    x: float
    y: float
    frames_off: int = 0
    off_since_ns: int = 0


def seen_at(rest: Rest, x: float, y: float, at_ns: int, reach: float) -> Rest:
    """The same after a frame that shows the leader somewhere; ``reach`` [m]: what is still where it stood."""
    if not math.hypot(x - rest.x, y - rest.y) > reach:
        return rest._replace(frames_off=0)
    since_ns = rest.off_since_ns if rest.frames_off else at_ns
    return rest._replace(frames_off=rest.frames_off + 1, off_since_ns=since_ns)


@dataclass(slots=True, eq=False)
class WatchState:
    """What the watch knows; it changes in place.

    ``rest``: where the leader stood when all behind it were well; ``since_ns``: when it set off. ``over``: by
    which stop all is over, empty before.
    """

    next_diagnostics_ns: int
    present: Attendance = NOBODY
    rest: Rest | None = None
    since_ns: int | None = None
    over: str = ""
    refused: Counts = field(default_factory=no_counts)


class LeaderWatch:
    """Step of the watch: it reports as the leader's driver does, and drives nobody."""

    name = NAME

    def __init__(self, scenario: Scenario, needs: frozenset[str]) -> None:
        self.barrier = StartBarrier(needs, links_of(scenario))
        self._body = bodies_of(scenario)[0]
        self._reach = max(SET_OFF_M, 6.0 * scenario.estimator.sigma_position)
        self._estimator = scenario.estimator
        self.subscribes = (*self.barrier.subscribes, topics.RIGID_BODIES, topics.STOP)

    def begin(self, now_ns: int) -> WatchState:
        """Nobody was heard of."""
        return WatchState(now_ns)

    def due_ns(self, state: WatchState) -> int:
        """Time of the next report."""
        return state.next_diagnostics_ns

    def step(self, state: WatchState, event: Event, now_ns: int) -> tuple[WatchState, tuple[Outgoing, ...]]:
        """Take in a report, a follower's command, a frame or a stop, after which nobody sets off."""
        try:
            if event.topic == topics.RIGID_BODIES:
                return state, self._on_frame(state, event.payload, now_ns)
            if event.topic == topics.STOP:
                state.over = state.over or f"stopped: {stop_reason(event.payload)}"
                return state, ()
            if event.topic:
                state.present = self.barrier.after(state.present, event)
                return state, ()
        except MalformedPayloadError:
            state.refused = counted(state.refused, "malformed")
            return state, ()
        if not is_due(state.next_diagnostics_ns, _DIAGNOSTICS_NS, now_ns):
            return state, ()
        state.next_diagnostics_ns = now_ns + _DIAGNOSTICS_NS
        return state, (self.report(state, now_ns),)

    def report(self, state: WatchState, now_ns: int) -> Outgoing:
        """Diagnostics: what is waited for, since when the leader moves, and by which stop all is over."""
        values: dict[str, object] = {"driven": "hand", "over": state.over}
        if state.since_ns is not None:
            values["motion_since_ns"] = state.since_ns
        values |= named_counts("refused", state.refused)
        problem = ""
        if state.since_ns is None:
            ready = f"all is ready: drive {self._body!r} off by hand"
            problem = state.over or self.barrier.waits_for(state.present) or ready
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, problem, values), now_ns)

    def _on_frame(self, state: WatchState, payload: bytes, now_ns: int) -> tuple[Outgoing, ...]:
        if state.since_ns is not None or state.over:
            return ()
        if not self.barrier.is_open(state.present):
            state.rest = None
            return ()
        frame = decode_as(payload, msg.RigidBodies)
        body = next((each for each in frame.rigidbodies if each.rigid_body_name == self._body), None)
        if body is None:
            return ()
        x, y = body.pose.position.x, body.pose.position.y
        if not (math.isfinite(x) and math.isfinite(y)):
            return ()
        at_ns = captured_ns(self._estimator, to_ns(frame.header.stamp), now_ns)
        state.rest = Rest(x, y) if state.rest is None else seen_at(state.rest, x, y, at_ns, self._reach)
        if state.rest.frames_off < FRAMES_OFF:
            return ()
        state.since_ns = state.rest.off_since_ns
        return (self.report(state, now_ns),)
