"""The filters of the loop as one record: EKF, UKF and differences, in either frame.

A filter is one object with ``start``, ``predict``, ``update`` and ``step``. These are records, so that
compiled code has them by value; estimators that cannot be compiled offer the same four
(:class:`estimation.filters.estimator.Interpreted`).
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from estimation.filters.belief import Model
from estimation.filters.difference import differenced, first_difference
from estimation.filters.ekf import driven, extended_carried, informed, mean_of, seen_by_follower
from estimation.filters.gaussian import Gaussian, nis_of, started, widened
from estimation.filters.lever_arm import NO_LEVER, Lever, at_body, at_robot
from estimation.filters.ukf import unscented_carried
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise, moved
from estimation.models.measurement import FrontEnd, Measurement
from formation.arc import swing
from formation.kernel import kernel


class Kind(IntEnum):
    """Filters that there are as records."""

    EKF = 0
    UKF = 1
    DIFFERENCE = 2


EKF = Kind.EKF.value
UKF = Kind.UKF.value
DIFFERENCE = Kind.DIFFERENCE.value


class Stepped(NamedTuple):
    """Belief after a step, and the NIS of its measurement."""

    belief: Gaussian
    nis: float


class Filter(NamedTuple):
    """A filter of a kind: ``in_world`` or along the follower's axes, with limits and noise of the leader.

    ``correlation`` [s]: of the errors of v2 and u2. ``cutoff`` [s]: of the low-pass behind differences.
    ``lever``: where the body that mocap frames show sits on the leader; differences know none.
    """

    kind: int
    in_world: bool
    limits: LeaderLimits
    noise: ProcessNoise
    correlation: float
    cutoff: float
    lever: Lever = NO_LEVER

    @property
    def model(self) -> Model:
        """The same model for estimators in matrices."""
        front_end = FrontEnd.WORLD if self.in_world else FrontEnd.BODY
        return Model(front_end, self.limits, self.noise, self.correlation, self.lever)

    @kernel
    def driven_by(self, noise: ProcessNoise) -> Filter:
        """The same filter for a leader that is driven by other noise."""
        return self._replace(noise=noise)

    @kernel
    def start(self, measurement: Measurement) -> Gaussian:
        """Belief from the first measurement alone."""
        if self.kind == DIFFERENCE:
            return first_difference(measurement, self.limits)
        begun = started(measurement.x, measurement.y, measurement.spread, self.limits)
        if self._shows_body(measurement):
            return at_robot(begun, self.lever, self.limits.v_eps)
        return begun

    @kernel
    def predict(self, belief: Gaussian, dt: float, follower: FollowerMotion) -> Gaussian:
        """Belief after dt [s], the follower having moved as given."""
        ahead = unscented_carried(belief, dt) if self.kind == UKF else extended_carried(belief, dt)
        if self.lever.vanishes():
            ahead = driven(ahead, mean_of(belief), dt, self.noise)
        else:
            ahead = self._driven_by_body(ahead, belief, dt)
        if self.kind == DIFFERENCE:
            rates = belief.rates
            ahead = ahead._replace(rates=rates._replace(elapsed=rates.elapsed + dt))
        if self.in_world:
            return ahead
        centre = moved(mean_of(belief), swing(belief.u, dt))
        return seen_by_follower(ahead, centre, dt, follower, self.correlation)

    @kernel
    def update(self, belief: Gaussian, measurement: Measurement) -> Gaussian:
        """Belief after a measurement at the belief's time."""
        if self.kind == DIFFERENCE:
            return differenced(belief, measurement, self.limits, self.cutoff)
        if self._shows_body(measurement):
            return self._informed_by_body(belief, measurement)
        return informed(belief, measurement.x, measurement.y, measurement.spread)

    @kernel
    def widened(self, belief: Gaussian, by: float) -> Gaussian:
        """Belief whose measurements turn out to have had errors of a larger variance, by a factor."""
        return widened(belief, by, self.limits)

    @kernel
    def shown(self, belief: Gaussian, measurement: Measurement) -> Gaussian:
        """Belief about what a measurement sees: the leader, or the body on it."""
        if self._shows_body(measurement):
            return at_body(belief, self.lever, self.limits.v_eps)
        return belief

    @kernel
    def _shows_body(self, measurement: Measurement) -> bool:
        return measurement.framed and not self.lever.vanishes()

    @kernel(inline=False)
    def _informed_by_body(self, belief: Gaussian, measurement: Measurement) -> Gaussian:
        body = at_body(belief, self.lever, self.limits.v_eps)
        after = informed(body, measurement.x, measurement.y, measurement.spread)
        return at_robot(after, self.lever, self.limits.v_eps)

    @kernel(inline=False)
    def _driven_by_body(self, ahead: Gaussian, before: Gaussian, dt: float) -> Gaussian:
        """Noise across the direction of travel stands for a direction that is not trusted, not for turning.

        So it must not swing the body about: it goes into the belief about the body.
        """
        body = at_body(ahead, self.lever, self.limits.v_eps)
        return at_robot(driven(body, mean_of(before), dt, self.noise), self.lever, self.limits.v_eps)

    @kernel
    def step(
        self, belief: Gaussian, dt: float, follower: FollowerMotion, measurement: Measurement, gate: float
    ) -> Stepped:
        """Belief after dt [s] and a measurement at the end of it, and the NIS of this measurement.

        One whose NIS is above ``gate``, or is not a number, is left out: the belief is then the prediction.
        """
        prior = self.predict(belief, dt, follower)
        nis = nis_of(self.shown(prior, measurement), measurement.x, measurement.y, measurement.spread)
        if nis <= gate:
            return Stepped(self.update(prior, measurement), nis)
        return Stepped(prior, nis)


def filter_of(kind: Kind, model: Model, cutoff: float = 0.1) -> Filter:
    """Filter of a kind on a model."""
    in_world = model.front_end is FrontEnd.WORLD
    return Filter(
        kind.value, in_world, model.limits, model.noise, model.input_correlation, cutoff, model.lever
    )
