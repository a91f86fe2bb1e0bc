"""Odometry judged by the follower's own mocap track: what each pose of the track brings to the check."""

from __future__ import annotations

import math

from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import PoseNoise
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
from estimation.own_motion.own_track import OwnNoise, OwnPoint, motion_of, own_place, own_point
from formation.kernel import kernel
from formation.pose import Pose
from formation.records import Rows
from formation.ring import Ring
from formation.wrapping import wrapped

_APART = 0.3  # [s]; two poses further apart tell nothing of the moment in between
_DOUBTS = 9.21  # chi-square quantile of 0.99 with 2 degrees of freedom, of a mean: far above any healthy one
_REMEMBERED, _CUT = 64, 30.0  # values over which noise is averaged, and of their mean, above which one is cut
_QUADRUPLES = 4  # of poses that are looked at together
_OFTEN = 0.025  # [s]; over four poses so far apart no robot shows a third difference
_TRACK_HOLDS = 4.0  # variance over what is told of it
_OUTLIER = 21.11  # chi-square quantile of 0.9999 with 3 degrees of freedom, of a pose off its track
_RULED_OUT, _SLIP = 27.63, 0.1  # chi-square quantile of 0.999999 with 2 degrees of freedom
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
        for back in range(0, _QUADRUPLES * 4, 4):
            check = _with_noise(check, own, ring, k - back, noise)
        seen, since = _as_seen(check, noise), check.since
        # A track that is told too little noise gets lost: its poses are better than what it makes of them.
        gate = _OUTLIER if max(check.place_noise, check.heading_noise) < _TRACK_HOLDS else math.inf
        pose = _pose_between(before, after, at_ns, seen, gate)
        check = with_track(check, entries, pose, seen, trust)
        if since.stamp_ns != check.since.stamp_ns and since.stamp_ns > 0:
            check = _doubted(check, since, entries, seen, trust)
    return check


@kernel
def _with_noise(
    check: OdometryCheck, own: Rows[OwnPoint], ring: Ring, k: int, noise: OwnNoise
) -> OdometryCheck:
    """Check that has seen how far poses are off a smooth motion.

    Third differences of four poses at equal times have 20 times the variance of one, and next to nothing of
    a robot's motion where frames come often; where they do not, or come unevenly, noise is as it is told.
    """
    if k < 3:
        return check
    a, b, c, d = (
        own_point(own, ring, k - 3),
        own_point(own, ring, k - 2),
        own_point(own, ring, k - 1),
        own_point(own, ring, k),
    )
    first, last = b.capture_ns - a.capture_ns, d.capture_ns - c.capture_ns
    middle = c.capture_ns - b.capture_ns
    uneven = max(abs(first - middle), abs(last - middle))
    if last * _NS > _OFTEN or uneven * 20 > middle:
        return check
    dx = d.pose.x - 3.0 * (c.pose.x - b.pose.x) - a.pose.x
    dy = d.pose.y - 3.0 * (c.pose.y - b.pose.y) - a.pose.y
    turned = (
        wrapped(d.pose.theta - c.pose.theta)
        - 2.0 * wrapped(c.pose.theta - b.pose.theta)
        + wrapped(b.pose.theta - a.pose.theta)
    )
    place = 40.0 * noise.pose.position * noise.pose.position
    heading = 20.0 * noise.pose.heading * noise.pose.heading
    if place <= 0.0 or heading <= 0.0:
        return check
    poses = min(check.poses + 1, _REMEMBERED)
    return check._replace(
        place_noise=_averaged(check.place_noise, (dx * dx + dy * dy) / place, poses),
        heading_noise=_averaged(check.heading_noise, turned * turned / heading, poses),
        poses=poses,
    )


@kernel
def _averaged(mean: float, value: float, count: int) -> float:
    """Mean with one more value, an outlier's cut off; a robot that stands shows less noise than it has."""
    return max(1.0, mean + (min(value, _CUT * mean) - mean) / count)


@kernel
def _as_seen(check: OdometryCheck, noise: OwnNoise) -> OwnNoise:
    """Noise of the track's poses, no smaller than it is told."""
    place, heading = math.sqrt(max(1.0, check.place_noise)), math.sqrt(max(1.0, check.heading_noise))
    return noise._replace(pose=PoseNoise(place * noise.pose.position, heading * noise.pose.heading))


@kernel
def _shown(point: OwnPoint, noise: OwnNoise, gate: float) -> Pose:
    """The pose that a point rests on, or where its track has it if that pose is an outlier."""
    state, pose, spread = point.state, point.pose, point.spread
    dx, dy, turned = pose.x - state.x, pose.y - state.y, wrapped(pose.theta - state.theta)
    place = 2.0 * noise.pose.position * noise.pose.position + spread.x_x + spread.y_y
    heading = noise.pose.heading * noise.pose.heading + spread.t_t
    if dx * dx + dy * dy > gate * place or turned * turned > gate * heading:
        return Pose(state.x, state.y, state.theta)
    return pose


@kernel
def _pose_between(before: OwnPoint, after: OwnPoint, at_ns: int, noise: OwnNoise, gate: float) -> Pose:
    """Pose of the track at a time, linear between its points."""
    a, b = _shown(before, noise, gate), _shown(after, noise, gate)
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
def contradicts(motion: FollowerMotion, own: OwnPoint) -> bool:
    """Whether odometry tells another motion than the follower's own track has at the moment, beyond doubt.

    A judgement takes two windows of half a second; until then nothing need be believed that poses rule out.
    What counts are deviations of both and a tenth of the motion, as wheels slip; of a track whose newest pose
    was no outlier.
    """
    if own.rejected > 0:
        return False
    shown = motion_of(own)
    v, u = motion.v2 - shown.v2, motion.u2 - shown.u2
    slip_v, slip_u = _SLIP * shown.v2, _SLIP * shown.u2
    by_v = motion.sd_v2 * motion.sd_v2 + shown.sd_v2 * shown.sd_v2 + slip_v * slip_v
    by_u = motion.sd_u2 * motion.sd_u2 + shown.sd_u2 * shown.sd_u2 + slip_u * slip_u
    return v * v * by_u + u * u * by_v > _RULED_OUT * by_v * by_u


@kernel
def is_better(one: FollowerMotion, other: FollowerMotion, noise: OwnNoise) -> bool:
    """Whether a motion is known better than another, either channel measured by the robot's limits."""
    by_v, by_u = 1.0 / (noise.v_max * noise.v_max), 1.0 / (noise.u_max * noise.u_max)
    first = one.sd_v2 * one.sd_v2 * by_v + one.sd_u2 * one.sd_u2 * by_u
    second = other.sd_v2 * other.sd_v2 * by_v + other.sd_u2 * other.sd_u2 * by_u
    return first < second
