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
from estimation.filters.ekf import extended_moved, informed, mean_of, seen_by_follower
from estimation.filters.gaussian import Gaussian, nis_of, started, widened
from estimation.filters.leader_prior import SpeedTold, standing_noise, usual_speed, within_limits
from estimation.filters.lever_arm import NO_LEVER, Lever, is_centred, robot_under, swung
from estimation.filters.ukf import unscented_moved
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

    Along the follower's axes, where sensors and odometry say less, the leader's limits are told all along.
    ``correlation`` [s]: of the errors of v2 and u2. ``cutoff`` [s]: of the low-pass behind differences.
    ``lever``: where the body that mocap shows sits on the leader. Beliefs are about the body then.
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
        return started(measurement.x, measurement.y, measurement.spread, self.limits)

    @kernel
    def begun_moving(self, measurement: Measurement, ahead: Gaussian, dt: float) -> Gaussian:
        """Belief from a measurement and the one dt [s] before, of which ``ahead`` is where it was to lead.

        As uncertain as from the first alone, but moving as between the two: to whoever is faster than k_v.
        """
        begun = self.start(measurement)
        if self.kind == DIFFERENCE:
            return begun
        vx, vy = ahead.vx + (measurement.x - ahead.x) / dt, ahead.vy + (measurement.y - ahead.y) / dt
        return begun._replace(vx=vx, vy=vy)

    @kernel
    def predict(self, belief: Gaussian, dt: float, follower: FollowerMotion) -> Gaussian:
        """Belief after dt [s], the follower having moved as given."""
        noise = self.noise if self.in_world else standing_noise(belief, self.noise)
        unscented = self.kind == UKF
        ahead = unscented_moved(belief, dt, noise) if unscented else extended_moved(belief, dt, noise)
        if not is_centred(self.lever):
            ahead = swung(ahead, belief, self.lever, self.limits.v_eps, noise.q_u, dt)
        if self.kind == DIFFERENCE:
            rates = belief.rates
            ahead = ahead._replace(rates=rates._replace(elapsed=rates.elapsed + dt))
        if self.in_world:
            return ahead
        centre = moved(mean_of(belief), swing(belief.u, dt))
        seen = seen_by_follower(ahead, centre, dt, follower, self.correlation)
        return seen if self.kind == DIFFERENCE else within_limits(seen, dt, self.noise, self.limits)

    @kernel
    def update(self, belief: Gaussian, measurement: Measurement) -> Gaussian:
        """Belief after a measurement at the belief's time."""
        if self.kind == DIFFERENCE:
            return differenced(belief, measurement, self.limits, self.cutoff)
        return informed(belief, measurement.x, measurement.y, measurement.spread)

    @kernel
    def widened(self, belief: Gaussian, by: float) -> Gaussian:
        """Belief whose measurements turn out to have had errors of a larger variance, by a factor."""
        return widened(belief, by, self.limits)

    @kernel
    def leader(self, belief: Gaussian, measurement: Measurement) -> Gaussian:
        """Belief about the leader itself, the newest measurement being given; sightings see no body."""
        if is_centred(self.lever) or not measurement.framed:
            return belief
        return robot_under(belief, self.lever, self.limits.v_eps)

    @kernel
    def told_speed(self, belief: Gaussian) -> SpeedTold:
        """Belief as it is told: along the follower's axes with how fast leaders are, which stand or drive."""
        if self.in_world or self.kind == DIFFERENCE:
            return SpeedTold(belief, 0.0)
        return usual_speed(belief, self.limits)

    @kernel
    def step(
        self, belief: Gaussian, dt: float, follower: FollowerMotion, measurement: Measurement, gate: float
    ) -> Stepped:
        """Belief after dt [s] and a measurement at the end of it, and the NIS of this measurement.

        One whose NIS is above ``gate``, or is not a number, is left out: the belief is then the prediction.
        """
        prior = self.predict(belief, dt, follower)
        nis = nis_of(prior, measurement.x, measurement.y, measurement.spread)
        if nis <= gate:
            return Stepped(self.update(prior, measurement), nis)
        return Stepped(prior, nis)


def filter_of(kind: Kind, model: Model, cutoff: float = 0.1) -> Filter:
    """Filter of a kind on a model."""
    in_world = model.front_end is FrontEnd.WORLD
    return Filter(
        kind.value, in_world, model.limits, model.noise, model.input_correlation, cutoff, model.lever
    )
