"""What comes of an input of the controller: it is put down as what has happened, and then decided on.

All work on the node's :class:`hil.nodes.controller_desk.Desk`. Entries of these kernels are in
:mod:`hil.nodes.controller_entries`, one for each step, and :mod:`hil.replay.replay_entries`, for many.
"""

from __future__ import annotations

from typing import NamedTuple

from controllers.follower import Command
from estimation.tracking.prediction import Reported
from formation.byte_access import read_float
from formation.kernel import kernel
from formation.records import load, store
from hil.nodes.controller_desk import BAD_STAMP, DRIVING, UNSAFE_SIDE_CHANGE, Desk, NodeRules, Notes
from hil.nodes.controller_events import NOTHING, ControlEvent, Happening
from hil.nodes.controller_step import (
    TRACKING,
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
from hil.nodes.counting import count
from hil.nodes.receipt_list import with_receipt
from hil.wire.command_layout import write_command
from hil.wire.drive_layout import write_drive
from hil.wire.estimate_layout import read_estimate
from hil.wire.message_checks import is_estimate
from hil.wire.records import CommandNumbers, ReadEstimate

_COV_ALPHA1_U1_BYTES, _VAR_U1_BYTES = 19 * 8, 24 * 8
_TICK, _ESTIMATE, _STOP = Happening.TICK.value, Happening.ESTIMATE.value, Happening.STOP.value
_LEADER, _ORDER = Happening.LEADER.value, Happening.ORDER.value
_COMMANDS, _MOVES_NOBODY = -1, -2


class _Taken(NamedTuple):
    """State with an event in it, and what comes of that: _COMMANDS, _MOVES_NOBODY, or why it is refused."""

    state: ControlState
    outcome: int


@kernel
def _taken(state: ControlState, rules: ControlRules, event: ControlEvent, now_ns: int) -> _Taken:
    """State with an event in it; whether a command is to follow, or why not."""
    state = at_time(state, now_ns)
    if event.kind == _ESTIMATE:
        if not can_be(event.reported, now_ns):
            return _Taken(state, BAD_STAMP)
        return _Taken(heard_estimate(state, rules, event.reported, event.status, now_ns), _COMMANDS)
    if event.kind == _STOP:
        return _Taken(heard_stop(state), _COMMANDS)
    if event.kind == _LEADER:
        return _Taken(heard_leader(state, event.number), _MOVES_NOBODY)
    if event.kind == _ORDER:
        ordered = heard_order(state, rules, event.number)
        return _Taken(ordered.state, _MOVES_NOBODY if ordered.taken else UNSAFE_SIDE_CHANGE)
    return _Taken(state, _COMMANDS if event.kind == _TICK else _MOVES_NOBODY)


@kernel
def _reported(payload: bytes, read: ReadEstimate) -> Reported:
    n = read.numbers
    var_u1 = read_float(payload, read.covariance_at + _VAR_U1_BYTES)
    cov = read_float(payload, read.covariance_at + _COV_ALPHA1_U1_BYTES)
    return Reported(
        n.capture_ns, n.measured_ns, n.rho, n.alpha2, n.v1, n.alpha1, n.u1, var_u1, n.v2, n.u2, cov
    )


@kernel
def _written(
    desk: Desk, state: ControlState, decided: Command, fresh: bool, stops: bytes, now_ns: int
) -> int:
    """Write a decision and its drive command, with the state after it; the length of the former."""
    rules, notes = load(NodeRules, desk.rules, 0), load(Notes, desk.notes, 0)
    capture_ns, measured_ns = 0, 0
    if state.known:
        capture_ns, measured_ns = state.sight.capture_ns, state.sight.measured_ns
    numbers = CommandNumbers(
        now_ns,
        capture_ns,
        measured_ns,
        decided.reason,
        notes.receipts,
        decided.v,
        decided.u,
        decided.v_wanted,
        decided.u_wanted,
        decided.saturated,
        fresh,
    )
    store(desk.notes, 0, Notes(0))
    write_drive(desk.drive, rules.twist_at, now_ns, decided.v, decided.u)
    return write_command(desk.decision, rules.times_at, stops, numbers, desk.receipts)


@kernel
def noted(desk: Desk, digest: int, now_ns: int) -> None:
    """Note the receipt of a message."""
    notes = load(Notes, desk.notes, 0)
    store(desk.notes, 0, Notes(with_receipt(desk.receipts, notes.receipts, digest, now_ns)))


@kernel
def estimate_heard(desk: Desk, payload: bytes, digest: int, now_ns: int) -> bool:
    """Put an estimate down as what has happened, and nothing if it is none; whether it is one."""
    noted(desk, digest, now_ns)
    read = read_estimate(payload)
    if not is_estimate(read):
        store(desk.event, 0, NOTHING)
        return False
    store(desk.event, 0, ControlEvent(_ESTIMATE, read.numbers.status, 0.0, _reported(payload, read)))
    return True


@kernel
def controlled(desk: Desk, stops: bytes, now_ns: int) -> int:
    """Step of a controller with what has happened; the length of its decision's message, 0 for none.

    ``stops``: texts of the reasons to stand still, by their code.
    """
    rules, event = load(NodeRules, desk.rules, 0).control, load(ControlEvent, desk.event, 0)
    taken = _taken(load(ControlState, desk.control, 0), rules, event, now_ns)
    if taken.outcome != _COMMANDS:
        store(desk.control, 0, taken.state)
        if taken.outcome >= 0:
            count(desk.counts, taken.outcome)
        return 0
    done = commanded(taken.state, rules, desk.commands, now_ns)
    store(desk.control, 0, done.state)
    store(desk.result, 0, done.command)
    count(desk.counts, DRIVING + done.command.reason)
    return _written(desk, done.state, done.command, event.status == TRACKING, stops, now_ns)
