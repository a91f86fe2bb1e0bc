"""The controller daemon: estimates in, commands out; it predicts, asks the law, and lets the guard decide."""

from __future__ import annotations

import math
from dataclasses import replace as with_changes

from msgspec import Struct, field
from msgspec.structs import replace

from controllers.guard import Decision, decide
from controllers.resolution import NOTHING_OWED, Resolution
from controllers.station_keeper import Keeping
from estimation.tracking.estimate import Estimate
from estimation.tracking.foresight import TurnTrend
from estimation.tracking.prediction import SentCommand, predict_shape
from estimation.tracking.tracker import Status
from formation.pose import Motion
from formation.station import Side
from hil.nodes.leader_turn import LeaderTurn
from hil.nodes.node import (
    Counts,
    Outgoing,
    consumed,
    counted,
    diagnostics,
    is_due,
    named_counts,
    no_counts,
    outgoing,
)
from hil.scenario.parts import limits, station_keeper
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import drive_message, read_drive
from hil.wire.estimate_message import from_message
from hil.wire.events import Event
from hil.wire.message_checks import CLOCK_TOLERANCE_NS
from hil.wire.messages import MalformedPayloadError, decode_as, header, to_time
from hil.wire.topics import topics_of

NAME = "controller"
_DIAGNOSTICS_NS = 500_000_000
_NS = 1e-9
_LARGEST = 1e6
_SHORTEST_STEP_NS = 1_000_000


class ControllerState(Struct, frozen=True):
    """All that the controller remembers.

    ``estimate``: the newest one that may move the robot; ``status``: of the newest one of any kind.
    ``sent``: commands since that estimate's capture, oldest first, and the one before. ``leader_u1``: the
    turn rate that the leader was told to drive, kept for the law ``ideal``, nan before it is known.
    ``trend``: of the estimated turn rate. ``keeping``: the side that was ordered. ``owed``: what rounding to
    the robot's steps took off the last command, of ``commanded_ns``.
    """

    keeping: Keeping
    estimate: Estimate | None = None
    status: Status = Status.INITIALISING
    stopped: bool = False
    sent: tuple[SentCommand, ...] = ()
    owed: Motion = NOTHING_OWED
    receipts: tuple[msg.Consumed, ...] = ()
    refused: Counts = field(default_factory=no_counts)
    decided: Counts = field(default_factory=no_counts)
    heard: bool = False
    leader_u1: float = math.nan
    trend: TurnTrend | None = None
    commanded_ns: int = 0
    next_tick_ns: int = 0
    next_diagnostics_ns: int = 0


class ControllerNode:
    """Pure step of the controller of one follower.

    ``may_change``: whether it takes orders to change sides; in a chain others may be where it would go.
    """

    def __init__(self, scenario: Scenario, name: str = NAME, *, may_change: bool = True) -> None:
        given = scenario.controller
        self.name = name
        self.topics = topics_of(scenario)
        self.keeper, self.limits = station_keeper(scenario), limits(scenario)
        self.resolution = Resolution(given.v_resolution, given.u_resolution)
        self.max_age = given.max_age_s
        self.lag = given.lag_s
        self.transport_ns = round(given.transport_s / _NS)
        self.ahead_ns = self.transport_ns + round(given.lag_s / _NS)
        self.tick_ns = round(1.0 / given.tick_hz / _NS)
        self.leader_turn = LeaderTurn(scenario)
        leader = (self.topics.leader_cmd_vel,) if self.leader_turn.is_told else ()
        orders = (self.topics.side,) if may_change else ()
        self.subscribes: tuple[str, ...] = (self.topics.estimate, topics.STOP, *leader, *orders)

    def begin(self, now_ns: int) -> ControllerState:
        """State of a controller that has heard nothing: it keeps the robot still."""
        return ControllerState(self.keeper.begin(), next_tick_ns=now_ns, next_diagnostics_ns=now_ns)

    def due_ns(self, state: ControllerState) -> int:
        """Time of the next tick: a command leaves at least that often."""
        return state.next_tick_ns

    def step(
        self, state: ControllerState, event: Event, now_ns: int
    ) -> tuple[ControllerState, tuple[Outgoing, ...]]:
        """Take in an estimate, a stop or a tick; each leads to a command."""
        if now_ns < state.commanded_ns:
            # The clock was set back: what is known would count as new again when it gets there once more.
            state = replace(state, estimate=None, trend=None, sent=())
        if event.topic:
            state = replace(state, receipts=(*state.receipts, consumed(event, now_ns)))
        fresh = False
        if event.topic == topics.STOP:
            state = replace(state, stopped=True)
        elif event.topic == self.topics.estimate:
            try:
                estimate = from_message(decode_as(event.payload, msg.LeaderEstimate))
            except (MalformedPayloadError, ValueError):
                return replace(state, refused=counted(state.refused, "malformed")), ()
            if not estimate.measured_ns <= estimate.capture_ns <= now_ns + CLOCK_TOLERANCE_NS:
                return replace(state, refused=counted(state.refused, "bad_stamp")), ()
            fresh = estimate.status is Status.TRACKING
            kept = estimate if fresh else state.estimate
            state = replace(state, status=estimate.status, heard=True, estimate=kept)
            if fresh:
                ahead = self._ahead(estimate, now_ns)
                state = replace(state, trend=self.leader_turn.trend(state.trend, estimate, ahead))
        elif event.topic == self.topics.leader_cmd_vel:
            return self._hear_leader(state, event.payload), ()
        elif event.topic == self.topics.side:
            return self._hear_order(state, event.payload), ()
        elif event.topic:
            return state, ()
        state, out = self._command(state, now_ns, fresh=fresh)
        return self._speak(state, out, now_ns)

    def _hear_leader(self, state: ControllerState, payload: bytes) -> ControllerState:
        try:
            told = read_drive(payload, stamped=self.topics.stamped)
        except MalformedPayloadError:
            return replace(state, refused=counted(state.refused, "malformed"))
        return replace(state, leader_u1=told.u)

    def _hear_order(self, state: ControllerState, payload: bytes) -> ControllerState:
        """Take an order, unless the leader may turn harder than a change of sides can make up for."""
        try:
            side = Side(decode_as(payload, msg.String).data)
        except MalformedPayloadError:
            return replace(state, refused=counted(state.refused, "malformed"))
        except ValueError:
            return replace(state, refused=counted(state.refused, "unknown_side"))
        keeping = self.keeper.told(state.keeping, side)
        if keeping is None:
            return replace(state, refused=counted(state.refused, "unsafe_side_change"))
        return replace(state, keeping=keeping)

    def _command(
        self, state: ControllerState, now_ns: int, *, fresh: bool
    ) -> tuple[ControllerState, tuple[Outgoing, ...]]:
        keeping, decision = self._decide(state, now_ns)
        owed = NOTHING_OWED
        if decision.stop is not None:
            keeping = with_changes(state.keeping, interrupted=True)
        else:
            sent, owed = self.resolution.round(decision.sent, state.owed, self.limits)
            decision = with_changes(decision, sent=sent)
        acting = SentCommand(now_ns + self.transport_ns, decision.sent.v, decision.sent.u)
        receipts = state.receipts
        state = replace(
            state,
            keeping=keeping,
            sent=self._recent((*state.sent, acting), state.estimate, now_ns),
            owed=owed,
            receipts=(),
            decided=counted(state.decided, decision.stop.value if decision.stop else "driving"),
            commanded_ns=now_ns,
            next_tick_ns=now_ns + self.tick_ns,
        )
        return state, self._messages(state, decision, receipts, now_ns, fresh=fresh)

    def _decide(self, state: ControllerState, now_ns: int) -> tuple[Keeping, Decision]:
        """Station and decision, as if the decision were to drive."""
        estimate, keeping = state.estimate, state.keeping
        wanted: Motion | None = None
        age: float | None = None
        if estimate is not None:
            age = (now_ns - estimate.measured_ns) * _NS
            if age <= self.max_age and _can_be(estimate):
                ahead = self._ahead(estimate, now_ns)
                further = self.leader_turn.further(state.trend, ahead)
                shape = predict_shape(estimate, state.sent, now_ns + self.ahead_ns, self.lag, further)
                u1 = self.leader_turn.when_acting(state.leader_u1, state.trend, ahead)
                elapsed = min(max(now_ns - state.commanded_ns, _SHORTEST_STEP_NS), self.tick_ns) * _NS
                seen = Motion(estimate.v1, estimate.u1)
                keeping, wanted = self.keeper.drive(keeping, shape, seen, u1, elapsed)
            else:
                wanted = Motion(math.nan, math.nan)
        return keeping, decide(
            wanted,
            self.limits,
            age=age,
            max_age=self.max_age,
            settled=state.status is not Status.INITIALISING,
            lost=state.status is Status.LOST,
            stopped=state.stopped,
        )

    def _ahead(self, estimate: Estimate, now_ns: int) -> float:
        """Time [s] from the capture of an estimate to when a command of now acts."""
        return (now_ns + self.ahead_ns - estimate.capture_ns) * _NS

    def _recent(
        self, sent: tuple[SentCommand, ...], estimate: Estimate | None, now_ns: int
    ) -> tuple[SentCommand, ...]:
        """Commands that a prediction may still need: the one that acts at its begin, and later ones.

        None begins before the capture of the estimate, or more than the largest age ago.
        """
        if estimate is None:
            return sent[-1:]
        begin_ns = max(estimate.capture_ns, now_ns - round(self.max_age / _NS))
        first = 0
        while first + 1 < len(sent) and sent[first + 1].from_ns <= begin_ns:
            first += 1
        return sent[first:]

    def _messages(
        self,
        state: ControllerState,
        decision: Decision,
        receipts: tuple[msg.Consumed, ...],
        now_ns: int,
        *,
        fresh: bool,
    ) -> tuple[Outgoing, ...]:
        estimate, wanted = state.estimate, decision.wanted
        drive = drive_message(decision.sent, now_ns, self.topics.follower, stamped=self.topics.stamped)
        record = msg.Command(
            header=header(now_ns, self.topics.follower),
            capture=to_time(estimate.capture_ns if estimate else 0),
            measured=to_time(estimate.measured_ns if estimate else 0),
            v2=decision.sent.v,
            u2=decision.sent.u,
            v2_wanted=wanted.v if wanted else math.nan,
            u2_wanted=wanted.u if wanted else math.nan,
            saturated=decision.saturated,
            stop=decision.stop.value if decision.stop else "",
            fresh=fresh,
            consumed=receipts,
        )
        return (
            outgoing(self.topics.cmd_vel, drive, now_ns),
            outgoing(self.topics.command, record, now_ns),
        )

    def _speak(
        self, state: ControllerState, out: tuple[Outgoing, ...], now_ns: int
    ) -> tuple[ControllerState, tuple[Outgoing, ...]]:
        if not is_due(state.next_diagnostics_ns, _DIAGNOSTICS_NS, now_ns):
            return state, out
        state = replace(state, next_diagnostics_ns=now_ns + _DIAGNOSTICS_NS)
        return state, (*out, self.report(state, now_ns))

    def report(self, state: ControllerState, now_ns: int) -> Outgoing:
        """Diagnostics: what was decided how often, and what was refused."""
        problem = "" if state.heard else "waiting for estimates"
        values: dict[str, object] = {"estimate": state.status.name.lower()}
        values |= _side_report(state.keeping)
        values |= named_counts("decided", state.decided) | named_counts("refused", state.refused)
        return outgoing(topics.DIAGNOSTICS, diagnostics(self.name, now_ns, problem, values), now_ns)


def _side_report(keeping: Keeping) -> dict[str, object]:
    """The side that is kept or gone to, and what holds a change up."""
    if keeping.waits:
        change = "waits for a leader that turns less"
    else:
        change = "none" if keeping.change.arrived else "under way"
    return {"side": keeping.ordered.value, "side_change": change}


def _can_be(estimate: Estimate) -> bool:
    """Whether every number that the law and the prediction rest on is one that a sound estimator gives."""
    numbers = (
        estimate.rho,
        estimate.alpha2,
        estimate.v1,
        estimate.alpha1,
        estimate.u1,
        estimate.v2,
        estimate.u2,
    )
    # NaN is not below the largest, and infinity neither.
    return estimate.rho > 0.0 and all(abs(number) < _LARGEST for number in numbers)
