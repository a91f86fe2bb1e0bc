"""The last gate before a command leaves: what may not be driven becomes a stop with its reason."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from controllers.limits import Limits
from formation.pose import STANDSTILL, Motion

CLOCK_TOLERANCE = 0.002
"""How far [s] an estimate may seem to lie in the future: the offset of well-synchronised clocks."""


class StopReason(Enum):
    """Why the robot is told to stand still; the value is the text for the log."""

    STOPPED = "stopped"
    NO_ESTIMATE = "no estimate"
    LOST = "lost"
    NOT_SETTLED = "not settled"
    STALE = "stale"
    NOT_FINITE = "not finite"


@dataclass(frozen=True, slots=True)
class Decision:
    """What leaves and why.

    ``sent`` is always finite and within the limits. ``wanted`` is what the law asked for (None if it was not
    asked or had nothing to go by). ``saturated``: sent differs from wanted because of the limits. ``stop``:
    the reason why sent is zero, None while driving.
    """

    sent: Motion
    wanted: Motion | None
    saturated: bool
    stop: StopReason | None


def decide(
    wanted: Motion | None,
    limits: Limits,
    *,
    age: float | None,
    max_age: float,
    settled: bool,
    lost: bool = False,
    stopped: bool = False,
) -> Decision:
    """Let the wanted motion through, limited, or stop.

    ``age`` [s] is that of the newest measurement under the estimate that ``wanted`` rests on, None if there
    is no estimate. It must lie in [-CLOCK_TOLERANCE, max_age]; an age that is NaN or further in the future
    is refused like one that is too old. ``settled``: the estimator has converged since it (re)started.
    ``lost``: it has given the leader up. ``stopped``: a stop was ordered. The first reason that applies is
    given, in the order of :class:`StopReason`.
    """
    reason = _refusal(wanted, age, max_age, settled=settled, lost=lost, stopped=stopped)
    if reason is not None or wanted is None:
        return Decision(STANDSTILL, wanted, saturated=False, stop=reason or StopReason.NO_ESTIMATE)
    sent, saturated = limits.apply(wanted)
    return Decision(sent, wanted, saturated, stop=None)


def _refusal(
    wanted: Motion | None, age: float | None, max_age: float, *, settled: bool, lost: bool, stopped: bool
) -> StopReason | None:
    if stopped:
        return StopReason.STOPPED
    if wanted is None or age is None:
        return StopReason.NO_ESTIMATE
    if lost:
        return StopReason.LOST
    if not settled:
        return StopReason.NOT_SETTLED
    # Asked this way round, so that NaN on either side refuses.
    if not -CLOCK_TOLERANCE <= age <= max_age:
        return StopReason.STALE
    if not (math.isfinite(wanted.v) and math.isfinite(wanted.u)):
        return StopReason.NOT_FINITE
    return None
