"""The paper's literal estimator: difference range and bearing, smooth, then Eq. (7). Kept to compare with.

Rates come by differences through a first-order low-pass of time constant ``cutoff`` [s]. rho_dot and
alpha2_dot give X and Y of the paper, these give w; u1 is the low-passed turn of w. The covariance is that of
white measurement noise through the same low-pass, of the follower's own motion as measured, and of the lag
behind a leader that turns at k_u.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.filters.gaussian import Gaussian, Rates, started
from estimation.models.coordinated_turn import LeaderLimits, Spread
from estimation.models.measurement import Measurement
from formation.kernel import kernel
from formation.wrapping import wrapped


class Polar(NamedTuple):
    """Range [m] and bearing [rad] of the leader from the follower, and the heading they are seen from."""

    rho: float
    alpha2: float
    heading: float


@kernel
def polar_of(measurement: Measurement) -> Polar:
    """Range and bearing as measured; along the follower's axes its heading counts as 0."""
    dx, dy, heading = measurement.x, measurement.y, 0.0
    if measurement.in_world:
        follower = measurement.seen.follower
        dx, dy, heading = dx - follower.x, dy - follower.y, follower.theta
    return Polar(math.sqrt(dx * dx + dy * dy), wrapped(math.atan2(dy, dx) - heading), heading)


@kernel
def first_difference(measurement: Measurement, limits: LeaderLimits) -> Gaussian:
    """Belief from the first measurement alone: no rates yet."""
    seen = polar_of(measurement)
    begun = started(measurement.x, measurement.y, measurement.spread, limits)
    return begun._replace(rates=Rates(seen.rho, seen.alpha2, 0.0, 0.0, 0.0, 0.0, 0.0))


@kernel(inline=False)
def differenced(b: Gaussian, measurement: Measurement, limits: LeaderLimits, cutoff: float) -> Gaussian:
    """Belief after a measurement: difference it against the last one and smooth."""
    last = b.rates
    dt = last.elapsed
    if dt <= 0.0:
        return b
    seen, own = polar_of(measurement), measurement.motion
    gain = max(dt / (cutoff + dt), 1.0 / (last.samples + 1.0))
    rho_dot = last.rho_dot + gain * ((seen.rho - last.rho) / dt - last.rho_dot)
    turning = wrapped(seen.alpha2 - last.alpha2) / dt
    alpha2_dot = last.alpha2_dot + gain * (turning - last.alpha2_dot)
    x = -rho_dot - own.v2 * math.cos(seen.alpha2)
    y = seen.rho * (alpha2_dot + own.u2) - own.v2 * math.sin(seen.alpha2)
    v1 = math.sqrt(x * x + y * y)
    heading = seen.alpha2 + seen.heading + math.pi - math.atan2(y, x)
    u1 = 0.0
    if last.samples > 0.0:
        turn = wrapped(heading - last.heading) / dt
        u1 = b.u + gain * (turn + (0.0 if measurement.in_world else own.u2) - b.u)
    after = started(measurement.x, measurement.y, measurement.spread, limits)._replace(
        vx=v1 * math.cos(heading),
        vy=v1 * math.sin(heading),
        u=u1,
        rates=Rates(seen.rho, seen.alpha2, rho_dot, alpha2_dot, heading, last.samples + 1.0, 0.0),
    )
    return _uncertain(after, measurement, limits, _Smoothing(dt, gain, cutoff))


class _Smoothing(NamedTuple):
    """Time since the last measurement [s], the low-pass' gain over it, and its time constant [s]."""

    dt: float
    gain: float
    cutoff: float


@kernel
def _uncertain(b: Gaussian, measurement: Measurement, limits: LeaderLimits, by: _Smoothing) -> Gaussian:
    """Belief with the covariance right after an update.

    A smoothed difference of white noise has the variance sigma^2 (gain/dt)^2 2/(2 - gain). The motion of the
    follower enters unsmoothed: v2 ahead of it, rho u2 across the line of sight.
    """
    ratio = by.gain / by.dt
    smoothed = ratio * ratio * 2.0 / (2.0 - by.gain)
    own, slow = measurement.motion, max(math.sqrt(b.vx * b.vx + b.vy * b.vy), limits.v_eps)
    lag = by.cutoff * limits.k_u * slow
    relative = _relative(measurement, smoothed)
    ahead, across = own.sd_v2 * own.sd_v2, own.sd_u2 * own.sd_u2
    c, s, nx, ny = _axes(measurement)
    vx_vx = relative.xx + lag * lag + ahead * c * c + across * nx * nx
    vx_vy = relative.xy + ahead * c * s + across * nx * ny
    vy_vy = relative.yy + lag * lag + ahead * s * s + across * ny * ny
    spread = measurement.spread
    return b._replace(
        # The newest position is one end of the newest difference.
        x_vx=ratio * spread.xx,
        x_vy=ratio * spread.xy,
        y_vx=ratio * spread.xy,
        y_vy=ratio * spread.yy,
        vx_vx=vx_vx,
        vx_vy=vx_vy,
        vy_vy=vy_vy,
        u_u=min(0.5 * (vx_vx + vy_vy) / (slow * slow) * smoothed, limits.k_u * limits.k_u),
    )


@kernel
def _axes(measurement: Measurement) -> tuple[float, float, float, float]:
    """Heading of the follower (cos, sin), and the left normal of the line to the leader times its length."""
    if not measurement.in_world:
        return 1.0, 0.0, -measurement.y, measurement.x
    pose = measurement.seen.follower
    dx, dy = measurement.x - pose.x, measurement.y - pose.y
    return math.cos(pose.theta), math.sin(pose.theta), -dy, dx


@kernel
def _relative(measurement: Measurement, share: float) -> Spread:
    """Covariance of the leader's position as the follower sees it, times a share; a pose adds its noise."""
    spread, noise = measurement.spread, measurement.noise
    if not measurement.in_world:
        return Spread(share * spread.xx, share * spread.xy, share * spread.yy)
    _, _, nx, ny = _axes(measurement)
    place, turn = noise.position * noise.position, noise.heading * noise.heading
    return Spread(
        share * (spread.xx + place + turn * nx * nx),
        share * (spread.xy + turn * nx * ny),
        share * (spread.yy + place + turn * ny * ny),
    )
