"""Odometry judged by the follower's own mocap track: what each pose of the track brings to the check."""

from __future__ import annotations

import math

from estimation.models.coordinated_turn import FollowerMotion
from estimation.own_motion.odometry_check import (
    OdometryCheck,
    WayEntry,
    awaits_track,
    no_sums,
    way_entry,
    window_of,
    with_track,
    without_track,
)
from estimation.own_motion.odometry_delay import delay_of, misfit_of, tight_variances
from estimation.own_motion.odometry_history import InputTrust
from estimation.own_motion.own_track import OwnNoise, OwnPoint, own_place, own_point
from formation.angles import wrapped
from formation.kernel import kernel
from formation.pose import Pose
from formation.records import Rows
from formation.ring import Ring

_APART = 0.3  # [s]; two poses further apart tell nothing of the moment in between
_DOUBTS = 9.21  # chi-square quantile of 0.99 with 2 degrees of freedom, of a mean: far above any healthy one
_NS = 1e-9
_FRESH = 2.0  # periods of odometry
_FIRST_PERIOD = 0.1  # [s] that is taken for granted while a sample is the only one


@kernel(inline=False)
def with_own_track(
    check: OdometryCheck,
    entries: Rows[WayEntry],
    own: Rows[OwnPoint],
    ring: Ring,
    noise: OwnNoise,
    trust: InputTrust,
) -> OdometryCheck:
    """Check with all that the track now tells of the moments at which odometry was added up."""
    later_ns = lateness_ns(trust)
    while awaits_track(check):
        at_ns = way_entry(entries, check.entries, check.paired).stamp_ns + later_ns
        k = own_place(own, ring, at_ns)
        if k == ring.length:
            return check
        after = own_point(own, ring, k)
        before = own_point(own, ring, k - 1) if k > 0 else after
        if after.capture_ns != at_ns and (k == 0 or (after.capture_ns - before.capture_ns) * _NS > _APART):
            return without_track(check)
        pose = _pose_between(before, after, at_ns)
        since = check.since
        check = with_track(check, entries, pose, noise, trust)
        if since.stamp_ns != check.since.stamp_ns and since.stamp_ns > 0:
            check = _doubted(check, since, entries, noise, trust)
    return check


@kernel
def _pose_between(before: OwnPoint, after: OwnPoint, at_ns: int) -> Pose:
    """Pose of the track at a time, linear between its points."""
    a, b = before.state, after.state
    if after.capture_ns == at_ns or after.capture_ns <= before.capture_ns:
        return Pose(b.x, b.y, b.theta)
    share = (at_ns - before.capture_ns) / (after.capture_ns - before.capture_ns)
    return Pose(
        a.x + share * (b.x - a.x),
        a.y + share * (b.y - a.y),
        wrapped(a.theta + share * wrapped(b.theta - a.theta)),
    )


@kernel
def _doubted(
    check: OdometryCheck, since: WayEntry, entries: Rows[WayEntry], noise: OwnNoise, trust: InputTrust
) -> OdometryCheck:
    """Check after a window, in view of whether odometry tells of another moment."""
    window = window_of(since, check.since, noise, trust)
    dt = (check.since.stamp_ns - since.stamp_ns) * _NS
    misfit = misfit_of(window.twist, window.track, tight_variances(window.track, dt, noise, trust))
    doubt = check.doubt + 0.2 * (misfit - check.doubt)
    check = check._replace(doubt=doubt)
    if doubt <= _DOUBTS and check.late == 0.0:
        return check
    late = delay_of(entries, check.entries, check.paired, noise, trust)
    if late == 0.0 and check.late != 0.0:
        if doubt > _DOUBTS:
            return check
        # What has told of another moment is not trusted at once, even if it now looks well.
        by_twist = check.by_twist._replace(excess=0.0, borne_out=0, trusted=False)
        return check._replace(late=0.0, by_twist=by_twist, v=no_sums(), u=no_sums())
    return check._replace(late=late)


@kernel
def lateness_ns(trust: InputTrust) -> int:
    """By how much the motion comes after its signal [ns]."""
    return math.floor(trust.delay / _NS + 0.5)


@kernel
def age_of(check: OdometryCheck, capture_ns: int, trust: InputTrust) -> float:
    """How long [s] before a capture the motion was of which the newest sample tells; 0 if it was not."""
    return max(0.0, (capture_ns - check.last.stamp_ns - lateness_ns(trust)) * _NS)


@kernel
def fresh_for(check: OdometryCheck) -> float:
    """How long [s] a sample is as good as new: two periods of odometry."""
    return _FRESH * (check.period if check.period > 0.0 else _FIRST_PERIOD)


@kernel
def aged(motion: FollowerMotion, check: OdometryCheck, age: float, noise: OwnNoise) -> FollowerMotion:
    """Motion by a sample of an age [s]: since then the robot may have changed it.

    As on the track, v and u are driven by white noise of v_max^2 and u_max^2 per second, from two periods of
    odometry on.
    """
    over = age - fresh_for(check)
    if over <= 0.0:
        return motion
    sd_v = math.sqrt(motion.sd_v2 * motion.sd_v2 + noise.v_max * noise.v_max * over)
    sd_u = math.sqrt(motion.sd_u2 * motion.sd_u2 + noise.u_max * noise.u_max * over)
    return motion._replace(sd_v2=sd_v, sd_u2=sd_u)


@kernel
def is_better(one: FollowerMotion, other: FollowerMotion, noise: OwnNoise) -> bool:
    """Whether a motion is known better than another, either channel measured by the robot's limits."""
    by_v, by_u = 1.0 / (noise.v_max * noise.v_max), 1.0 / (noise.u_max * noise.u_max)
    first = one.sd_v2 * one.sd_v2 * by_v + one.sd_u2 * one.sd_u2 * by_u
    second = other.sd_v2 * other.sd_v2 * by_v + other.sd_u2 * other.sd_u2 * by_u
    return first < second
