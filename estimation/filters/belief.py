"""A Gaussian belief about the leader in matrices, for estimators that are written so, and its model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from estimation.filters.filter_states import Guess, Horizon, SensorOffsets, ShapeState
from estimation.filters.gaussian import Gaussian, nis_of, started
from estimation.filters.leader_prior import standing_noise, within_limits
from estimation.filters.lever_arm import NO_LEVER, Lever
from estimation.models import motion
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement
from estimation.models.motion import Matrix, Vector


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """Filter state of an estimator of several models: the belief of each, and its probability to hold."""

    beliefs: tuple[Belief, ...]
    probabilities: tuple[float, ...]


class Belief(NamedTuple):
    """Mean (5,) and covariance (5, 5) of the same state, with ``filter_state`` for what they do not say."""

    mean: Vector
    covariance: Matrix
    filter_state: Modes | Guess | ShapeState | Horizon | SensorOffsets | None = None

    @property
    def gaussian(self) -> Gaussian:
        """Mean and covariance as the loop has them."""
        return Gaussian.of(self.mean, self.covariance)

    @property
    def speed(self) -> float:
        """Leader speed v1 [m/s]."""
        return self.gaussian.speed

    @property
    def sd_heading(self) -> float:
        """Standard deviation [rad] of the leader's direction of motion; infinite while its speed is zero."""
        return self.gaussian.sd_heading


class Innovation(NamedTuple):
    """What a measurement adds to a prediction: the residual (2,), its covariance (2, 2), and the NIS."""

    residual: Vector
    covariance: Matrix
    nis: float


def innovation(belief: Belief, measurement: Measurement) -> Innovation:
    """Innovation of a position measurement; its NIS should be chi-square with 2 degrees of freedom."""
    residual = measurement.position - belief.mean[0:2]
    covariance = belief.covariance[0:2, 0:2] + measurement.covariance
    nis = nis_of(belief.gaussian, measurement.x, measurement.y, measurement.spread)
    return Innovation(residual, covariance, nis)


@dataclass(frozen=True, slots=True)
class Model:
    """Front end, leader limits, process noise, and correlation time [s] of the errors of v2 and u2.

    ``lever``: where the leader's body sits; no estimator in matrices looks at it.
    """

    front_end: FrontEnd
    limits: LeaderLimits
    noise: ProcessNoise
    input_correlation: float = 0.05
    lever: Lever = NO_LEVER

    def start(self, measurement: Measurement) -> Belief:
        """Belief of one who knows the position only: w = 0 with sd k_v per axis, u1 = 0 with sd k_u."""
        begun = started(measurement.x, measurement.y, measurement.spread, self.limits)
        return Belief(begun.mean, begun.covariance)

    def propagate(self, mean: Vector, dt: float, follower: FollowerMotion) -> Vector:
        """State after dt [s]."""
        if self.front_end is FrontEnd.WORLD:
            return motion.propagate(mean, dt)
        return motion.propagate_body(mean, dt, follower)

    def transition(self, mean: Vector, dt: float, follower: FollowerMotion) -> Matrix:
        """Jacobian (5, 5) of :meth:`propagate`."""
        if self.front_end is FrontEnd.WORLD:
            return motion.transition(mean, dt)
        return motion.transition_body(mean, dt, follower)

    def process_noise(self, mean: Vector, dt: float, follower: FollowerMotion) -> Matrix:
        """Covariance (5, 5) that dt [s] adds."""
        if self.front_end is FrontEnd.WORLD:
            return motion.process_noise(mean, dt, self.noise)
        return motion.process_noise_body(mean, dt, self.noise, follower, self.input_correlation)

    def behind(self, belief: Belief) -> Model:
        """The model of what comes after a belief.

        Along the follower's axes, only a leader that is known to be slower than v_eps sets off.
        """
        if self.front_end is FrontEnd.WORLD:
            return self
        return replace(self, noise=standing_noise(belief.gaussian, self.noise))

    def within_limits(self, belief: Belief, dt: float) -> Belief:
        """Belief to which, along the follower's axes, the leader's limits are told for dt [s]."""
        if self.front_end is FrontEnd.WORLD:
            return belief
        told = within_limits(belief.gaussian, dt, self.noise, self.limits)
        return belief._replace(mean=told.mean, covariance=told.covariance)
