"""A step of the controller, compiled: by one call from what a message says to the command."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from controllers.follower import Command
from estimation.tracking.prediction import Reported, SentCommand
from formation.kernel import entry, kernel
from formation.records import Rows, borrowed, load, store
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
