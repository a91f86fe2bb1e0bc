"""Whether odometry tells the motion that the follower's own mocap track shows, from window to window.

Twist and pose of odometry are added up to ways, v along the heading and u turned, and the track to the same
between the same times. Their means over half a second differ by noise whose size is known, so that a window
has a misfit, chi-square with two degrees of freedom. The misfits add up as in a CUSUM test: what exceeds the
99 % quantile counts against a source, what falls short of it in its favour, and one window alone refutes
nothing. A refuted source is trusted again once enough windows in which the robot moves have borne it out.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.own_motion.odometry_history import InputTrust
from estimation.own_motion.own_track import OwnNoise
from formation.kernel import kernel
from formation.pose import Pose
from formation.records import Rows, load, size, store
from formation.ring import EMPTY, Ring, place
from formation.wrapping import wrapped

WINDOW = 0.5
"""Length [s] over which motion is averaged: mocap noise is then far below what a driven robot does."""

STEP = 0.1
"""Least time [s] between two entries of the ways."""

SCALE = 0.05
"""Standard deviation of a healthy scale: wheels are known to some percent, and slip a little."""

_LEVER = 0.01  # [m]; the body's origin is put over the wheel axis within about this
_SMALL, _LARGE = 9.21, 27.63  # chi-square quantiles of 0.99 and 0.999999 with 2 degrees of freedom
_REFUTED = 18.42  # their difference, also the quantile of 0.9999: no single window reaches it
_MOST_NEEDED = 64  # windows
_FORGETS = 0.9  # share of sums that is left after a window
_ALIKE = 0.8  # squared correlation above which a channel is the motion by another scale
_GAP = 1.0  # [s] without a sample or a pose, over which nothing is added up
_HALF_SMALL = 1e-6
_NS = 1e-9

TWIST, POSE, TRACK = 0, 1, 2
"""What the follower's motion is taken from: odometry's twist, its pose, or the mocap track."""


class OdometrySample(NamedTuple):
    """What a robot tells of itself: v2 [m/s], u2 [rad/s], and its pose in a frame of its own, if any."""

    stamp_ns: int
    v2: float
    u2: float
    has_pose: bool
    pose: Pose


class Ways(NamedTuple):
    """Way along the heading [m], backwards negative, and turned angle [rad]."""

    v: float
    u: float


class WayEntry(NamedTuple):
    """Ways until a stamp: by odometry's twist, by its pose, and by the track (0 until that is known)."""

    stamp_ns: int
    twist: Ways
    pose: Ways
    track: Ways


class SourceCheck(NamedTuple):
    """How far a source is believed.

    excess: of its misfits. borne_out: windows in a row that speak for it. needs: how many of these a refuted
    one needs; every time that it is refuted again, twice as many.
    """

    excess: float
    borne_out: int
    needs: int
    trusted: bool


class Sums(NamedTuple):
    """Squares and products of what is told and what the track shows, of one channel, since doubt began.

    slipped: of what is told and what the track shows times its turn rate's size; by_slip: of the latter with
    what the track shows; slip: its square. misfit: chi-square.
    """

    told: float
    both: float
    shown: float
    slipped: float
    by_slip: float
    slip: float
    misfit: float


@kernel
def no_sums() -> Sums:
    """Sums of nothing."""
    return Sums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class OdometryCheck(NamedTuple):
    """All that is known of how odometry does; ``heard``: whether there was a sample.

    last: the newest sample. period [s]: mean time between samples. twist, pose: ways until then. entries,
    paired: ring of the ways, and how many of them have the track's. track, at: the track's way and pose at
    the last of these. since: where the window under way begins, ``windowed`` whether there is one.
    by_twist, by_pose: both sources. v, u: sums of the twist. late [s]: how much later than the motion
    odometry is, negative if earlier, 0 if not. doubt: mean misfit for a delay. bad_ns: when the newest
    sample came that was not finite. resets, reset_ns: how often its pose has jumped, and when last.
    place_noise, heading_noise: variance of the track's poses over what is told of it, of ``poses``.
    """

    heard: bool
    last: OdometrySample
    period: float
    twist: Ways
    pose: Ways
    entries: Ring
    paired: int
    track: Ways
    at: Pose
    windowed: bool
    since: WayEntry
    by_twist: SourceCheck
    by_pose: SourceCheck
    v: Sums
    u: Sums
    late: float
    doubt: float
    bad_ns: int
    resets: int
    reset_ns: int
    place_noise: float
    heading_noise: float
    poses: int


_NO_WAY = Ways(0.0, 0.0)
_NO_ENTRY = WayEntry(0, _NO_WAY, _NO_WAY, _NO_WAY)
_BELIEVED = SourceCheck(0.0, 0, 2, True)
_NO_SAMPLE = OdometrySample(0, 0.0, 0.0, False, Pose(0.0, 0.0, 0.0))
UNCHECKED = OdometryCheck(
    heard=False,
    last=_NO_SAMPLE,
    period=0.0,
    twist=_NO_WAY,
    pose=_NO_WAY,
    entries=EMPTY,
    paired=0,
    track=_NO_WAY,
    at=Pose(0.0, 0.0, 0.0),
    windowed=False,
    since=_NO_ENTRY,
    by_twist=_BELIEVED,
    by_pose=_BELIEVED,
    v=no_sums(),
    u=no_sums(),
    late=0.0,
    doubt=0.0,
    bad_ns=0,
    resets=0,
    reset_ns=0,
    place_noise=1.0,
    heading_noise=1.0,
    poses=0,
)


@kernel
def source_of(check: OdometryCheck) -> int:
    """Which source the follower's motion is taken from: the first that is not refuted.

    A pose stands in for a twist only while nothing at all speaks against it.
    """
    if check.late != 0.0:
        return TRACK
    if check.by_twist.trusted:
        return TWIST
    by_pose = check.by_pose
    return POSE if check.last.has_pose and by_pose.trusted and by_pose.borne_out > 0 else TRACK


@kernel
def way_between(before: Pose, after: Pose) -> Ways:
    """Way of the arc from a pose to the next."""
    dx, dy, turned = after.x - before.x, after.y - before.y, wrapped(after.theta - before.theta)
    half = 0.5 * turned
    middle = before.theta + half
    way = dx * math.cos(middle) + dy * math.sin(middle)
    if abs(half) > _HALF_SMALL:
        way = way * half / math.sin(half)
    return Ways(way, turned)


@kernel
def _sum(a: Ways, b: Ways) -> Ways:
    return Ways(a.v + b.v, a.u + b.u)


@kernel
def _restarted(check: OdometryCheck) -> OdometryCheck:
    """Check that adds up anew: what came before does not hang together with what comes."""
    return check._replace(entries=Ring(0, 0), paired=0, windowed=False)


@kernel
def way_entry(entries: Rows[WayEntry], ring: Ring, k: int) -> WayEntry:
    """The ring's k-th entry, the oldest being the 0th."""
    return load(WayEntry, entries, place(ring, entries, k))


@kernel(inline=False)
def with_sample(
    check: OdometryCheck, entries: Rows[WayEntry], sample: OdometrySample, limits: OwnNoise
) -> OdometryCheck:
    """Check with a sample of odometry; one that is not newer than the last tells nothing.

    A pose that has moved faster than twice the robot's limits, 5 cm and 0.5 rad apart, was reset: the way
    goes on by the twist.
    """
    last = check.last
    if not check.heard:
        return check._replace(heard=True, last=sample)
    dt = (sample.stamp_ns - last.stamp_ns) * _NS
    if dt <= 0.0:
        return check
    check = check._replace(last=sample)
    if dt > _GAP:
        return _restarted(check)
    period = dt if check.period == 0.0 else check.period + 0.125 * (dt - check.period)
    half = 0.5 * dt
    by_twist = Ways(half * (last.v2 + sample.v2), half * (last.u2 + sample.u2))
    by_pose = by_twist
    if last.has_pose and sample.has_pose:
        by_pose = way_between(last.pose, sample.pose)
        if abs(by_pose.v) > 2.0 * limits.v_max * dt + 0.05 or abs(by_pose.u) > 2.0 * limits.u_max * dt + 0.5:
            by_pose = by_twist
            check = check._replace(resets=check.resets + 1, reset_ns=sample.stamp_ns)
    check = check._replace(period=period, twist=_sum(check.twist, by_twist), pose=_sum(check.pose, by_pose))
    ring = check.entries
    if ring.length > 0:
        newest_ns = way_entry(entries, ring, ring.length - 1).stamp_ns
        if (sample.stamp_ns - newest_ns) * _NS < STEP:
            return check
    if ring.length == size(entries):
        ring = Ring(place(ring, entries, 1), ring.length - 1)
        if check.paired == 0:
            return _restarted(check)
        check = check._replace(paired=check.paired - 1)
    entry = WayEntry(sample.stamp_ns, check.twist, check.pose, Ways(0.0, 0.0))
    store(entries, place(ring, entries, ring.length), entry)
    return check._replace(entries=Ring(ring.first, ring.length + 1))


@kernel
def awaits_track(check: OdometryCheck) -> bool:
    """Whether there is an entry whose track is to be found."""
    return check.paired < check.entries.length


@kernel
def without_track(check: OdometryCheck) -> OdometryCheck:
    """Check whose next entry has no pose of the track near it."""
    return _restarted(check)


@kernel(inline=False)
def with_track(
    check: OdometryCheck, entries: Rows[WayEntry], pose: Pose, noise: OwnNoise, trust: InputTrust
) -> OdometryCheck:
    """Check whose next entry has got its pose of the track; at the end of a window it is judged."""
    ring, k = check.entries, check.paired
    entry = way_entry(entries, ring, k)
    track = check.track
    if k > 0:
        track = _sum(track, way_between(check.at, pose))
    entry = entry._replace(track=track)
    store(entries, place(ring, entries, k), entry)
    check = check._replace(paired=k + 1, track=track, at=pose)
    if not check.windowed:
        return check._replace(windowed=True, since=entry)
    if (entry.stamp_ns - check.since.stamp_ns) * _NS < WINDOW:
        return check
    return _judged(check, entry, noise, trust)._replace(since=entry)


class Window(NamedTuple):
    """Mean motions over a window: told by twist and by pose, shown by the track; their variances."""

    twist: Ways
    pose: Ways
    track: Ways
    variance: Ways


@kernel
def mean_ways(after: Ways, before: Ways, dt: float) -> Ways:
    """Mean motion between two points of a way."""
    return Ways((after.v - before.v) / dt, (after.u - before.u) / dt)


@kernel
def window_of(before: WayEntry, after: WayEntry, noise: OwnNoise, trust: InputTrust) -> Window:
    """Window between two entries.

    Variances: noise of the two poses; of odometry that of a sample, as it may be a bias; a scale of 5 %; and
    a speed that a lever arm of 1 cm makes of a turn.
    """
    dt = (after.stamp_ns - before.stamp_ns) * _NS
    track = mean_ways(after.track, before.track, dt)
    place_, heading = noise.pose.position / dt, noise.pose.heading / dt
    scaled_v, scaled_u, lever = SCALE * track.v, SCALE * track.u, _LEVER * track.u
    return Window(
        mean_ways(after.twist, before.twist, dt),
        mean_ways(after.pose, before.pose, dt),
        track,
        Ways(
            2.0 * place_ * place_ + trust.sd_v2 * trust.sd_v2 + scaled_v * scaled_v + lever * lever,
            2.0 * heading * heading + trust.sd_u2 * trust.sd_u2 + scaled_u * scaled_u,
        ),
    )


@kernel
def _square(value: float, variance: float) -> float:
    return value * value / variance


@kernel
def _judged(check: OdometryCheck, after: WayEntry, noise: OwnNoise, trust: InputTrust) -> OdometryCheck:
    """Check at the end of a window."""
    window = window_of(check.since, after, noise, trust)
    told, track, variance = window.twist, window.track, window.variance
    misfit_v = _square(told.v - track.v, variance.v)
    misfit_u = _square(told.u - track.u, variance.u)
    tells = _square(track.v, variance.v) + _square(track.u, variance.u) > _SMALL
    if not check.by_twist.trusted:
        # Of a scale of 1.3, say, a robot that creeps tells nothing.
        v, u = check.v.misfit > _SMALL, check.u.misfit > _SMALL
        off_v = _off_by(check.v) * track.v if v or not u else 0.0
        off_u = _off_by(check.u) * track.u if u or not v else 0.0
        tells = _square(off_v, variance.v) + _square(off_u, variance.u) > _SMALL
    by_twist = _with_window(check.by_twist, misfit_v + misfit_u, tells)
    by_pose = check.by_pose
    if check.last.has_pose:
        off = _square(window.pose.v - track.v, variance.v) + _square(window.pose.u - track.u, variance.u)
        by_pose = _with_window(by_pose, off, tells)
    check = check._replace(by_twist=by_twist, by_pose=by_pose)
    if by_twist.trusted and by_twist.excess == 0.0:
        return check._replace(v=no_sums(), u=no_sums())
    return check._replace(
        v=_with_products(check.v, told.v, track.v, abs(track.u), misfit_v),
        u=_with_products(check.u, told.u, track.u, abs(track.u), misfit_u),
    )


@kernel
def _off_by(sums: Sums) -> float:
    """By how much of the true motion a refuted channel is off: its scale, or all of it if it is none."""
    if sums.both * sums.both < _ALIKE * sums.told * sums.shown or sums.shown <= 0.0:
        return -1.0
    off = sums.both / sums.shown - 1.0
    return off if abs(off) > 2.0 * SCALE else -1.0


@kernel
def _with_window(source: SourceCheck, misfit: float, tells: bool) -> SourceCheck:
    """Source after one more window, which speaks for it only if it ``tells`` it from a wrong one."""
    excess = max(0.0, source.excess + min(misfit, _LARGE) - _SMALL)
    if misfit > _SMALL:
        trusted = source.trusted and excess <= _REFUTED
        refuted_now = source.trusted and not trusted
        needs = min(2 * source.needs, _MOST_NEEDED) if refuted_now else source.needs
        return SourceCheck(min(excess, 2.0 * _REFUTED), 0, needs, trusted)
    borne_out = min(source.borne_out + 1, _MOST_NEEDED) if tells else source.borne_out
    trusted = source.trusted or borne_out >= source.needs
    if trusted and not source.trusted:
        excess = 0.0
    return SourceCheck(excess, borne_out, source.needs, trusted)


@kernel
def _with_products(sums: Sums, told: float, shown: float, turns: float, misfit: float) -> Sums:
    slip = shown * turns
    return Sums(
        _FORGETS * sums.told + told * told,
        _FORGETS * sums.both + told * shown,
        _FORGETS * sums.shown + shown * shown,
        _FORGETS * sums.slipped + told * slip,
        _FORGETS * sums.by_slip + shown * slip,
        _FORGETS * sums.slip + slip * slip,
        _FORGETS * sums.misfit + misfit,
    )
