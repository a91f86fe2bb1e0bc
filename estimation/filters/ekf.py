"""The extended Kalman filter on the coordinated turn, written out by the blocks of its covariance.

Predict is F P F' + Q in a fixed frame, then along the follower's axes where they are the frame; update is
Joseph's form for a measured position with its full covariance. Nothing of the symmetric half is done twice.
"""

from __future__ import annotations

from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import (
    FollowerMotion,
    ProcessNoise,
    Push,
    Spread,
    State,
    acceleration,
    along_follower,
    by_own_speed,
    by_own_turn,
    by_turn_rate,
    input_density,
    moved,
)
from formation.arc import Swing, swing
from formation.kernel import kernel


@kernel
def mean_of(b: Gaussian) -> State:
    """Mean of a belief."""
    return State(b.x, b.y, b.vx, b.vy, b.u)


@kernel
def extended_moved(b: Gaussian, dt: float, noise: ProcessNoise) -> Gaussian:
    """Carry a belief through dt [s] in a fixed frame: the covariance by the Jacobian of the motion."""
    return swung_on(b, swing(b.u, dt), dt, noise)


@kernel
def swung_on(b: Gaussian, t: Swing, dt: float, noise: ProcessNoise) -> Gaussian:
    """The same by a swing that is known."""
    before = mean_of(b)
    after = moved(before, t)
    j = by_turn_rate(before, after, t, dt)
    co, si, s, c = t.cos, t.sin, t.s, t.c
    # Covariances of the moved quantities, marked m, with those before.
    mx_u = b.x_u + s * b.vx_u - c * b.vy_u + j.x * b.u_u
    my_u = b.y_u + c * b.vx_u + s * b.vy_u + j.y * b.u_u
    mvx_u, mvy_u = co * b.vx_u - si * b.vy_u + j.vx * b.u_u, si * b.vx_u + co * b.vy_u + j.vy * b.u_u
    mx_vx = b.x_vx + s * b.vx_vx - c * b.vx_vy + j.x * b.vx_u
    mx_vy = b.x_vy + s * b.vx_vy - c * b.vy_vy + j.x * b.vy_u
    my_vx = b.y_vx + c * b.vx_vx + s * b.vx_vy + j.y * b.vx_u
    my_vy = b.y_vy + c * b.vx_vy + s * b.vy_vy + j.y * b.vy_u
    mvx_vx = co * b.vx_vx - si * b.vx_vy + j.vx * b.vx_u
    mvx_vy = co * b.vx_vy - si * b.vy_vy + j.vx * b.vy_u
    mvy_vx = si * b.vx_vx + co * b.vx_vy + j.vy * b.vx_u
    mvy_vy = si * b.vx_vy + co * b.vy_vy + j.vy * b.vy_u
    mx_x = b.x_x + s * b.x_vx - c * b.x_vy + j.x * b.x_u
    mx_y = b.x_y + s * b.y_vx - c * b.y_vy + j.x * b.y_u
    my_y = b.y_y + c * b.y_vx + s * b.y_vy + j.y * b.y_u
    carried = b._replace(
        x=after.x,
        y=after.y,
        vx=after.vx,
        vy=after.vy,
        x_x=mx_x + s * mx_vx - c * mx_vy + j.x * mx_u,
        x_y=mx_y + c * mx_vx + s * mx_vy + j.y * mx_u,
        x_vx=co * mx_vx - si * mx_vy + j.vx * mx_u,
        x_vy=si * mx_vx + co * mx_vy + j.vy * mx_u,
        x_u=mx_u,
        y_y=my_y + c * my_vx + s * my_vy + j.y * my_u,
        y_vx=co * my_vx - si * my_vy + j.vx * my_u,
        y_vy=si * my_vx + co * my_vy + j.vy * my_u,
        y_u=my_u,
        vx_vx=co * mvx_vx - si * mvx_vy + j.vx * mvx_u,
        vx_vy=si * mvx_vx + co * mvx_vy + j.vy * mvx_u,
        vx_u=mvx_u,
        vy_vy=si * mvy_vx + co * mvy_vy + j.vy * mvy_u,
        vy_u=mvy_u,
    )
    return driven(carried, before, dt, noise)


@kernel
def driven(b: Gaussian, before: State, dt: float, noise: ProcessNoise) -> Gaussian:
    """Belief with the noise of dt [s] of a leader whose state was ``before``."""
    a = acceleration(before.vx, before.vy, noise)
    twice, thrice = 0.5 * dt * dt, dt * dt * dt * (1.0 / 3.0)
    return b._replace(
        x_x=b.x_x + thrice * a.xx,
        x_y=b.x_y + thrice * a.xy,
        x_vx=b.x_vx + twice * a.xx,
        x_vy=b.x_vy + twice * a.xy,
        y_y=b.y_y + thrice * a.yy,
        y_vx=b.y_vx + twice * a.xy,
        y_vy=b.y_vy + twice * a.yy,
        vx_vx=b.vx_vx + dt * a.xx,
        vx_vy=b.vx_vy + dt * a.xy,
        vy_vy=b.vy_vy + dt * a.yy,
        u_u=b.u_u + noise.q_u * dt,
    )


@kernel
def turned(b: Gaussian, c: float, s: float) -> Gaussian:
    """Belief along axes that are turned by the angle of this cosine and sine."""
    cc, cs, ss = c * c, c * s, s * s
    return b._replace(
        x=c * b.x + s * b.y,
        y=c * b.y - s * b.x,
        vx=c * b.vx + s * b.vy,
        vy=c * b.vy - s * b.vx,
        x_x=cc * b.x_x + 2.0 * cs * b.x_y + ss * b.y_y,
        x_y=(cc - ss) * b.x_y + cs * (b.y_y - b.x_x),
        x_vx=cc * b.x_vx + cs * (b.x_vy + b.y_vx) + ss * b.y_vy,
        x_vy=cc * b.x_vy + cs * (b.y_vy - b.x_vx) - ss * b.y_vx,
        x_u=c * b.x_u + s * b.y_u,
        y_y=cc * b.y_y - 2.0 * cs * b.x_y + ss * b.x_x,
        y_vx=cc * b.y_vx + cs * (b.y_vy - b.x_vx) - ss * b.x_vy,
        y_vy=cc * b.y_vy - cs * (b.x_vy + b.y_vx) + ss * b.x_vx,
        y_u=c * b.y_u - s * b.x_u,
        vx_vx=cc * b.vx_vx + 2.0 * cs * b.vx_vy + ss * b.vy_vy,
        vx_vy=(cc - ss) * b.vx_vy + cs * (b.vy_vy - b.vx_vx),
        vx_u=c * b.vx_u + s * b.vy_u,
        vy_vy=cc * b.vy_vy - 2.0 * cs * b.vx_vy + ss * b.vx_vx,
        vy_u=c * b.vy_u - s * b.vx_u,
    )


@kernel
def spread_by(b: Gaussian, variance: float, g: Push) -> Gaussian:
    """Belief with an error of this variance in it, which pushes position and velocity as given."""
    wx, wy, wvx, wvy = variance * g.x, variance * g.y, variance * g.vx, variance * g.vy
    return b._replace(
        x_x=b.x_x + wx * g.x,
        x_y=b.x_y + wx * g.y,
        x_vx=b.x_vx + wx * g.vx,
        x_vy=b.x_vy + wx * g.vy,
        y_y=b.y_y + wy * g.y,
        y_vx=b.y_vx + wy * g.vx,
        y_vy=b.y_vy + wy * g.vy,
        vx_vx=b.vx_vx + wvx * g.vx,
        vx_vy=b.vx_vy + wvx * g.vy,
        vy_vy=b.vy_vy + wvy * g.vy,
    )


@kernel
def seen_by_follower(
    ahead: Gaussian, centre: State, dt: float, own: FollowerMotion, correlation: float
) -> Gaussian:
    """Belief along the axes of a follower that moved for dt [s], out of one along its axes before.

    ``centre``: the state that the belief was linearised around, moved in the old axes. The errors of v2 and
    u2 act as white noise of their correlation time [s].
    """
    t: Swing = swing(own.u2, dt)
    here = along_follower(centre, own.v2, t)
    seen = turned(ahead._replace(x=ahead.x - own.v2 * t.s, y=ahead.y - own.v2 * t.c), t.cos, t.sin)
    density = input_density(correlation, dt)
    seen = spread_by(seen, own.sd_v2 * own.sd_v2 * density, by_own_speed(t))
    return spread_by(seen, own.sd_u2 * own.sd_u2 * density, by_own_turn(here, own.v2, t, dt))


@kernel
def informed(a: Gaussian, x: float, y: float, spread: Spread) -> Gaussian:
    """Belief that has taken in that the leader was seen at (x, y) with this covariance."""
    ra, rb, rc = spread.xx, spread.xy, spread.yy
    p, q, r = a.x_x + ra, a.x_y + rb, a.y_y + rc
    det = p * r - q * q
    xx, xy, yy = r / det, -q / det, p / det
    dx, dy = x - a.x, y - a.y
    hx, hy = xx * dx + xy * dy, xy * dx + yy * dy
    # The inverse of the innovation's covariance times that of the position with all.
    kx_x, ky_x = xx * a.x_x + xy * a.x_y, xy * a.x_x + yy * a.x_y
    kx_y, ky_y = xx * a.x_y + xy * a.y_y, xy * a.x_y + yy * a.y_y
    kx_vx, ky_vx = xx * a.x_vx + xy * a.y_vx, xy * a.x_vx + yy * a.y_vx
    kx_vy, ky_vy = xx * a.x_vy + xy * a.y_vy, xy * a.x_vy + yy * a.y_vy
    kx_u, ky_u = xx * a.x_u + xy * a.y_u, xy * a.x_u + yy * a.y_u
    # What is left of the position is R S^-1 P: a difference of two near ones would lose its digits.
    return a._replace(
        x=a.x + a.x_x * hx + a.x_y * hy,
        y=a.y + a.x_y * hx + a.y_y * hy,
        vx=a.vx + a.x_vx * hx + a.y_vx * hy,
        vy=a.vy + a.x_vy * hx + a.y_vy * hy,
        u=a.u + a.x_u * hx + a.y_u * hy,
        x_x=ra * kx_x + rb * ky_x,
        x_y=0.5 * ((ra * kx_y + rb * ky_y) + (rb * kx_x + rc * ky_x)),
        x_vx=ra * kx_vx + rb * ky_vx,
        x_vy=ra * kx_vy + rb * ky_vy,
        x_u=ra * kx_u + rb * ky_u,
        y_y=rb * kx_y + rc * ky_y,
        y_vx=rb * kx_vx + rc * ky_vx,
        y_vy=rb * kx_vy + rc * ky_vy,
        y_u=rb * kx_u + rc * ky_u,
        vx_vx=a.vx_vx - a.x_vx * kx_vx - a.y_vx * ky_vx,
        vx_vy=a.vx_vy - a.x_vx * kx_vy - a.y_vx * ky_vy,
        vx_u=a.vx_u - a.x_vx * kx_u - a.y_vx * ky_u,
        vy_vy=a.vy_vy - a.x_vy * kx_vy - a.y_vy * ky_vy,
        vy_u=a.vy_u - a.x_vy * kx_u - a.y_vy * ky_u,
        u_u=a.u_u - a.x_u * kx_u - a.y_u * ky_u,
    )
