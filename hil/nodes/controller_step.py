"""What a controller does between bytes: estimates, stops and orders in, commands out.

A daemon does it message by message, and the compiled loop of a sweep without messages, both by these kernels.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from controllers.follower import Command, FollowerSettings, FollowerState, Outlook, command
from controllers.guard import CLOCK_TOLERANCE_NS, Standing
from controllers.resolution import NO_REMAINDER
from controllers.station_keeper import StationState, order_side
from estimation.tracking.prediction import (
    Reported,
    SentCommand,
    Sight,
    predicted,
    sight_of,
    still_needed,
    with_command,
)
from estimation.tracking.tracker import Status
from estimation.tracking.turn_prediction import NO_TREND, TurnPrediction, TurnTrend
from formation.kernel import kernel
from formation.line import Line
from formation.pose import Motion
from formation.records import Rows
from formation.ring import EMPTY, Ring
from hil.nodes.leader_turn import TurnSpread, trend_with, turn_when_acting, turned_further

INITIALISING, TRACKING, LOST = Status.INITIALISING.value, Status.TRACKING.value, Status.LOST.value

_NS = 1e-9
_SHORTEST_STEP_NS = 1_000_000


class ControlRules(NamedTuple):
    """What a controller goes by.

    ``turn_source``: a :class:`hil.nodes.leader_turn.TurnSource`. ``lag`` [s] of the actuators;
    ``transport_ns`` until a command reaches them, ``ahead_ns`` until it acts; ``tick_ns``: longest time
    between two commands.
    """

    follower: FollowerSettings
    turn_prediction: TurnPrediction
    turn_source: int
    lag: float
    transport_ns: int
    ahead_ns: int
    tick_ns: int
    max_age_ns: int


class ControlState(NamedTuple):
    """All that a controller remembers, but for the commands on their way, which lie in rows.

    ``sight``: the newest estimate that may move the robot, ``known`` whether there is one; ``status``: of the
    newest one of any kind, ``heard`` whether there was one. ``leader_u1``: the turn rate that the leader was
    told to drive, nan before it is known. ``sent``: commands since the sight's capture, and the one before.
    """

    status: int
    heard: bool
    known: bool
    stopped: bool
    sight: Sight
    trend: TurnTrend
    leader_u1: float
    follower: FollowerState
    sent: Ring
    commanded_ns: int
    next_tick_ns: int


class OrderHeard(NamedTuple):
    """State after an order, and whether it was taken."""

    state: ControlState
    taken: bool


class Controlled(NamedTuple):
    """State after a command, and the command."""

    state: ControlState
    command: Command


NOTHING_SEEN = Sight(0, 0, Line(0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0, False)


def begun(station: StationState, now_ns: int) -> ControlState:
    """State of a controller that has heard nothing: it keeps the robot still."""
    return ControlState(
        status=INITIALISING,
        heard=False,
        known=False,
        stopped=False,
        sight=NOTHING_SEEN,
        trend=NO_TREND,
        leader_u1=math.nan,
        follower=FollowerState(station, NO_REMAINDER),
        sent=EMPTY,
        commanded_ns=0,
        next_tick_ns=now_ns,
    )


@kernel
def at_time(state: ControlState, now_ns: int) -> ControlState:
    """State to go on with at a time, before anything else.

    If the clock was set back what is known would count as new again when it gets there once more.
    """
    if now_ns >= state.commanded_ns:
        return state
    trend = TurnTrend(False, 0, 0.0, 0.0, 0.0, 0.0)
    return state._replace(known=False, trend=trend, sent=Ring(0, 0))


@kernel
def can_be(reported: Reported, now_ns: int) -> bool:
    """Whether the stamps of an estimate are possible now."""
    return reported.measured_ns <= reported.capture_ns <= now_ns + CLOCK_TOLERANCE_NS


@kernel
def heard_estimate(
    state: ControlState, rules: ControlRules, reported: Reported, status: int, now_ns: int
) -> ControlState:
    """Take an estimate in whose stamps are possible; only one that tracks may move the robot."""
    state = state._replace(status=status, heard=True)
    if status != TRACKING:
        return state
    ahead = (now_ns + rules.ahead_ns - reported.capture_ns) * _NS
    trend = trend_with(
        rules.turn_prediction,
        state.trend,
        reported.capture_ns,
        reported.u1,
        TurnSpread(reported.var_u1, reported.cov_alpha1_u1),
        ahead,
    )
    return state._replace(known=True, sight=sight_of(reported), trend=trend)


@kernel
def heard_stop(state: ControlState) -> ControlState:
    """Take in that all robots are to stop; there is no way back."""
    return state._replace(stopped=True)


@kernel
def heard_leader(state: ControlState, u1: float) -> ControlState:
    """Take in the turn rate [rad/s] that the leader is told to drive."""
    return state._replace(leader_u1=u1)


@kernel
def heard_order(state: ControlState, rules: ControlRules, sign: float) -> OrderHeard:
    """Take an order to drive on a side, unless the leader may turn too hard for that."""
    ordered = order_side(state.follower.station, rules.follower.keeper, sign)
    follower = state.follower._replace(station=ordered.state)
    return OrderHeard(state._replace(follower=follower), ordered.taken)


@kernel
def commanded(
    state: ControlState, rules: ControlRules, commands: Rows[SentCommand], now_ns: int
) -> Controlled:
    """Command of now; it is put into the rows of those on their way."""
    elapsed_ns = min(max(now_ns - state.commanded_ns, _SHORTEST_STEP_NS), rules.tick_ns)
    outlook = outlook_at(state, rules, commands, now_ns)
    driven = command(state.follower, rules.follower, outlook, standing_at(state, now_ns), elapsed_ns * _NS)
    acting = SentCommand(now_ns + rules.transport_ns, driven.command.v, driven.command.u)
    sent = with_command(commands, state.sent, acting)
    if state.known:
        # None that begins before the capture, or more than the largest age ago, but for the one at the begin.
        sent = still_needed(commands, sent, max(state.sight.capture_ns, now_ns - rules.max_age_ns))
    else:
        sent = still_needed(commands, sent, acting.from_ns)
    state = state._replace(
        follower=driven.state, sent=sent, commanded_ns=now_ns, next_tick_ns=now_ns + rules.tick_ns
    )
    return Controlled(state, driven.command)


@kernel
def standing_at(state: ControlState, now_ns: int) -> Standing:
    """What a command of now would rest on."""
    age = (now_ns - state.sight.measured_ns) * _NS
    return Standing(age, state.known, state.status != INITIALISING, state.status == LOST, state.stopped)


@kernel
def outlook_at(state: ControlState, rules: ControlRules, commands: Rows[SentCommand], now_ns: int) -> Outlook:
    """What the follower will face when a command of now acts."""
    sight, trend = state.sight, state.trend
    age = (now_ns - sight.measured_ns) * _NS
    if not (state.known and sight.sound and age <= rules.follower.max_age):
        return Outlook(sight.line, Motion(0.0, 0.0), 0.0, False)
    ahead = (now_ns + rules.ahead_ns - sight.capture_ns) * _NS
    further = turned_further(rules.turn_source, rules.turn_prediction, trend, ahead)
    u1 = turn_when_acting(rules.turn_source, rules.turn_prediction, trend, state.leader_u1, ahead)
    line = predicted(sight, commands, state.sent, now_ns + rules.ahead_ns, rules.lag, further)
    return Outlook(line, Motion(sight.v1, sight.u1), u1, True)
