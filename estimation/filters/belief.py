"""A Gaussian belief about the leader: the record that filters hand on, and the form with matrices and memory."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from estimation.filters.memory import Guess, Horizon, SensorOffsets, ShapeState
from estimation.models.coordinated_turn import LeaderLimits, Spread
from estimation.models.measurement import Measurement
from estimation.models.motion import STATE_SIZE, Matrix, Vector
from formation.kernel import kernel

_ROWS, _COLUMNS = np.triu_indices(STATE_SIZE)


class Rates(NamedTuple):
    """Memory of an estimator that differences: last range, bearing, their smoothed rates, leader's heading.

    ``samples``: differences so far, as a number that is divided by. ``elapsed`` [s]: since the last update.
    """

    rho: float
    alpha2: float
    rho_dot: float
    alpha2_dot: float
    heading: float
    samples: float
    elapsed: float


class Belief(NamedTuple):
    """Mean of the leader's state and the upper triangle of its covariance, by rows.

    The state is that of :mod:`estimation.models.coordinated_turn`, in the frame of the front end.
    """

    x: float
    y: float
    vx: float
    vy: float
    u: float
    x_x: float
    x_y: float
    x_vx: float
    x_vy: float
    x_u: float
    y_y: float
    y_vx: float
    y_vy: float
    y_u: float
    vx_vx: float
    vx_vy: float
    vx_u: float
    vy_vy: float
    vy_u: float
    u_u: float
    rates: Rates

    @staticmethod
    def of(mean: Vector, covariance: Matrix) -> Belief:
        """Belief of a mean (5,) and a covariance (5, 5)."""
        return Belief(*mean.tolist(), *covariance[_ROWS, _COLUMNS].tolist(), NO_RATES)

    @property
    def mean(self) -> Vector:
        """State (5,)."""
        return np.array(self[:STATE_SIZE])

    @property
    def covariance(self) -> Matrix:
        """Covariance (5, 5)."""
        matrix = np.empty((STATE_SIZE, STATE_SIZE))
        matrix[_ROWS, _COLUMNS] = matrix[_COLUMNS, _ROWS] = self[STATE_SIZE:-1]
        return matrix

    @property
    def speed(self) -> float:
        """Leader speed v1 [m/s]."""
        return speed_of(self)

    @property
    def sd_heading(self) -> float:
        """See :func:`sd_heading_of`."""
        return sd_heading_of(self)


NO_RATES = Rates(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def speed_of(belief: Belief) -> float:
    """Leader speed v1 [m/s]."""
    return math.sqrt(belief.vx * belief.vx + belief.vy * belief.vy)


@kernel
def sd_heading_of(belief: Belief) -> float:
    """Standard deviation [rad] of the leader's direction of motion; infinite while its speed is zero.

    Of the worst case, by the most uncertain axis of the velocity: an error along this axis makes the velocity
    itself point along it, and what is uncertain across it is then little.
    """
    speed = speed_of(belief)
    if speed == 0.0:
        return math.inf
    half, across = 0.5 * (belief.vx_vx - belief.vy_vy), belief.vx_vy
    largest = 0.5 * (belief.vx_vx + belief.vy_vy) + math.sqrt(half * half + across * across)
    return math.sqrt(max(0.0, largest)) / speed


@kernel
def started(x: float, y: float, spread: Spread, limits: LeaderLimits) -> Belief:
    """Belief of one who knows the position only: w = 0 with sd k_v per axis, u1 = 0 with sd k_u."""
    speed, turn = limits.k_v * limits.k_v, limits.k_u * limits.k_u
    return Belief(
        x, y, 0.0, 0.0, 0.0,
        spread.xx, spread.xy, 0.0, 0.0, 0.0,
        spread.yy, 0.0, 0.0, 0.0,
        speed, 0.0, 0.0,
        speed, 0.0,
        turn,
        Rates(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    )  # fmt: skip


@kernel
def nis_of(belief: Belief, x: float, y: float, spread: Spread) -> float:
    """Normalised innovation squared of a position: chi-square with 2 degrees of freedom if all is well."""
    p, q, r = belief.x_x + spread.xx, belief.x_y + spread.xy, belief.y_y + spread.yy
    dx, dy = x - belief.x, y - belief.y
    return (r * dx * dx - 2.0 * q * dx * dy + p * dy * dy) / (p * r - q * q)


@dataclass(frozen=True, slots=True)
class Modes:
    """Memory of an estimator of several models: the belief of each, and the probability that it holds."""

    beliefs: tuple[MatrixBelief, ...]
    probabilities: tuple[float, ...]


class MatrixBelief(NamedTuple):
    """Mean (5,) and covariance (5, 5) of the same state, with ``memory`` for what they do not say."""

    mean: Vector
    covariance: Matrix
    memory: Modes | Guess | ShapeState | Horizon | SensorOffsets | None = None

    @property
    def speed(self) -> float:
        """Leader speed v1 [m/s]."""
        return speed_of(Belief.of(self.mean, self.covariance))

    @property
    def sd_heading(self) -> float:
        """See :func:`sd_heading_of`."""
        return sd_heading_of(Belief.of(self.mean, self.covariance))


class Innovation(NamedTuple):
    """What a measurement adds to a prediction: the residual (2,), its covariance (2, 2), and the NIS."""

    residual: Vector
    covariance: Matrix
    nis: float


def innovation(belief: MatrixBelief, measurement: Measurement) -> Innovation:
    """Innovation of a position measurement; its NIS should be chi-square with 2 degrees of freedom."""
    residual = measurement.position - belief.mean[0:2]
    covariance = belief.covariance[0:2, 0:2] + measurement.covariance
    record = Belief.of(belief.mean, belief.covariance)
    return Innovation(residual, covariance, nis_of(record, measurement.x, measurement.y, measurement.spread))
