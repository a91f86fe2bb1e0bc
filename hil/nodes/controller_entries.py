"""A step of the controller, compiled: by one call from what a message says to the command."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from controllers.follower import Command
from estimation.tracking.prediction import Reported, SentCommand
from formation.kernel import entry, kernel
from formation.records import Buffer, Rows, borrowed, load, read_float, store
from hil.nodes.controller_step import (
    ControlRules,
    ControlState,
    at_time,
    can_be,
    commanded,
    heard_estimate,
    heard_leader,
    heard_order,
    heard_stop,
)
from hil.wire.command_layout import write_command
from hil.wire.estimate_layout import read_estimate
from hil.wire.message_checks import is_estimate
from hil.wire.records import CommandNumbers, ReadEstimate, Receipt


class Happening(IntEnum):
    """What happens to a controller."""

    NOTHING = 0
    TICK = 1
    ESTIMATE = 2
    STOP = 3
    LEADER = 4
    ORDER = 5


class Outcome(IntEnum):
    """What comes of it."""

    NO_COMMAND = 0
    COMMAND = 1
    BAD_STAMP = 2
    UNSAFE_ORDER = 3


class ControlEvent(NamedTuple):
    """What happens, in numbers.

    ``kind``: a :class:`Happening`. ``reported`` and ``status``: of an estimate. ``number``: the leader's turn
    rate [rad/s], or the sign of the side that is ordered.
    """

    kind: int
    status: int
    number: float
    reported: Reported


NO_REPORT = Reported(0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

_VAR_U1_BYTES = 24 * 8
_TICK, _ESTIMATE, _STOP = Happening.TICK.value, Happening.ESTIMATE.value, Happening.STOP.value
_LEADER, _ORDER = Happening.LEADER.value, Happening.ORDER.value
_NO_COMMAND, _COMMAND = Outcome.NO_COMMAND.value, Outcome.COMMAND.value
_BAD_STAMP, _UNSAFE_ORDER = Outcome.BAD_STAMP.value, Outcome.UNSAFE_ORDER.value


class _Taken(NamedTuple):
    state: ControlState
    outcome: int


@kernel
def _taken(state: ControlState, rules: ControlRules, event: ControlEvent, now_ns: int) -> _Taken:
    """State with an event in it; whether a command is to follow, or why not."""
    state = at_time(state, now_ns)
    if event.kind == _ESTIMATE:
        if not can_be(event.reported, now_ns):
            return _Taken(state, _BAD_STAMP)
        return _Taken(heard_estimate(state, rules, event.reported, event.status, now_ns), _COMMAND)
    if event.kind == _STOP:
        return _Taken(heard_stop(state), _COMMAND)
    if event.kind == _LEADER:
        return _Taken(heard_leader(state, event.number), _NO_COMMAND)
    if event.kind == _ORDER:
        ordered = heard_order(state, rules, event.number)
        return _Taken(ordered.state, _NO_COMMAND if ordered.taken else _UNSAFE_ORDER)
    return _Taken(state, _COMMAND if event.kind == _TICK else _NO_COMMAND)


@kernel
def _reported(payload: bytes, read: ReadEstimate) -> Reported:
    n = read.numbers
    var_u1 = read_float(payload, read.covariance_at + _VAR_U1_BYTES)
    return Reported(n.capture_ns, n.measured_ns, n.rho, n.alpha2, n.v1, n.alpha1, n.u1, var_u1, n.v2, n.u2)


@entry
def hear_estimate(payload: bytes, events: Rows[ControlEvent]) -> bool:
    """Read an estimate into ``events`` (1,); whether it is one."""
    read = read_estimate(payload)
    if not is_estimate(read):
        return False
    event = ControlEvent(_ESTIMATE, read.numbers.status, 0.0, _reported(payload, read))
    store(borrowed(events), 0, event)
    return True


@entry
def tell_command(
    buffer: Buffer,
    times_at: int,
    stops: bytes,
    states: Rows[ControlState],
    results: Rows[Command],
    receipts: Rows[Receipt],
    consumed: int,
    fresh: bool,
    now_ns: int,
) -> int:
    """Fill :func:`hil.wire.templates.command_template` with the command in ``results``; returns the length.

    ``states``: that of the controller after it. ``stops``: texts of the reasons to stand still, by their
    code. ``consumed``: how many of the receipts are meant.
    """
    state, told = load(ControlState, borrowed(states), 0), load(Command, borrowed(results), 0)
    capture_ns, measured_ns = 0, 0
    if state.known:
        capture_ns, measured_ns = state.sight.capture_ns, state.sight.measured_ns
    numbers = CommandNumbers(
        now_ns,
        capture_ns,
        measured_ns,
        told.reason,
        consumed,
        told.v,
        told.u,
        told.v_wanted,
        told.u_wanted,
        told.saturated,
        fresh,
    )
    return write_command(buffer, times_at, stops, numbers, borrowed(receipts))


@entry
def control(
    states: Rows[ControlState],
    rules: Rows[ControlRules],
    commands: Rows[SentCommand],
    events: Rows[ControlEvent],
    results: Rows[Command],
    now_ns: int,
) -> int:
    """Step of a controller with the event in ``events`` (1,); an :class:`Outcome`.

    ``states`` (1,) and ``commands``, those on their way, change; a command is put into ``results`` (1,).
    """
    kept, by = borrowed(states), load(ControlRules, borrowed(rules), 0)
    taken = _taken(load(ControlState, kept, 0), by, load(ControlEvent, borrowed(events), 0), now_ns)
    if taken.outcome != _COMMAND:
        store(kept, 0, taken.state)
        return taken.outcome
    controlled = commanded(taken.state, by, borrowed(commands), now_ns)
    store(kept, 0, controlled.state)
    store(borrowed(results), 0, controlled.command)
    return taken.outcome
