"""How a belief in matrices moves between measurements, by the front end."""

from __future__ import annotations

from dataclasses import dataclass

from estimation.filters.belief import MatrixBelief, started
from estimation.models import motion
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement
from estimation.models.motion import Matrix, Vector


@dataclass(frozen=True, slots=True)
class Model:
    """Front end, leader limits, process noise, and correlation time [s] of the errors of v2 and u2."""

    front_end: FrontEnd
    limits: LeaderLimits
    noise: ProcessNoise
    input_correlation: float = 0.05

    def start(self, measurement: Measurement) -> MatrixBelief:
        """Belief of one who knows the position only: w = 0 with sd k_v per axis, u1 = 0 with sd k_u."""
        begun = started(measurement.x, measurement.y, measurement.spread, self.limits)
        return MatrixBelief(begun.mean, begun.covariance)

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
