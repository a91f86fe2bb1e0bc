"""What goes wrong with a motion capture: faults put over the poses that it would have shown."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from formation.kernel import kernel
from formation.pose import Pose
from formation.records import Rows, load, rows_of, size, store
from formation.wrapping import wrapped
from hil.scenario.emulated import FaultSection


class FaultKind(IntEnum):
    """Kinds of fault; the names in lower case are the words of scenarios."""

    STEP = 0
    TURN = 1
    SWAP = 2
    FREEZE = 3
    DROPOUT = 4


class Touched(IntEnum):
    """Bodies that a fault touches; the names in lower case are the words of scenarios."""

    LEADER = 0
    FOLLOWER = 1
    BOTH = 2


_TURN, _SWAP, _FREEZE, _DROPOUT = (
    FaultKind.TURN.value,
    FaultKind.SWAP.value,
    FaultKind.FREEZE.value,
    FaultKind.DROPOUT.value,
)
_LEADER, _FOLLOWER = Touched.LEADER.value, Touched.FOLLOWER.value


class Fault(NamedTuple):
    """A fault from ``at_s`` after the leader set off; see :class:`hil.scenario.emulated.FaultSection`."""

    kind: int
    body: int
    at_s: float
    duration_s: float
    dx: float
    dy: float
    angle: float


class Pair(NamedTuple):
    """Poses of both bodies in one frame."""

    leader: Pose
    follower: Pose


class Shown(NamedTuple):
    """What a frame shows of both bodies; ``lost``: there is no frame."""

    pair: Pair
    lost: bool


def fault_rows(sections: Sequence[FaultSection]) -> Rows[Fault]:
    """A scenario's faults, in their order."""
    rows = rows_of(Fault, len(sections))
    for k, given in enumerate(sections):
        kind, body = FaultKind[given.kind.upper()].value, Touched[given.body.upper()].value
        store(rows, k, Fault(kind, body, given.at_s, given.duration_s, *given.offset, given.angle))
    return rows


@kernel
def is_active(fault: Fault, t: float, period: float) -> bool:
    """Whether a fault touches the frame at t [s]; one without duration touches just one frame of a period."""
    return fault.at_s <= t < fault.at_s + max(fault.duration_s, period)


@kernel(inline=False)
def faulty(faults: Rows[Fault], t: float, period: float, pair: Pair, last: Pair) -> Shown:
    """Frame at t [s] under all faults of that moment, in their order.

    ``last``: the frame shown before, or this one without one, which a frozen body repeats. ``period`` [s]:
    from frame to frame.
    """
    for k in range(size(faults)):
        fault = load(Fault, faults, k)
        if not is_active(fault, t, period):
            continue
        if fault.kind == _DROPOUT:
            return Shown(pair, True)
        if fault.kind == _SWAP:
            pair = Pair(pair.follower, pair.leader)
            continue
        leader, follower = pair.leader, pair.follower
        if fault.body != _FOLLOWER:
            leader = _moved(fault, leader, last.leader)
        if fault.body != _LEADER:
            follower = _moved(fault, follower, last.follower)
        pair = Pair(leader, follower)
    return Shown(pair, False)


@kernel
def _moved(fault: Fault, pose: Pose, last: Pose) -> Pose:
    if fault.kind == _FREEZE:
        return last
    if fault.kind == _TURN:
        return Pose(pose.x, pose.y, wrapped(pose.theta + fault.angle))
    return Pose(pose.x + fault.dx, pose.y + fault.dy, pose.theta)
