"""A Gaussian belief about the leader and the model that moves it, in the frame of the front end."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from estimation.filters.memory import Guess, Horizon, SensorOffsets, ShapeState
from estimation.models import motion
from estimation.models.measurement import FrontEnd, Measurement
from estimation.models.motion import FollowerMotion, LeaderLimits, Matrix, ProcessNoise, Vector


@dataclass(frozen=True, slots=True)
class Rates:
    """Memory of an estimator that differences: the last range and bearing, and their smoothed rates."""

    rho: float
    alpha2: float
    rho_dot: float
    alpha2_dot: float
    heading: float
    samples: int


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """Memory of an estimator of several models: the belief of each, and the probability that it holds."""

    beliefs: tuple[Belief, ...]
    probabilities: tuple[float, ...]


class Belief(NamedTuple):
    """Mean (5,) and covariance (5, 5) of the state of :mod:`estimation.models.motion`.

    A tuple, since frozen dataclasses take as long to build as a filter takes to compute.

    ``rates`` and ``elapsed`` (time since the last update [s]) are kept by estimators that difference,
    ``memory`` by those that know more than mean and covariance say.
    """

    mean: Vector
    covariance: Matrix
    rates: Rates | None = None
    elapsed: float = 0.0
    memory: Modes | Guess | ShapeState | Horizon | SensorOffsets | None = None

    @property
    def speed(self) -> float:
        """Leader speed v1 [m/s]."""
        return math.hypot(float(self.mean[2]), float(self.mean[3]))

    @property
    def sd_heading(self) -> float:
        """Standard deviation [rad] of the leader's direction of motion; infinite while its speed is zero.

        Of the worst case, by the most uncertain axis of the velocity: an error along this axis makes the
        velocity itself point along it, and what is uncertain across it is then little.
        """
        speed = self.speed
        if speed == 0.0:
            return math.inf
        (a, b), (_, d) = self.covariance[2:4, 2:4].tolist()
        return math.sqrt(max(0.0, 0.5 * (a + d) + math.hypot(0.5 * (a - d), b))) / speed


@dataclass(frozen=True, slots=True)
class Model:
    """How a belief moves between measurements: front end, leader limits, process and input noise."""

    front_end: FrontEnd
    limits: LeaderLimits
    noise: ProcessNoise
    input_correlation: float = 0.05

    def start(self, measurement: Measurement) -> Belief:
        """Belief of one who knows the position only: w = 0 with sd k_v per axis, u1 = 0 with sd k_u."""
        mean = np.zeros(motion.STATE_SIZE)
        mean[0:2] = measurement.position
        covariance = np.diag([0.0, 0.0, self.limits.k_v**2, self.limits.k_v**2, self.limits.k_u**2])
        covariance[0:2, 0:2] = measurement.covariance
        return Belief(mean, covariance)

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


@dataclass(frozen=True, slots=True, eq=False)
class Innovation:
    """What a measurement adds to a prediction: the residual (2,), its covariance (2, 2), and the NIS."""

    residual: Vector
    covariance: Matrix
    nis: float


def innovation(belief: Belief, measurement: Measurement) -> Innovation:
    """Innovation of a position measurement; its NIS should be chi-square with 2 degrees of freedom."""
    residual = measurement.position - belief.mean[0:2]
    covariance = belief.covariance[0:2, 0:2] + measurement.covariance
    (a, b), (_, d) = covariance.tolist()
    x, y = residual.tolist()
    nis = (d * x * x - 2.0 * b * x * y + a * y * y) / (a * d - b * b)
    return Innovation(residual, covariance, nis)
