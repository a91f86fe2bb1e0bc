"""The unscented Kalman filter on the coordinated turn: ten equally weighted points (cubature rule).

The points lie in pairs on both sides of the mean, along the columns of a root of five times the covariance.
Their moments are summed up about where the mean itself goes, so that every point is moved just once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.filters.ekf import driven, mean_of
from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import ProcessNoise, State, moved
from formation.arc import swing
from formation.kernel import kernel


class Pivot(NamedTuple):
    """Root of a pivot, and its inverse."""

    root: float
    inverse: float


class Sums(NamedTuple):
    """Sums over points: of their offsets from a centre, and of the products of these."""

    x: float
    y: float
    vx: float
    vy: float
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


@kernel
def _pivot(variance: float) -> Pivot:
    """Both zero for a pivot that is not positive, even if by rounding: that direction has no variance."""
    if variance <= 0.0:
        return Pivot(0.0, 0.0)
    root = math.sqrt(variance)
    return Pivot(root, 1.0 / root)


@kernel
def _with_point(sums: Sums, point: State, centre: State, dt: float) -> Sums:
    """Sums with one more point, moved by dt [s]."""
    after = moved(point, swing(point.u, dt))
    x, y, vx, vy = after.x - centre.x, after.y - centre.y, after.vx - centre.vx, after.vy - centre.vy
    u = after.u - centre.u
    return Sums(
        sums.x + x,
        sums.y + y,
        sums.vx + vx,
        sums.vy + vy,
        sums.x_x + x * x,
        sums.x_y + x * y,
        sums.x_vx + x * vx,
        sums.x_vy + x * vy,
        sums.x_u + x * u,
        sums.y_y + y * y,
        sums.y_vx + y * vx,
        sums.y_vy + y * vy,
        sums.y_u + y * u,
        sums.vx_vx + vx * vx,
        sums.vx_vy + vx * vy,
        sums.vx_u + vx * u,
        sums.vy_vy + vy * vy,
        sums.vy_u + vy * u,
        sums.u_u + u * u,
    )


@kernel(inline=False)
def _with_pair(sums: Sums, mean: State, column: State, centre: State, dt: float) -> Sums:
    """Sums with the two points that lie a column before and behind the mean."""
    m, c = mean, column
    sums = _with_point(sums, State(m.x + c.x, m.y + c.y, m.vx + c.vx, m.vy + c.vy, m.u + c.u), centre, dt)
    return _with_point(sums, State(m.x - c.x, m.y - c.y, m.vx - c.vx, m.vy - c.vy, m.u - c.u), centre, dt)


@kernel(inline=False)
def unscented_moved(b: Gaussian, dt: float, noise: ProcessNoise) -> Gaussian:
    """Carry a belief through dt [s] in a fixed frame by its points."""
    mean = mean_of(b)
    centre = moved(mean, swing(mean.u, dt))
    sums = Sums(
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )  # fmt: skip
    # Lower triangular root of five times the covariance, column by column.
    p = _pivot(5.0 * b.x_x)
    py, pvx = 5.0 * b.x_y * p.inverse, 5.0 * b.x_vx * p.inverse
    pvy, pu = 5.0 * b.x_vy * p.inverse, 5.0 * b.x_u * p.inverse
    sums = _with_pair(sums, mean, State(p.root, py, pvx, pvy, pu), centre, dt)
    q = _pivot(5.0 * b.y_y - py * py)
    qvx, qvy = (5.0 * b.y_vx - pvx * py) * q.inverse, (5.0 * b.y_vy - pvy * py) * q.inverse
    qu = (5.0 * b.y_u - pu * py) * q.inverse
    sums = _with_pair(sums, mean, State(0.0, q.root, qvx, qvy, qu), centre, dt)
    r = _pivot(5.0 * b.vx_vx - pvx * pvx - qvx * qvx)
    rvy = (5.0 * b.vx_vy - pvy * pvx - qvy * qvx) * r.inverse
    ru = (5.0 * b.vx_u - pu * pvx - qu * qvx) * r.inverse
    sums = _with_pair(sums, mean, State(0.0, 0.0, r.root, rvy, ru), centre, dt)
    s = _pivot(5.0 * b.vy_vy - pvy * pvy - qvy * qvy - rvy * rvy)
    su = (5.0 * b.vy_u - pu * pvy - qu * qvy - ru * rvy) * s.inverse
    sums = _with_pair(sums, mean, State(0.0, 0.0, 0.0, s.root, su), centre, dt)
    t = _pivot(5.0 * b.u_u - pu * pu - qu * qu - ru * ru - su * su)
    sums = _with_pair(sums, mean, State(0.0, 0.0, 0.0, 0.0, t.root), centre, dt)
    return driven(_moments(b, sums, centre), mean, dt, noise)


@kernel
def _moments(b: Gaussian, sums: Sums, centre: State) -> Gaussian:
    """Belief of ten points' mean and covariance; the mean of their turn rates is the centre's."""
    x, y, vx, vy = 0.1 * sums.x, 0.1 * sums.y, 0.1 * sums.vx, 0.1 * sums.vy
    return Gaussian(
        centre.x + x,
        centre.y + y,
        centre.vx + vx,
        centre.vy + vy,
        centre.u,
        0.1 * sums.x_x - x * x,
        0.1 * sums.x_y - x * y,
        0.1 * sums.x_vx - x * vx,
        0.1 * sums.x_vy - x * vy,
        0.1 * sums.x_u,
        0.1 * sums.y_y - y * y,
        0.1 * sums.y_vx - y * vx,
        0.1 * sums.y_vy - y * vy,
        0.1 * sums.y_u,
        0.1 * sums.vx_vx - vx * vx,
        0.1 * sums.vx_vy - vx * vy,
        0.1 * sums.vx_u,
        0.1 * sums.vy_vy - vy * vy,
        0.1 * sums.vy_u,
        0.1 * sums.u_u,
        b.rates,
    )
