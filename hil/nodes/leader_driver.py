"""The leader's own daemon: it drives a real leader by the scenario's program, once all behind it are well."""

from __future__ import annotations

from dataclasses import dataclass, field

from controllers.resolution import NO_REMAINDER, Resolution
from formation.pose import STANDSTILL, Motion
from hil.nodes import deaf_robots
from hil.nodes.deaf_robots import DeafRobots
from hil.nodes.node import Counts, Outgoing, counted, diagnostics, is_due, named_counts, no_counts, outgoing
from hil.nodes.start_barrier import NOBODY, Attendance, StartBarrier
from hil.scenario.links import links_of
from hil.scenario.parts import leader_program, limits
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import drive_message
from hil.wire.events import Event
from hil.wire.messages import MalformedPayloadError, decode_as
from hil.wire.topics import link_topics

NAME = "leader"
COUNTDOWN_S = 3.0
"""From when all is ready to when the leader sets off [s]."""
SILENCE_S = 3.0
"""A leader whose follower's daemons have said nothing for so long stands still [s]."""

_NS = 1e-9
_DIAGNOSTICS_NS = 500_000_000
_LONGEST_GLANCE_S = 0.25


@dataclass(slots=True, eq=False)
class DriverState:
    """What the driver knows; it changes in place.

    ``counting_ns``: when the barrier opened, None while it is closed; ``since_ns``: when the leader set off.
    ``deaf``: who says that a robot does not listen. ``over``: why it drives no more, empty before.
    ``heard_s``: at which ``observed_s`` each needed node was heard last; that time does not run while we
    stood still ourselves. ``remainder``: what rounding left.
    """

    next_tick_ns: int
    next_diagnostics_ns: int
    ticked_ns: int
    present: Attendance = NOBODY
    deaf: DeafRobots = field(default_factory=dict)
    counting_ns: int | None = None
    since_ns: int | None = None
    over: str = ""
    observed_s: float = 0.0
    heard_s: dict[str, float] = field(default_factory=dict)
    remainder: Motion = NO_REMAINDER
    refused: Counts = field(default_factory=no_counts)


class LeaderDriver:
    """Step of the leader's daemon.

    The program begins a countdown [s] after the start barrier has opened and nobody says that a robot does
    not listen; it begins anew if somebody reports a problem in the meantime. It ends with the run's duration,
    with a stop, or when a daemon that is needed falls silent; the leader stands then, and for good.
    """

    name = NAME

    def __init__(self, scenario: Scenario, needs: frozenset[str], countdown_s: float = COUNTDOWN_S) -> None:
        links = links_of(scenario)
        self.barrier = StartBarrier(needs, links)
        self._countdown_ns = round(countdown_s * 1e9)
        self._duration_s = float(scenario.run.duration_s)
        self._program, self._limits = leader_program(scenario), limits(scenario)
        given = scenario.controller
        self._resolution = Resolution(float(given.v_resolution), float(given.u_resolution))
        self._tick_ns = round(1e9 / given.tick_hz)
        self._pair = link_topics(links[0])
        self.subscribes = (*self.barrier.subscribes, topics.STOP)

    def begin(self, now_ns: int) -> DriverState:
        """The leader stands."""
        return DriverState(now_ns, now_ns, now_ns)

    def due_ns(self, state: DriverState) -> int:
        """Time of the next command."""
        return state.next_tick_ns

    def step(self, state: DriverState, event: Event, now_ns: int) -> tuple[DriverState, tuple[Outgoing, ...]]:
        """Take in a report, a follower's command or a stop; at a tick and at a stop the leader is told."""
        if event.topic and event.topic != topics.STOP:
            self._hear(state, event, now_ns)
            return state, ()
        if event.topic:
            state.over = state.over or f"stopped: {stop_reason(event.payload)}"
        else:
            self._look(state, now_ns)
        out = (self._command(state, now_ns),)
        state.next_tick_ns = now_ns + self._tick_ns
        if not is_due(state.next_diagnostics_ns, _DIAGNOSTICS_NS, now_ns):
            return state, out
        state.next_diagnostics_ns = now_ns + _DIAGNOSTICS_NS
        return state, (*out, self.report(state, now_ns))

    def report(self, state: DriverState, now_ns: int) -> Outgoing:
        """Diagnostics: what is waited for, since when the leader drives, and why it does not any more."""
        values: dict[str, object] = {"driven": "program", "over": state.over}
        if state.since_ns is not None:
            values["motion_since_ns"] = state.since_ns
        values |= named_counts("refused", state.refused)
        problem = self._problem(state, now_ns)
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, problem, values), now_ns)

    def _problem(self, state: DriverState, now_ns: int) -> str:
        if state.since_ns is not None:
            return ""
        if state.over:
            return state.over
        if state.counting_ns is None:
            missing = self.barrier.waits_for(state.present)
            return missing or deaf_robots.waits_for(state.deaf, now_ns)
        return f"sets off in {max(0, state.counting_ns + self._countdown_ns - now_ns) * _NS:.1f} s"

    def _hear(self, state: DriverState, event: Event, now_ns: int) -> None:
        try:
            state.present = self.barrier.after(state.present, event)
        except MalformedPayloadError:
            state.refused = counted(state.refused, "malformed")
            return
        if event.topic == topics.DIAGNOSTICS:
            report = decode_as(event.payload, msg.DiagnosticArray)
            state.deaf = deaf_robots.with_report(state.deaf, report, now_ns)
            names = {status.name.removeprefix("abreast/") for status in report.status} & self.barrier.needs
            state.heard_s |= dict.fromkeys(names, state.observed_s)

    def _look(self, state: DriverState, now_ns: int) -> None:
        """Count down, set off, or find that it is over."""
        state.observed_s += min(max(0.0, (now_ns - state.ticked_ns) * _NS), _LONGEST_GLANCE_S)
        was_set_back, state.ticked_ns = now_ns < state.ticked_ns, now_ns
        if state.over:
            return
        if state.since_ns is None:
            held_up = not self.barrier.is_open(state.present) or deaf_robots.waits_for(state.deaf, now_ns)
            if was_set_back or held_up:
                state.counting_ns = None
            elif state.counting_ns is None:
                state.counting_ns = now_ns
            if state.counting_ns is not None and now_ns - state.counting_ns >= self._countdown_ns:
                state.since_ns = now_ns
                state.next_diagnostics_ns = now_ns
        elif now_ns < state.since_ns:
            state.over = "the clock was set back to before the start"
        elif (now_ns - state.since_ns) * _NS >= self._duration_s:
            state.over = "the program is over"
        elif silent := self._silent(state):
            state.over = f"the {silent} has said nothing for {SILENCE_S:g} s"

    def _silent(self, state: DriverState) -> str | None:
        since_s = state.observed_s - SILENCE_S
        return next((n for n in sorted(self.barrier.needs) if state.heard_s.get(n, 0.0) < since_s), None)

    def _command(self, state: DriverState, now_ns: int) -> Outgoing:
        motion = STANDSTILL
        if state.since_ns is not None and not state.over:
            wanted, _ = self._limits.apply(self._program((now_ns - state.since_ns) * _NS))
            motion, state.remainder = self._resolution.round(wanted, state.remainder, self._limits)
        pair = self._pair
        told = drive_message(motion, now_ns, pair.leader, stamped=pair.wanted_stamped)
        return outgoing(pair.leader_wanted, told, now_ns)


def stop_reason(payload: bytes) -> str:
    """Why a stop was ordered; one that cannot be read counts too."""
    try:
        return decode_as(payload, msg.String).data
    except MalformedPayloadError:
        return "for a reason that cannot be read"
