"""What every estimator offers to those who fold measurements into beliefs."""

from __future__ import annotations

from typing import Protocol

from estimation.filters.belief import Belief, Model, innovation
from estimation.models.measurement import Measurement
from estimation.models.motion import FollowerMotion


class Estimator(Protocol):
    """A recursive estimator: pure, its whole state is the belief.

    Those that derive from it have ``step`` out of their ``predict`` and ``update``.
    """

    model: Model

    def start(self, measurement: Measurement) -> Belief:
        """Belief from the first measurement alone."""

    def predict(self, belief: Belief, dt: float, follower: FollowerMotion) -> Belief:
        """Belief after dt [s], the follower having moved as given."""

    def update(self, belief: Belief, measurement: Measurement) -> Belief:
        """Belief after a measurement at the belief's time."""

    def step(
        self, belief: Belief, dt: float, follower: FollowerMotion, measurement: Measurement, gate: float
    ) -> tuple[Belief, float]:
        """Belief after dt [s] and a measurement at the end of it, and the NIS of this measurement.

        One whose NIS is above ``gate`` is left out: the belief is then the prediction.
        """
        prior = self.predict(belief, dt, follower)
        nis = innovation(prior, measurement).nis
        return (self.update(prior, measurement) if nis <= gate else prior), nis
