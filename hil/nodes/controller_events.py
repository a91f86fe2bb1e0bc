"""What happens to a controller, in numbers."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from estimation.tracking.prediction import Reported


class Happening(IntEnum):
    """What happens to a controller."""

    NOTHING = 0
    TICK = 1
    ESTIMATE = 2
    STOP = 3
    LEADER = 4
    ORDER = 5


class ControlEvent(NamedTuple):
    """What happens, in numbers.

    ``kind``: a :class:`Happening`. ``reported`` and ``status``: of an estimate. ``number``: the leader's turn
    rate [rad/s], or the sign of the side that is ordered.
    """

    kind: int
    status: int
    number: float
    reported: Reported


NO_REPORT = Reported(0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def happened(kind: Happening, number: float = 0.0) -> ControlEvent:
    """What happens that is no estimate."""
    return ControlEvent(kind.value, 0, number, NO_REPORT)


NOTHING, TICK, STOP = happened(Happening.NOTHING), happened(Happening.TICK), happened(Happening.STOP)
