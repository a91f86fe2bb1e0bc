"""The follower's own motion out of its own mocap track: a small filter on [x, y, theta, v, u].

Position x, y [m] and heading theta [rad] in the mocap frame, speed v [m/s] along the heading and turn rate
u [rad/s]. Poses are its measurements, and odometry of the same moment may be fused in. Like the leader's,
this track is a fold in the order of capture times, so that a pose that comes late is put where it belongs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import PoseNoise
from formation.arc import swing
from formation.kernel import kernel
from formation.pose import Pose
from formation.records import Rows, load, size, store
from formation.ring import Ring, place
from formation.wrapping import wrapped

TRACK_CORRELATION = 0.001
"""Correlation time [s] of the errors of v and u out of a track.

Their integrals stay within the noise of a pose, so that over a second they add up to no more: with heading
noise sd_theta the density 2 sd_u^2 correlation of a random walk is 2 sd_theta^2 per second. Filtered poses
of a driven robot have a ratio of sd_theta to sd_u of about 0.03 s.
"""

ODOMETRY_CORRELATION = 0.05
"""Correlation time [s] of the errors of odometry: samples closer together tell less than their number."""

_NS = 1e-9
_POSE_GATE, _MOTION_GATE = 21.11, 18.42  # chi-square quantiles of 0.9999 with 3 and 2 degrees of freedom
_REACQUIRE = 5  # poses in a row that do not fit, after which the filter starts anew
_LONGEST = 1.0  # seconds without a pose, after which it does so too


class OwnNoise(NamedTuple):
    """What is known of the follower: the noise of its mocap pose, and its limits v_max [m/s], u_max [rad/s].

    A robot goes from rest to its limits within about a second, so that v and u are driven by white noise of
    densities v_max^2 and u_max^2 per second.
    """

    pose: PoseNoise
    v_max: float
    u_max: float


class OwnState(NamedTuple):
    """Pose [m, rad] and motion [m/s, rad/s] of the follower; also a column of their covariance."""

    x: float
    y: float
    theta: float
    v: float
    u: float


class OwnSpread(NamedTuple):
    """Upper triangle, by rows, of the covariance of x, y, theta (t), v and u."""

    x_x: float
    x_y: float
    x_t: float
    x_v: float
    x_u: float
    y_y: float
    y_t: float
    y_v: float
    y_u: float
    t_t: float
    t_v: float
    t_u: float
    v_v: float
    v_u: float
    u_u: float


class OwnPoint(NamedTuple):
    """The filter right after one pose.

    ``noise``: of the pose, as it was known when it came. ``odometry``: of the same moment, if there is any.
    ``used_ns``: capture time of the newest pose that was used. ``rejected``: poses since then.
    """

    capture_ns: int
    pose: Pose
    noise: PoseNoise
    has_odometry: bool
    odometry: FollowerMotion
    state: OwnState
    spread: OwnSpread
    used_ns: int
    rejected: int


class Updated(NamedTuple):
    """State and covariance after some measured components, and the sum of their squared innovations."""

    state: OwnState
    spread: OwnSpread
    nis: float


@kernel
def motion_of(point: OwnPoint) -> FollowerMotion:
    """Speed and turn rate with their standard deviations."""
    spread = point.spread
    sd_v, sd_u = math.sqrt(max(0.0, spread.v_v)), math.sqrt(max(0.0, spread.u_u))
    return FollowerMotion(point.state.v, point.state.u, sd_v, sd_u)


@kernel
def own_begun(
    capture_ns: int, pose: Pose, has_odometry: bool, odometry: FollowerMotion, noise: OwnNoise
) -> OwnPoint:
    """Point of one who knows the pose only: at rest, give or take the limits."""
    place, heading = noise.pose.position * noise.pose.position, noise.pose.heading * noise.pose.heading
    speed, turn = noise.v_max * noise.v_max, noise.u_max * noise.u_max
    spread = OwnSpread(
        place, 0.0, 0.0, 0.0, 0.0, place, 0.0, 0.0, 0.0, heading, 0.0, 0.0, speed, 0.0, turn
    )  # fmt: skip
    state = OwnState(pose.x, pose.y, pose.theta, 0.0, 0.0)
    return OwnPoint(capture_ns, pose, noise.pose, has_odometry, odometry, state, spread, capture_ns, 0)


@kernel
def own_followed(last: OwnPoint, due: OwnPoint, noise: OwnNoise) -> OwnPoint:
    """Fold the pose and odometry of ``due``, begun from its pose alone and newer than the point, into it."""
    if (due.capture_ns - last.used_ns) * _NS > _LONGEST:
        return due
    dt = (due.capture_ns - last.capture_ns) * _NS
    state, spread = _moved(last.state, dt), _spread_moved(last.state, last.spread, dt, noise)
    used_ns, rejected = due.capture_ns, 0
    found = _with_pose(state, spread, due.pose, due.noise)
    if found.nis > _POSE_GATE:
        used_ns, rejected = last.used_ns, last.rejected + 1
        if rejected >= _REACQUIRE:
            return _begun_anew(last, due, dt)
    else:
        state, spread = found.state, found.spread
    if due.has_odometry:
        inflation = max(1.0, 2.0 * ODOMETRY_CORRELATION / dt)
        by_odometry = _with_motion(state, spread, due.odometry, inflation)
        if by_odometry.nis <= _MOTION_GATE:
            state, spread = by_odometry.state, by_odometry.spread
    return due._replace(state=state, spread=spread, used_ns=used_ns, rejected=rejected)


@kernel
def _begun_anew(last: OwnPoint, due: OwnPoint, dt: float) -> OwnPoint:
    """Filter at the newest of poses that do not fit it, moving as from the last of them to this one.

    What it took the motion for may be what does not fit: a robot that drives faster than it is told to.
    """
    theta, turned = last.pose.theta, wrapped(due.pose.theta - last.pose.theta)
    c, s = math.cos(theta + 0.5 * turned), math.sin(theta + 0.5 * turned)
    v = (c * (due.pose.x - last.pose.x) + s * (due.pose.y - last.pose.y)) / dt
    return due._replace(state=due.state._replace(v=v, u=turned / dt))


@kernel
def _moved(state: OwnState, dt: float) -> OwnState:
    """State after dt [s] of the exact arc."""
    t = swing(state.u, dt)
    c, s = math.cos(state.theta), math.sin(state.theta)
    ahead, aside = c * t.s - s * t.c, s * t.s + c * t.c
    return state._replace(
        x=state.x + state.v * ahead, y=state.y + state.v * aside, theta=state.theta + state.u * dt
    )


@kernel
def _spread_moved(state: OwnState, p: OwnSpread, dt: float, noise: OwnNoise) -> OwnSpread:
    """Covariance after dt [s]; white noise on v and u is carried into the pose."""
    t = swing(state.u, dt)
    c, s = math.cos(state.theta), math.sin(state.theta)
    # Position by heading, by speed and by turn rate.
    xv, yv = c * t.s - s * t.c, s * t.s + c * t.c
    xt, yt = -state.v * yv, state.v * xv
    xu, yu = state.v * (c * t.s_by_u - s * t.c_by_u), state.v * (s * t.s_by_u + c * t.c_by_u)
    # Covariances of the moved position and heading, marked m, with those before.
    mx_x = p.x_x + xt * p.x_t + xv * p.x_v + xu * p.x_u
    mx_y = p.x_y + xt * p.y_t + xv * p.y_v + xu * p.y_u
    mx_t = p.x_t + xt * p.t_t + xv * p.t_v + xu * p.t_u
    mx_v = p.x_v + xt * p.t_v + xv * p.v_v + xu * p.v_u
    mx_u = p.x_u + xt * p.t_u + xv * p.v_u + xu * p.u_u
    my_y = p.y_y + yt * p.y_t + yv * p.y_v + yu * p.y_u
    my_t = p.y_t + yt * p.t_t + yv * p.t_v + yu * p.t_u
    my_v = p.y_v + yt * p.t_v + yv * p.v_v + yu * p.v_u
    my_u = p.y_u + yt * p.t_u + yv * p.v_u + yu * p.u_u
    mt_t, mt_v, mt_u = p.t_t + dt * p.t_u, p.t_v + dt * p.v_u, p.t_u + dt * p.u_u
    q_v, q_u = noise.v_max * noise.v_max, noise.u_max * noise.u_max
    twice, thrice = 0.5 * dt * dt, dt * dt * dt * (1.0 / 3.0)
    return OwnSpread(
        mx_x + xt * mx_t + xv * mx_v + xu * mx_u + thrice * q_v * c * c,
        mx_y + yt * mx_t + yv * mx_v + yu * mx_u + thrice * q_v * c * s,
        mx_t + dt * mx_u,
        mx_v + twice * q_v * c,
        mx_u,
        my_y + yt * my_t + yv * my_v + yu * my_u + thrice * q_v * s * s,
        my_t + dt * my_u,
        my_v + twice * q_v * s,
        my_u,
        mt_t + dt * mt_u + thrice * q_u,
        mt_v,
        mt_u + twice * q_u,
        p.v_v + dt * q_v,
        p.v_u,
        p.u_u + dt * q_u,
    )


@kernel
def _with_pose(state: OwnState, p: OwnSpread, pose: Pose, noise: PoseNoise) -> Updated:
    """After a pose, component by component: with independent noise that is the joint update."""
    place, heading = noise.position * noise.position, noise.heading * noise.heading
    first = _measured(
        Updated(state, p, 0.0), OwnState(p.x_x, p.x_y, p.x_t, p.x_v, p.x_u), p.x_x + place, pose.x - state.x
    )
    q = first.spread
    second = _measured(
        first, OwnState(q.x_y, q.y_y, q.y_t, q.y_v, q.y_u), q.y_y + place, pose.y - first.state.y
    )
    r = second.spread
    turned = wrapped(pose.theta - second.state.theta)
    third = _measured(second, OwnState(r.x_t, r.y_t, r.t_t, r.t_v, r.t_u), r.t_t + heading, turned)
    return third._replace(state=third.state._replace(theta=wrapped(third.state.theta)))


@kernel
def _with_motion(state: OwnState, p: OwnSpread, odometry: FollowerMotion, inflation: float) -> Updated:
    """After odometry whose samples tell less than their number, by a factor on their variance."""
    speed, turn = inflation * odometry.sd_v2 * odometry.sd_v2, inflation * odometry.sd_u2 * odometry.sd_u2
    first = _measured(
        Updated(state, p, 0.0),
        OwnState(p.x_v, p.y_v, p.t_v, p.v_v, p.v_u),
        p.v_v + speed,
        odometry.v2 - state.v,
    )
    q = first.spread
    return _measured(
        first, OwnState(q.x_u, q.y_u, q.t_u, q.v_u, q.u_u), q.u_u + turn, odometry.u2 - first.state.u
    )


@kernel
def _measured(before: Updated, column: OwnState, variance: float, residual: float) -> Updated:
    """After one measured component: its column of the covariance, its innovation and the variance of that."""
    state, p = before.state, before.spread
    if variance <= 0.0:
        return before
    by = 1.0 / variance
    x, y, t, v, u = column.x * by, column.y * by, column.theta * by, column.v * by, column.u * by
    return Updated(
        OwnState(
            state.x + x * residual,
            state.y + y * residual,
            state.theta + t * residual,
            state.v + v * residual,
            state.u + u * residual,
        ),
        OwnSpread(
            p.x_x - x * column.x,
            p.x_y - x * column.y,
            p.x_t - x * column.theta,
            p.x_v - x * column.v,
            p.x_u - x * column.u,
            p.y_y - y * column.y,
            p.y_t - y * column.theta,
            p.y_v - y * column.v,
            p.y_u - y * column.u,
            p.t_t - t * column.theta,
            p.t_v - t * column.v,
            p.t_u - t * column.u,
            p.v_v - v * column.v,
            p.v_u - v * column.u,
            p.u_u - u * column.u,
        ),
        before.nis + residual * residual * by,
    )


# The track: a ring of points


@kernel
def own_point(track: Rows[OwnPoint], ring: Ring, k: int) -> OwnPoint:
    """The ring's k-th point, the oldest being the 0th."""
    return load(OwnPoint, track, place(ring, track, k))


@kernel
def own_place(track: Rows[OwnPoint], ring: Ring, capture_ns: int) -> int:
    """Number of the points captured before a time."""
    k = ring.length
    while k > 0 and own_point(track, ring, k - 1).capture_ns >= capture_ns:
        k -= 1
    return k


@kernel(inline=False)
def own_predicted(track: Rows[OwnPoint], ring: Ring, due: OwnPoint, noise: OwnNoise) -> OwnPoint:
    """Point that the pose of ``due`` would become at its place, without putting it there.

    That of the track for a moment that it has; ``due`` itself for one from before it began.
    """
    k = own_place(track, ring, due.capture_ns)
    if k < ring.length and own_point(track, ring, k).capture_ns == due.capture_ns:
        return own_point(track, ring, k)
    if k == 0:
        return due
    return own_followed(own_point(track, ring, k - 1), due, noise)


@kernel(inline=False)
def folded(track: Rows[OwnPoint], ring: Ring, due: OwnPoint, noise: OwnNoise, span: float) -> Ring:
    """Ring with the pose of ``due`` folded in at its place in time.

    Points more than ``span`` [s] older than the newest are forgotten, but for one. A pose of a moment that
    the track has, or from before it began, changes nothing.
    """
    n = ring.length
    if n == 0:
        store(track, place(ring, track, 0), due)
        return Ring(ring.first, 1)
    k = own_place(track, ring, due.capture_ns)
    if k == 0 or (k < n and own_point(track, ring, k).capture_ns == due.capture_ns):
        return ring
    if n == size(track):
        if k == 1:
            return ring
        ring, n, k = Ring(place(ring, track, 1), n - 1), n - 1, k - 1
    if k < n:
        _folded_late(track, ring, due, noise, k)
    else:
        store(track, place(ring, track, n), own_followed(own_point(track, ring, n - 1), due, noise))
    ring = Ring(ring.first, n + 1)
    oldest_ns = own_point(track, ring, n).capture_ns - math.floor(span / _NS + 0.5)
    while ring.length > 1 and own_point(track, ring, 1).capture_ns < oldest_ns:
        ring = Ring(place(ring, track, 1), ring.length - 1)
    return ring


@kernel(inline=False)
def _folded_late(track: Rows[OwnPoint], ring: Ring, due: OwnPoint, noise: OwnNoise, k: int) -> None:
    """Put ``due`` in as the ring's k-th point, for which it has room, and fold all later ones again."""
    point = own_point(track, ring, k - 1)
    for at in range(k, ring.length + 1):
        later = own_point(track, ring, at) if at < ring.length else due
        point = own_followed(point, due, noise)
        store(track, place(ring, track, at), point)
        due = later


@kernel
def own_reprocessed(point: OwnPoint, odometry: FollowerMotion, noise: OwnNoise) -> OwnPoint:
    """A point's pose, begun anew with the odometry that is now known of its moment."""
    return own_begun(point.capture_ns, point.pose, True, odometry, noise._replace(pose=point.noise))
