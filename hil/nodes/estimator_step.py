"""The estimator's step on plain records: a frame, a sighting or odometry in, and the track moves on.

All that the estimator knows lies in rows that its owner keeps (:class:`Memory`) and in one record that is
handed from step to step (:class:`Known`). Live daemons, lockstep, replay and sweeps call these functions.
"""

from __future__ import annotations

from typing import NamedTuple

from estimation.filters.filter import Filter
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import (
    Measurement,
    PairSeen,
    PoseNoise,
    measure_body_from_mocap,
    measure_world,
)
from estimation.own_motion.odometry_history import (
    Correction,
    InputTrust,
    MotionSample,
    delay_ns,
    follower_motion,
    remember,
    sample_at,
    sample_place,
)
from estimation.own_motion.own_track import (
    OwnNoise,
    OwnPoint,
    folded,
    motion_of,
    own_begun,
    own_followed,
    own_place,
    own_point,
    own_predicted,
    own_reprocessed,
)
from estimation.tracking.estimate import Estimate, estimate_at
from estimation.tracking.follower_check import BELIEVED, FOLLOWER, MOUNT
from estimation.tracking.follower_check import GATED as LEADER_OFF
from estimation.tracking.mount_check import MountCheck, is_off, watched
from estimation.tracking.track_point import DUPLICATE, GATED, LATE, RESTARTED, TrackPoint
from estimation.tracking.tracker import (
    REJECTING,
    TRACKING,
    TrackSettings,
    add,
    capture_at,
    newest,
    place_of,
    point_at,
    reprocessed,
    status_of,
    with_motion,
)
from formation.kernel import kernel
from formation.mount import NO_MOUNT, Mount, robot_pose
from formation.records import Rows, store
from formation.ring import Ring, place

ODOMETRY, MOCAP, FUSED = 0, 1, 2
"""Where the follower's motion is known from."""


class MountRules(NamedTuple):
    """Where the follower's body sits, and whether it is stopped if that is plainly wrong."""

    follower: Mount
    stops: bool


NO_MOUNT_RULES = MountRules(NO_MOUNT, stops=False)


class Rules(NamedTuple):
    """All that is fixed about an estimator.

    source: where the follower's motion is from. reprocesses: whether odometry that comes late is folded in
    again. span: seconds of odometry kept. noise: of a mocap pose. mounts: of the
    follower's body.
    """

    settings: TrackSettings
    filter: Filter
    source: int
    reprocesses: bool
    span: float
    noise: PoseNoise
    trust: InputTrust
    own_noise: OwnNoise
    mounts: MountRules = NO_MOUNT_RULES


class Memory(NamedTuple):
    """Rows that an estimator works in: the leader's track, odometry, the follower's own track."""

    points: Rows[TrackPoint]
    history: Rows[MotionSample]
    own: Rows[OwnPoint]


class Known(NamedTuple):
    """Where the rows are filled, by what odometry is corrected, and what is left of the follower's mount."""

    track: Ring
    odometry: Ring
    own: Ring
    correction: Correction
    mount_check: MountCheck


class Taken(NamedTuple):
    """What became of a frame or sighting: verdict and cause; ``late``: captured before the newest."""

    known: Known
    verdict: int
    cause: int
    late: bool


class Told(NamedTuple):
    """An estimate, and why the newest measurement was not used."""

    estimate: Estimate
    cause: int


@kernel
def with_robot(seen: PairSeen, rules: MountRules) -> PairSeen:
    """What a frame shows, with the follower's own pose in the place of its body's.

    The leader's stays its body's, which only the filter knows how to tell from the leader.
    """
    return seen._replace(follower=robot_pose(seen.follower, rules.follower))


@kernel
def by_odometry(known: Known, memory: Memory, rules: Rules, capture_ns: int) -> FollowerMotion:
    """Motion of the follower as odometry tells it, put right where that is known to be wrong."""
    return follower_motion(memory.history, known.odometry, capture_ns, rules.trust, known.correction)


@kernel
def due_pose(known: Known, memory: Memory, rules: Rules, capture_ns: int, seen: PairSeen) -> OwnPoint:
    """The follower's pose, ready to be folded into its own track, with odometry if that is fused."""
    told = rules.source == FUSED and known.odometry.length > 0
    odometry = FollowerMotion(0.0, 0.0, 0.0, 0.0)
    if told:
        odometry = by_odometry(known, memory, rules, capture_ns)
    return own_begun(capture_ns, seen.follower, told, odometry, rules.own_noise)


@kernel
def take_frame(known: Known, memory: Memory, rules: Rules, capture_ns: int, seen: PairSeen) -> Taken:
    """Take in a mocap frame that was captured at a time by the host's clock."""
    taken = _tracked(known, memory, rules, capture_ns, seen)
    if taken.late or taken.verdict == DUPLICATE or taken.verdict == LATE:
        return taken
    # An outlier of the follower may be one by a wrong mount.
    plain = taken.cause == BELIEVED or taken.cause == LEADER_OFF or taken.cause == FOLLOWER
    if not plain:
        return taken
    jumped = taken.verdict == RESTARTED
    check = watched(taken.known.mount_check, capture_ns, seen.follower, rules.noise, jumped)
    return taken._replace(known=taken.known._replace(mount_check=check))


@kernel
def _tracked(known: Known, memory: Memory, rules: Rules, capture_ns: int, seen: PairSeen) -> Taken:
    """Take a frame into the tracks."""
    if rules.source == ODOMETRY:
        motion = by_odometry(known, memory, rules, capture_ns)
        return take(known, memory, rules, measured(rules, capture_ns, seen, motion))
    due = due_pose(known, memory, rules, capture_ns, seen)
    motion = motion_of(own_predicted(memory.own, known.own, due, rules.own_noise))
    if known.own.length > 0 and capture_ns < own_point(memory.own, known.own, 0).capture_ns:
        motion = by_odometry(known, memory, rules, capture_ns)
    taken = take(known, memory, rules, measured(rules, capture_ns, seen, motion))
    # A follower's pose that is not believed must not move its own track either.
    believed = taken.cause == BELIEVED or taken.cause == LEADER_OFF
    if taken.verdict == DUPLICATE or taken.verdict == LATE or not believed:
        return taken
    own = folded(memory.own, taken.known.own, due, rules.own_noise, rules.settings.window)
    after = taken.known._replace(own=own)
    if taken.late:
        first = place_of(memory.points, after.track, capture_ns)
        _with_own_motion(after, memory, rules, first)
        reprocessed(memory.points, after.track, first, rules.settings, rules.filter)
    return taken._replace(known=after)


@kernel
def measured(rules: Rules, capture_ns: int, seen: PairSeen, motion: FollowerMotion) -> Measurement:
    """What a frame measures of the leader, by the front end."""
    leader = (seen.leader_x, seen.leader_y)
    if rules.filter.in_world:
        return measure_world(capture_ns, leader, seen.follower, rules.noise, motion)
    return measure_body_from_mocap(capture_ns, leader, seen.follower, rules.noise, motion)


@kernel
def take(known: Known, memory: Memory, rules: Rules, measurement: Measurement) -> Taken:
    """Take in a measurement of the leader."""
    points, ring = memory.points, known.track
    late = ring.length > 0 and measurement.capture_ns < capture_at(points, ring, ring.length - 1)
    added = add(points, ring, measurement, rules.settings, rules.filter)
    cause = added.cause if added.verdict == GATED else BELIEVED
    return Taken(known._replace(track=added.ring), added.verdict, cause, late)


@kernel
def take_odometry(known: Known, memory: Memory, rules: Rules, sample: MotionSample) -> Known:
    """Take in a sample of odometry, and fold again what came after the sample before it."""
    ring = remember(memory.history, known.odometry, sample, rules.span)
    known = known._replace(odometry=ring)
    n = known.track.length
    if not rules.reprocesses or n == 0:
        return known
    k, since_ns = sample_place(memory.history, ring, sample.stamp_ns), 0
    if k > 0:
        before = sample_at(memory.history, ring, k - 1)
        since_ns = before.stamp_ns + delay_ns(rules.trust, known.correction) + 1
    if capture_at(memory.points, known.track, n - 1) < since_ns:
        return known
    first = place_of(memory.points, known.track, since_ns)
    if rules.source == FUSED:
        _own_again(known, memory, rules, since_ns)
        changed = _with_own_motion(known, memory, rules, first)
    else:
        changed = _with_odometry(known, memory, rules, first)
    if changed:
        reprocessed(memory.points, known.track, first, rules.settings, rules.filter)
    return known


@kernel
def _with_odometry(known: Known, memory: Memory, rules: Rules, first: int) -> bool:
    """Give the points from the ``first`` on the motion that odometry now tells; whether any has changed."""
    changed = False
    for k in range(first, known.track.length):
        point = point_at(memory.points, known.track, k)
        motion = by_odometry(known, memory, rules, point.measurement.capture_ns)
        changed = _put_motion(known, memory, k, point, motion) or changed
    return changed


@kernel
def _with_own_motion(known: Known, memory: Memory, rules: Rules, first: int) -> bool:
    """The same with the motion of the follower's own track, where that has a point of the moment."""
    changed = False
    for k in range(first, known.track.length):
        point = point_at(memory.points, known.track, k)
        capture_ns = point.measurement.capture_ns
        at = own_place(memory.own, known.own, capture_ns)
        if at < known.own.length:
            own = own_point(memory.own, known.own, at)
            if own.capture_ns == capture_ns:
                changed = _put_motion(known, memory, k, point, motion_of(own)) or changed
    return changed


@kernel
def _put_motion(known: Known, memory: Memory, k: int, point: TrackPoint, motion: FollowerMotion) -> bool:
    was = point.measurement.motion
    same = (
        was.v2 == motion.v2
        and was.u2 == motion.u2
        and was.sd_v2 == motion.sd_v2
        and was.sd_u2 == motion.sd_u2
    )
    if not same:
        store(memory.points, place(known.track, memory.points, k), with_motion(point, motion))
    return not same


@kernel
def _own_again(known: Known, memory: Memory, rules: Rules, since_ns: int) -> None:
    """Fold the follower's own track anew from a time on, with the odometry that is now known at its poses."""
    ring, noise = known.own, rules.own_noise
    first = max(1, own_place(memory.own, ring, since_ns))
    for k in range(first, ring.length):
        due = own_point(memory.own, ring, k)
        due = own_reprocessed(due, by_odometry(known, memory, rules, due.capture_ns), noise)
        point = own_followed(own_point(memory.own, ring, k - 1), due, noise)
        store(memory.own, place(ring, memory.own, k), point)


@kernel
def estimate(known: Known, points: Rows[TrackPoint], rules: Rules, now_ns: int) -> Told:
    """Newest estimate of a track that has one, its status as seen at ``now_ns``."""
    point = newest(points, known.track)
    point = point._replace(belief=rules.filter.leader(point.belief, point.measurement))
    status, cause = status_of(point, now_ns, rules.settings), point.cause
    if status == TRACKING and rules.mounts.stops and is_off(known.mount_check):
        status, cause = REJECTING, MOUNT
    return Told(estimate_at(point, status), cause)
