"""What the limits of a leader say of its motion all along, where measurements say little.

Speed and turn rate of a random walk wander off beyond all limits. A leader of which v_eps, k_v and k_u are
known has turn rates of mean 0 and variance k_u^2 / 3, and drives at a speed between v_eps and k_v, the middle
of which is told to one that seems faster than that. One that seems slower is left alone: to be told a least
speed would hold a velocity that points the wrong way there, since the way back leads past zero. All this is
told to the belief over and over, with the density that holds a variance, driven by q, at the known one s^2:
of P' = q - P^2 / r with r = s^4 / q, s^2 is the rest point. Where measurements hold the variance far below
it, the limits have next to no weight; over a gap, or for what nobody sees, they are all there is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import LeaderLimits, ProcessNoise
from formation.kernel import kernel

_LEAST_SPEED = 1e-9  # [m/s]; below it there is no direction
_SURE = 50.0  # of a log-likelihood: beyond it nothing is left of the other


class _Column(NamedTuple):
    """Covariance of a quantity with the state."""

    x: float
    y: float
    vx: float
    vy: float
    u: float


class SpeedTold(NamedTuple):
    """Belief to which the speeds of leaders are told, and how likely the leader is to stand by that."""

    belief: Gaussian
    standing: float


@kernel
def standing_noise(b: Gaussian, noise: ProcessNoise) -> ProcessNoise:
    """Noise of a leader that may be standing, as far as that is known.

    It sets off with up to q_start while its velocity is known to be below v_eps. A velocity of zero that is
    known to worse than that is no standing leader, and what it may do next is in its variance already.
    """
    floor = noise.v_eps * noise.v_eps
    return noise._replace(q_start=noise.q_start * max(0.0, 1.0 - (b.vx_vx + b.vy_vy) / floor))


@kernel(inline=False)
def within_limits(b: Gaussian, dt: float, noise: ProcessNoise, limits: LeaderLimits) -> Gaussian:
    """Belief to which the leader's limits are told for dt [s]."""
    if dt <= 0.0:
        return b
    turn = limits.k_u * limits.k_u * (1.0 / 3.0)
    by = 1.0 / (b.u_u + turn * turn / (noise.q_u * dt))
    b = _told(b, _Column(b.x_u, b.y_u, b.vx_u, b.vy_u, b.u_u), -by * b.u, by)
    speed, least = math.sqrt(b.vx * b.vx + b.vy * b.vy), limits.v_eps
    middle = 0.5 * (limits.k_v + least)
    if speed <= middle or limits.k_v <= least:
        return b
    c, s = b.vx / speed, b.vy / speed
    along = _along(b, c, s)
    # A speed says the more of a velocity the better its direction is known.
    across = c * c * b.vy_vy - 2.0 * c * s * b.vx_vy + s * s * b.vx_vx
    weight = 1.0 - across / (speed * speed)
    if weight <= 0.0:
        return b
    span = limits.k_v - least
    known = span * span * (1.0 / 12.0)
    variance = known * known / (weight * weight * noise.q_v * dt)
    by = 1.0 / (c * along.vx + s * along.vy + variance)
    return _told(b, along, by * (middle - speed), by)


@kernel(inline=False)
def usual_speed(b: Gaussian, limits: LeaderLimits) -> SpeedTold:
    """Belief with the speeds that a leader may have: it stands, or drives at any from v_eps to k_v.

    How often it stands nobody tells: as often as makes half of k_v the mean, as if any speed from zero on
    were as likely as another. Along the direction in which it seems to drive the belief is that of one which
    stands and that of one which is told the middle of the speeds, with their variance; by how well each
    explains what was seen it becomes the mean and the variance of both. To be told over and over that would
    hold a direction that is wrong, so that this is for what goes out, and nothing is carried on from it.
    Where the speed is measured well it makes no difference.
    """
    speed, span = math.sqrt(b.vx * b.vx + b.vy * b.vy), limits.k_v - limits.v_eps
    if speed <= _LEAST_SPEED or span <= 0.0:
        return SpeedTold(b, 0.0)
    along = _along(b, b.vx / speed, b.vy / speed)
    own = (b.vx * along.vx + b.vy * along.vy) / speed
    if own <= 0.0:
        return SpeedTold(b, 0.0)
    known, off = span * span * (1.0 / 12.0), 0.5 * (limits.k_v + limits.v_eps) - speed
    by = 1.0 / (own + known)
    likelier = 0.5 * (speed * speed / own - off * off * by + math.log(own * by))
    standing = 0.0
    if likelier < _SURE:
        standing = limits.v_eps / (limits.v_eps + limits.k_v * math.exp(likelier))
    driven = speed + own * by * off
    mean = (1.0 - standing) * driven
    variance = (1.0 - standing) * (own * known * by + standing * driven * driven)
    return SpeedTold(_told(b, along, (mean - speed) / own, (own - variance) / (own * own)), standing)


@kernel
def _along(b: Gaussian, c: float, s: float) -> _Column:
    """Column of the velocity along a direction."""
    return _Column(
        c * b.x_vx + s * b.x_vy,
        c * b.y_vx + s * b.y_vy,
        c * b.vx_vx + s * b.vx_vy,
        c * b.vx_vy + s * b.vy_vy,
        c * b.vx_u + s * b.vy_u,
    )


@kernel
def _told(b: Gaussian, p: _Column, shift: float, less: float) -> Gaussian:
    """Belief whose quantity of the column ``p`` has moved by shift times its variance.

    ``less`` times the square of its variance is what that loses.
    """
    x, y, vx, vy, u = less * p.x, less * p.y, less * p.vx, less * p.vy, less * p.u
    return b._replace(
        x=b.x + p.x * shift,
        y=b.y + p.y * shift,
        vx=b.vx + p.vx * shift,
        vy=b.vy + p.vy * shift,
        u=b.u + p.u * shift,
        x_x=b.x_x - x * p.x,
        x_y=b.x_y - x * p.y,
        x_vx=b.x_vx - x * p.vx,
        x_vy=b.x_vy - x * p.vy,
        x_u=b.x_u - x * p.u,
        y_y=b.y_y - y * p.y,
        y_vx=b.y_vx - y * p.vx,
        y_vy=b.y_vy - y * p.vy,
        y_u=b.y_u - y * p.u,
        vx_vx=b.vx_vx - vx * p.vx,
        vx_vy=b.vx_vy - vx * p.vy,
        vx_u=b.vx_u - vx * p.u,
        vy_vy=b.vy_vy - vy * p.vy,
        vy_u=b.vy_u - vy * p.u,
        u_u=b.u_u - u * p.u,
    )
