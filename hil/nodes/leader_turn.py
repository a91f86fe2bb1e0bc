"""What a follower takes for the leader's steering: told by the leader, or foreseen from estimates."""

from __future__ import annotations

import math

from estimation.tracking.estimate import QUANTITIES, Estimate
from estimation.tracking.foresight import TurnTrend
from hil.scenario.parts import foresight
from hil.scenario.schema import Scenario

_U1 = QUANTITIES.index("u1")
_LARGEST = 1e6


class LeaderTurn:
    """Steering by the law of a scenario. ``ahead`` [s] is from an estimate's capture to when a command acts.

    ``is_told``: whether the law takes the turn rate that the leader is told to drive.
    """

    def __init__(self, scenario: Scenario) -> None:
        law = scenario.controller.law
        self.is_told = law == "ideal"
        self._fades, self._is_full = law == "faded", law == "feedforward"
        self._foresight = foresight(scenario)

    def trend(self, before: TurnTrend | None, estimate: Estimate, ahead: float) -> TurnTrend | None:
        """Trend with an estimate in it; one that no sound estimator gives ends it, not to stay in it."""
        variance = float(estimate.covariance[_U1, _U1])
        if not (abs(estimate.u1) < _LARGEST and 0.0 <= variance < _LARGEST):
            return None
        return self._foresight.heard(before, estimate.capture_ns, estimate.u1, variance, ahead)

    def further(self, trend: TurnTrend | None, ahead: float) -> float:
        """Angle [rad] by which the leader will have turned further than its estimated u1 turns it.

        None without a trend, and none for the law that feeds u1 forward in full, whatever its noise: the
        slope would be in what it does twice.
        """
        return 0.0 if trend is None or self._is_full else self._foresight.further(trend, ahead)

    def when_acting(self, told: float, trend: TurnTrend | None, ahead: float) -> float:
        """Turn rate to give to the law: ``told`` for all laws that foresee none; nan without a trend."""
        if not (self._fades or self._is_full):
            return told
        if trend is None:
            return math.nan
        u1 = self._foresight.predicted(trend)
        return u1 * self._foresight.weight(trend.variance, ahead) if self._fades else u1
