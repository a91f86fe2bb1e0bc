"""A Gaussian belief about the leader in plain numbers: the record that the filters of the loop hand on."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.models.coordinated_turn import LeaderLimits, Spread
from estimation.models.motion import STATE_SIZE, Matrix, Vector
from formation.kernel import kernel

_LEAST = 1e-12  # of a variance that is divided by
_ROWS, _COLUMNS = np.triu_indices(STATE_SIZE)


class Rates(NamedTuple):
    """Filter state of one that differences: last range, bearing, their smoothed rates, leader's heading.

    ``samples``: differences so far, as a number that is divided by. ``elapsed`` [s]: since the last update.
    """

    rho: float
    alpha2: float
    rho_dot: float
    alpha2_dot: float
    heading: float
    samples: float
    elapsed: float


class Gaussian(NamedTuple):
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
    def of(mean: Vector, covariance: Matrix) -> Gaussian:
        """Record of a mean (5,) and a covariance (5, 5)."""
        return Gaussian._make([*mean.tolist(), *covariance[_ROWS, _COLUMNS].tolist(), NO_RATES])

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
    def gaussian(self) -> Gaussian:
        """Itself; what beliefs in matrices have to make first."""
        return self

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
def speed_of(belief: Gaussian) -> float:
    """Leader speed v1 [m/s]."""
    return math.sqrt(belief.vx * belief.vx + belief.vy * belief.vy)


@kernel
def variance_along(belief: Gaussian, ex: float, ey: float) -> float:
    """Variance [m^2/s^2] of the leader's velocity along a unit vector."""
    return ex * ex * belief.vx_vx + 2.0 * ex * ey * belief.vx_vy + ey * ey * belief.vy_vy


@kernel
def sd_heading_of(belief: Gaussian) -> float:
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
def started(x: float, y: float, spread: Spread, limits: LeaderLimits) -> Gaussian:
    """Belief of one who knows the position only: w = 0 with sd k_v per axis, u1 = 0 with sd k_u."""
    speed, turn = limits.k_v * limits.k_v, limits.k_u * limits.k_u
    return Gaussian(
        x, y, 0.0, 0.0, 0.0,
        spread.xx, spread.xy, 0.0, 0.0, 0.0,
        spread.yy, 0.0, 0.0, 0.0,
        speed, 0.0, 0.0,
        speed, 0.0,
        turn,
        Rates(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    )  # fmt: skip


@kernel
def widened(b: Gaussian, by: float, limits: LeaderLimits) -> Gaussian:
    """Belief with its covariance larger by a factor, but not beyond that of one who knows the limits only."""
    speed, turn = limits.k_v * limits.k_v, limits.k_u * limits.k_u
    most = min(speed / max(b.vx_vx, b.vy_vy, _LEAST), turn / max(b.u_u, _LEAST))
    f = max(1.0, min(by, most))
    return b._replace(
        x_x=f * b.x_x,
        x_y=f * b.x_y,
        x_vx=f * b.x_vx,
        x_vy=f * b.x_vy,
        x_u=f * b.x_u,
        y_y=f * b.y_y,
        y_vx=f * b.y_vx,
        y_vy=f * b.y_vy,
        y_u=f * b.y_u,
        vx_vx=f * b.vx_vx,
        vx_vy=f * b.vx_vy,
        vx_u=f * b.vx_u,
        vy_vy=f * b.vy_vy,
        vy_u=f * b.vy_u,
        u_u=f * b.u_u,
    )


@kernel
def nis_of(belief: Gaussian, x: float, y: float, spread: Spread) -> float:
    """Normalised innovation squared of a position: chi-square with 2 degrees of freedom if all is well."""
    p, q, r = belief.x_x + spread.xx, belief.x_y + spread.xy, belief.y_y + spread.yy
    dx, dy = x - belief.x, y - belief.y
    return (r * dx * dx - 2.0 * q * dx * dy + p * dy * dy) / (p * r - q * q)
