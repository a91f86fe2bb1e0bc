"""What a follower takes for the leader's steering: told by the leader, or predicted from estimates."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

from estimation.tracking.prediction import LARGEST
from estimation.tracking.turn_prediction import TurnPrediction, TurnTrend
from formation.kernel import kernel


class TurnSource(IntEnum):
    """Where a law has the leader's turn rate from.

    NOWHERE: it knows none. TOLD: what the leader is told to drive. PREDICTED: the estimate, carried on.
    FADED: this as far as it is worth it. OWN: the estimate carried on, for a law that may do with it what it
    likes; the leader is predicted as for one that knows none.
    """

    NOWHERE = 0
    TOLD = 1
    PREDICTED = 2
    FADED = 3
    OWN = 4


class TurnSpread(NamedTuple):
    """Variance of an estimated u1 [rad^2/s^2], and its covariance with alpha1 [rad^2/s]."""

    u1: float
    with_alpha1: float


SOURCES = {
    "independent": TurnSource.NOWHERE,
    "ideal": TurnSource.TOLD,
    "feedforward": TurnSource.PREDICTED,
    "faded": TurnSource.FADED,
}
"""Sources by the law's name; of any other law it is OWN."""

_PREDICTED, _FADED, _OWN = TurnSource.PREDICTED.value, TurnSource.FADED.value, TurnSource.OWN.value


def source_of(law: str) -> TurnSource:
    """Source for a law by its name."""
    return SOURCES.get(law, TurnSource.OWN)


@kernel
def trend_with(
    turn_prediction: TurnPrediction,
    before: TurnTrend,
    capture_ns: int,
    u1: float,
    spread: TurnSpread,
    ahead: float,
) -> TurnTrend:
    """Trend with an estimate in it; one that no sound estimator gives ends it, not to stay in it.

    ``ahead`` [s] is from the estimate's capture to when a command acts.
    """
    variance = spread.u1
    if abs(u1) < LARGEST and 0.0 <= variance < LARGEST:
        seen = turn_prediction.seen_in(variance, spread.with_alpha1)
        return seen.heard(before, capture_ns, u1, variance, ahead)
    return TurnTrend(False, 0, 0.0, 0.0, 0.0, 0.0)


@kernel
def turned_further(source: int, turn_prediction: TurnPrediction, trend: TurnTrend, ahead: float) -> float:
    """Angle [rad] by which the leader will have turned further than its estimated u1 turns it.

    None without a trend, and none for the law that feeds u1 forward in full, whatever its noise: the slope
    would be in what it does twice.
    """
    if source == _PREDICTED or not trend.known:
        return 0.0
    return turn_prediction.of_trend(trend).further(trend, ahead)


@kernel
def turn_when_acting(
    source: int, turn_prediction: TurnPrediction, trend: TurnTrend, commanded: float, ahead: float
) -> float:
    """Turn rate [rad/s] to give to the law: ``commanded`` where none is predicted; nan without a trend."""
    if source != _PREDICTED and source != _FADED and source != _OWN:
        return commanded
    if not trend.known:
        return math.nan
    u1 = turn_prediction.predicted(trend)
    if source == _FADED:
        return u1 * turn_prediction.of_trend(trend).weight(trend.variance, ahead)
    return u1
