"""The follower's own motion out of its own mocap track: a small filter on [x, y, theta, v, u].

Position x, y [m] and heading theta [rad] in the mocap frame, speed v [m/s] along the heading and turn rate
u [rad/s]. Poses are its measurements, and odometry of the same moment may be fused in. Like the leader's,
this track is a fold in the order of capture times, so that a pose that comes late is put where it belongs.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from estimation.models.measurement import PoseNoise
from estimation.models.motion import FollowerMotion, Matrix, Vector, turn_integrals
from formation.angles import wrap
from formation.pose import Pose

TRACK_CORRELATION = 0.001
"""Correlation time [s] of the errors of v and u out of a track.

Their integrals stay within the noise of a pose, so that over a second they add up to no more: with heading
noise sd_theta the density 2 sd_u^2 correlation of a random walk is 2 sd_theta^2 per second. Filtered poses
of a driven robot have a ratio of sd_theta to sd_u of about 0.03 s.
"""

ODOMETRY_CORRELATION = 0.05
"""Correlation time [s] of the errors of odometry: samples closer together tell less than their number."""

_NS = 1e-9
_SIZE = 5
_AT_REST = np.zeros(2)
_POSE, _MOTION = slice(0, 3), slice(3, 5)
_GATES = {2: 18.42, 3: 21.11}  # chi-square quantiles of 0.9999, by degrees of freedom
_REACQUIRE = 5  # poses in a row that do not fit, after which the filter starts anew
_SETTLING = 2.0  # seconds after which the filter's covariance no longer changes
_LONGEST = 1.0  # seconds without a pose, after which it does so too


@dataclass(frozen=True, slots=True)
class OwnNoise:
    """What is known of the follower: the noise of its mocap pose, and its limits v_max [m/s], u_max [rad/s].

    A robot goes from rest to its limits within about a second, so that v and u are driven by white noise of
    densities v_max^2 and u_max^2 per second.
    """

    pose: PoseNoise
    v_max: float
    u_max: float


@dataclass(frozen=True, slots=True, eq=False)
class OwnPoint:
    """The filter right after one pose: mean (5,), covariance (5, 5).

    ``used_ns``: capture time of the newest pose that was used. ``rejected``: poses since then.
    """

    capture_ns: int
    pose: Pose
    odometry: FollowerMotion | None
    mean: Vector
    covariance: Matrix
    used_ns: int
    rejected: int = 0

    @property
    def motion(self) -> FollowerMotion:
        """Speed and turn rate with their standard deviations."""
        variances = np.diagonal(self.covariance)[_MOTION]
        return FollowerMotion(*self.mean[_MOTION].tolist(), *np.sqrt(variances).tolist())


OwnTrack = tuple[OwnPoint, ...]


def fold(
    track: OwnTrack,
    capture_ns: int,
    pose: Pose,
    odometry: FollowerMotion | None,
    noise: OwnNoise,
    span: float,
) -> OwnTrack:
    """Track with a pose, and odometry of the same moment if given, folded in at its place in time.

    Points more than ``span`` [s] older than the newest are forgotten, but for one. A pose of a moment that
    the track has, or from before it began, changes nothing.
    """
    if not track:
        return (_begun(capture_ns, pose, odometry, noise),)
    place = bisect.bisect_left(track, capture_ns, key=_capture_ns)
    if place == 0 or (place < len(track) and track[place].capture_ns == capture_ns):
        return track
    points = [*track[:place], _follow(track[place - 1], capture_ns, pose, odometry, noise)]
    for later in track[place:]:
        points.append(_follow(points[-1], later.capture_ns, later.pose, later.odometry, noise))
    oldest_ns = points[-1].capture_ns - round(span / _NS)
    first = bisect.bisect_left(points, oldest_ns, key=_capture_ns)
    return tuple(points[max(first - 1, 0) :])


def refolded(
    track: OwnTrack, since_ns: int, odometry_at: Callable[[int], FollowerMotion | None], noise: OwnNoise
) -> OwnTrack:
    """Track with the odometry that is now known at its poses from ``since_ns`` on.

    Its first point stays as it is: what that rests on is gone, or nothing.
    """
    place = max(1, bisect.bisect_left(track, since_ns, key=_capture_ns))
    points = list(track[:place])
    for due in track[place:]:
        points.append(_follow(points[-1], due.capture_ns, due.pose, odometry_at(due.capture_ns), noise))
    return tuple(points)


def own_motion(track: OwnTrack, capture_ns: int) -> FollowerMotion | None:
    """Motion at the capture time of a pose of the track; None for a moment that it does not have."""
    place = bisect.bisect_left(track, capture_ns, key=_capture_ns)
    if place == len(track) or track[place].capture_ns != capture_ns:
        return None
    return track[place].motion


def steady_noise(
    noise: OwnNoise, period: float, odometry: FollowerMotion | None = None
) -> tuple[float, float]:
    """Standard deviations of v [m/s] and u [rad/s] out of a track of poses that come every ``period`` [s].

    Those of a robot that drives straight on at half its speed, after two seconds; odometry of every pose's
    moment is fused in if its noise is given.
    """
    speed, period_ns = 0.5 * noise.v_max, round(period / _NS)
    told = odometry and FollowerMotion(speed, 0.0, odometry.sd_v2, odometry.sd_u2)
    track: OwnTrack = ()
    for k in range(max(2, math.ceil(_SETTLING / period))):
        track = fold(track, k * period_ns, Pose(speed * k * period, 0.0, 0.0), told, noise, 0.0)
    motion = track[-1].motion
    return motion.sd_v2, motion.sd_u2


def _capture_ns(point: OwnPoint) -> int:
    return point.capture_ns


def _begun(
    capture_ns: int, pose: Pose, odometry: FollowerMotion | None, noise: OwnNoise, motion: Vector = _AT_REST
) -> OwnPoint:
    """Point of one who knows the pose only: in motion (2,) as given, give or take the limits."""
    mean = np.array([pose.x, pose.y, pose.theta, *motion])
    spread = [noise.pose.position, noise.pose.position, noise.pose.heading, noise.v_max, noise.u_max]
    return OwnPoint(capture_ns, pose, odometry, mean, np.diag(np.square(spread)), capture_ns)


def _follow(
    last: OwnPoint, capture_ns: int, pose: Pose, odometry: FollowerMotion | None, noise: OwnNoise
) -> OwnPoint:
    """Fold one pose, newer than the point, into it."""
    if (capture_ns - last.used_ns) * _NS > _LONGEST:
        return _begun(capture_ns, pose, odometry, noise)
    dt = (capture_ns - last.capture_ns) * _NS
    mean, covariance = _predicted(last, dt, noise)
    used_ns, rejected = capture_ns, 0
    residual = np.array([pose.x, pose.y, pose.theta]) - mean[_POSE]
    residual[2] = wrap(float(residual[2]))
    spread = np.array([noise.pose.position, noise.pose.position, noise.pose.heading])
    updated = _updated(mean, covariance, _POSE, residual, spread)
    if updated is None:
        used_ns, rejected = last.used_ns, last.rejected + 1
        if rejected >= _REACQUIRE:
            return _begun(capture_ns, pose, odometry, noise, mean[_MOTION])
    else:
        mean, covariance = updated
    if odometry is not None:
        told = np.array([odometry.v2, odometry.u2]) - mean[_MOTION]
        thinned = math.sqrt(max(1.0, 2.0 * ODOMETRY_CORRELATION / dt))
        trust = thinned * np.array([odometry.sd_v2, odometry.sd_u2])
        mean, covariance = _updated(mean, covariance, _MOTION, told, trust) or (mean, covariance)
    return OwnPoint(capture_ns, pose, odometry, mean, covariance, used_ns, rejected)


def _updated(
    mean: Vector, covariance: Matrix, rows: slice, residual: Vector, spread: Vector
) -> tuple[Vector, Matrix] | None:
    """Kalman update (Joseph form) by a direct measurement of some rows; None if it is outside the gate."""
    expected = covariance[rows, rows] + np.diag(spread**2)
    if float(residual @ np.linalg.solve(expected, residual)) > _GATES[len(spread)]:
        return None
    gain = np.linalg.solve(expected, covariance[rows, :]).T
    moved = mean + gain @ residual
    moved[2] = wrap(float(moved[2]))
    rest = np.eye(_SIZE)
    rest[:, rows] -= gain
    after = rest @ covariance @ rest.T + (gain * spread**2) @ gain.T
    return moved, 0.5 * (after + after.T)


def _predicted(last: OwnPoint, dt: float, noise: OwnNoise) -> tuple[Vector, Matrix]:
    """Mean and covariance after dt [s] of the exact arc; white noise on v and u is carried into the pose."""
    x, y, theta, v, u = last.mean.tolist()
    s, c, ds, dc = turn_integrals(u, dt)
    cos_t, sin_t = math.cos(theta), math.sin(theta)
    ahead, aside = cos_t * s - sin_t * c, sin_t * s + cos_t * c
    mean = np.array([x + v * ahead, y + v * aside, theta + u * dt, v, u])
    move = np.eye(_SIZE)
    move[0, 2:] = [-v * aside, ahead, v * (cos_t * ds - sin_t * dc)]
    move[1, 2:] = [v * ahead, aside, v * (sin_t * ds + cos_t * dc)]
    move[2, 4] = dt
    # Unit accelerations ahead and in turn: what they drive, and through it the pose.
    ramp = np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    drive = np.zeros((_SIZE, 2))
    drive[0, 0], drive[1, 0], drive[3, 1] = cos_t, sin_t, 1.0
    turn = np.zeros((_SIZE, 2))
    turn[2, 0], turn[4, 1] = 1.0, 1.0
    added = noise.v_max**2 * drive @ ramp @ drive.T + noise.u_max**2 * turn @ ramp @ turn.T
    return mean, move @ last.covariance @ move.T + added
