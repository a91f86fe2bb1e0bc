"""The estimator's step on plain records: a frame, a sighting or odometry in, and the track moves on.

All that the estimator knows lies in rows that its owner keeps: those of :class:`Memory`, and one row of
:class:`Known`, of which a step changes what has changed and leaves the rest alone. Live daemons, lockstep,
replay and sweeps call these functions.
"""

from __future__ import annotations

from estimation.consistency.noise_estimate import (
    Moment,
    scaled_noise,
)
from estimation.consistency.process_estimate import (
    learn,
    learned_noise,
    restarted,
)
from estimation.consistency.slip_estimate import SLIP_LOWEST, LearnedSlip, learn_slip
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import (
    Measurement,
    PairSeen,
    measure_body_anchored,
    measure_body_from_mocap,
    measure_world,
    seen_in_range,
)
from estimation.own_motion.odometry_check import POSE, TRACK, OdometrySample, with_sample
from estimation.own_motion.odometry_history import (
    MotionSample,
    answer_again,
    delay_ns,
    remember,
    sample_at,
    sample_place,
    time_constant_of,
)
from estimation.own_motion.odometry_noise import noise_with_sample
from estimation.own_motion.own_track import folded, motion_of, own_place, own_point, own_predicted
from estimation.tracking.begun_jump import borne
from estimation.tracking.estimate import estimate_at, guessed_if_standing, guessed_when_slow
from estimation.tracking.follower_check import BELIEVED, MOUNT
from estimation.tracking.follower_check import FOLLOWER as FOLLOWER_OFF
from estimation.tracking.follower_check import GATED as LEADER_OFF
from estimation.tracking.mount_check import MountCheck, mount_checked
from estimation.tracking.track_point import DUPLICATE, GATED, LATE, RESTARTED, USED, TrackPoint, with_motion
from estimation.tracking.tracker import (
    INITIALISING,
    REJECTING,
    TRACKING,
    add,
    capture_at,
    newest,
    place_of,
    point_at,
    reprocessed,
    status_of,
)
from estimation.tracking.travel_watch import TravelWatch, travel_watched
from formation.kernel import kernel
from formation.mount import robot_pose
from formation.records import Rows, load, store, within
from formation.ring import place
from hil.nodes.estimator_records import (
    AUTO,
    FUSED,
    MOCAP,
    ODOMETRY,
    Known,
    Memory,
    MountRules,
    Rules,
    Taken,
    Told,
)
from hil.nodes.noise_step import learn_noise, with_noise
from hil.nodes.own_motion_step import (
    answered_sample,
    by_either,
    by_either_at,
    by_odometry,
    by_pose,
    due_pose,
    finds_odometry_noise,
    own_again,
    source_now,
    way_known,
    with_answer,
    with_judged_odometry,
)

_NS = 1e-9

SELDOM = 0.15
"""Time [s] between measurements above which they tell too little of how a leader changes its motion."""


@kernel
def with_robot(seen: PairSeen, rules: MountRules) -> PairSeen:
    """What a frame shows, with the follower's own pose in the place of its body's.

    The leader's stays its body's, which only the filter knows how to tell from the leader.
    """
    return seen._replace(follower=robot_pose(seen.follower, rules.follower))


@kernel
def take_frame(knowns: Rows[Known], memory: Memory, rules: Rules, capture_ns: int, seen: PairSeen) -> Taken:
    """Take in a mocap frame that was captured at a time by the host's clock, into the one row of ``knowns``.

    It is taken with the noise as known from the frames before, and keeps that if it is folded again.
    """
    learns = rules.noise_learning.learns
    known = load(Known, knowns, 0)
    begun = known.process.begun
    using = with_noise(rules, scaled_noise(rules.noise, known.noise)) if learns else rules
    taken = _take_frame(knowns, memory, using, capture_ns, seen)
    if taken.late or taken.verdict == DUPLICATE or taken.verdict == LATE:
        return taken
    # An outlier of the follower may be one by a wrong mount.
    if taken.cause == BELIEVED or taken.cause == LEADER_OFF or taken.cause == FOLLOWER_OFF:
        jumped, checks = taken.verdict == RESTARTED, within(Known, knowns, 0, "mount_check")
        check = load(MountCheck, checks, 0)
        store(checks, 0, mount_checked(check, capture_ns, seen.follower, using.noise, jumped))
    if learns:
        begins = load(Known, knowns, 0).process.begun and not begun
        learn_noise(knowns, memory, rules, Moment(capture_ns, seen), taken.cause != BELIEVED, begins)
    return taken


@kernel
def _take_frame(knowns: Rows[Known], memory: Memory, rules: Rules, capture_ns: int, seen: PairSeen) -> Taken:
    known = load(Known, knowns, 0)
    due = due_pose(known, memory, rules, capture_ns, seen)
    if rules.source == ODOMETRY:
        motion = by_odometry(known, memory, rules, capture_ns)
    elif rules.source == AUTO:
        motion = by_either(known, memory, rules, due)
    else:
        motion = motion_of(own_predicted(memory.own, known.own, due, rules.own_noise))
        if known.own.length > 0 and capture_ns < own_point(memory.own, known.own, 0).capture_ns:
            motion = by_odometry(known, memory, rules, capture_ns)
    taken = take(knowns, memory, rules, measured(rules, capture_ns, seen, motion))
    if rules.source == ODOMETRY:
        return taken
    # Frames that are plainly wrong must not move the follower's own track. One that is not where its motion
    # took it may be right, and the motion wrong: odometry lies, or the track has to begin anew, which has a
    # gate of its own.
    believed = taken.cause == BELIEVED or taken.cause == LEADER_OFF or taken.cause == FOLLOWER_OFF
    if taken.verdict == DUPLICATE or taken.verdict == LATE or not believed:
        return taken
    own = folded(memory.own, known.own, due, rules.own_noise, rules.settings.window)
    store(within(Known, knowns, 0, "own"), 0, own)
    if taken.late:
        after = load(Known, knowns, 0)
        first = place_of(memory.points, after.track, capture_ns)
        _with_own_motion(after, memory, rules, first)
        reprocessed(memory.points, after.track, first, rules.settings, rules.filter)
    if rules.source == AUTO:
        with_judged_odometry(knowns, memory, rules)
        if known.watched_ns <= 0:
            store(knowns, 0, load(Known, knowns, 0)._replace(watched_ns=capture_ns))
    return taken


@kernel
def measured(rules: Rules, capture_ns: int, seen: PairSeen, motion: FollowerMotion) -> Measurement:
    """What a frame measures of the leader, by the front end."""
    leader = (seen.leader_x, seen.leader_y)
    if rules.filter.in_world:
        return measure_world(capture_ns, leader, seen.follower, rules.noise, motion)
    # Where a frame shows the follower's own pose, no odometry knows better how far it has turned.
    if rules.source == MOCAP or rules.source == AUTO:
        return measure_body_anchored(capture_ns, leader, seen.follower, rules.noise, motion)
    return measure_body_from_mocap(capture_ns, leader, seen.follower, rules.noise, motion)


@kernel
def take(knowns: Rows[Known], memory: Memory, rules: Rules, measurement: Measurement) -> Taken:
    """Take in a measurement of the leader, into the one row of ``knowns``."""
    known = load(Known, knowns, 0)
    points, ring = memory.points, known.track
    late = ring.length > 0 and measurement.capture_ns < capture_at(points, ring, ring.length - 1)
    before = place_of(points, ring, measurement.capture_ns)
    measurement = way_known(known, memory, rules, measurement, before)
    learning, estimator = rules.process_learning, rules.filter
    if learning.on:
        estimator = estimator.driven_by(learned_noise(known.process, learning))
    added = add(points, ring, measurement, rules.settings, estimator)
    cause = added.cause if added.verdict == GATED else BELIEVED
    store(within(Known, knowns, 0, "track"), 0, added.ring)
    if late and measurement.has_way and added.verdict != DUPLICATE and added.verdict != LATE:
        _shorten_way(load(Known, knowns, 0), memory, rules, measurement.capture_ns)
    if learning.on and not late:
        _learn(knowns, memory, rules, added.verdict)
    if rules.learns_slip and not late and added.ring.length > 1:
        # Of the newest odometry may still come; the one before it has been folded with all there is.
        settled = point_at(points, added.ring, added.ring.length - 2)
        slips = within(Known, knowns, 0, "slip")
        # Commands that were obeyed for a while may not be next time: of these only what is worse is learned.
        least = 1.0 if rules.trust.lag > 0.0 else SLIP_LOWEST
        store(slips, 0, learn_slip(load(LearnedSlip, slips, 0), memory.bank, settled, least, rules.filter))
    if rules.filter.in_world and not late:
        point, settings = newest(points, added.ring), rules.settings
        travels = within(Known, knowns, 0, "travel")
        travel = load(TravelWatch, travels, 0)
        store(travels, 0, travel_watched(travel, point, settings.lost_after, rules.filter.limits))
    return Taken(added.verdict, cause, late)


@kernel
def _shorten_way(known: Known, memory: Memory, rules: Rules, capture_ns: int) -> None:
    """Give what comes after a measurement that came late its way since that one."""
    points, ring = memory.points, known.track
    k = place_of(points, ring, capture_ns) + 1
    after = way_known(known, memory, rules, point_at(points, ring, k).measurement, k)
    if _put_measurement(known, memory, k, after):
        reprocessed(points, ring, k, rules.settings, rules.filter)


@kernel(inline=False)
def _learn(knowns: Rows[Known], memory: Memory, rules: Rules, verdict: int) -> None:
    """Learn of the leader's driving from the newest point of its track."""
    known, processes = load(Known, knowns, 0), within(Known, knowns, 0, "process")
    if verdict == RESTARTED:
        store(processes, 0, restarted(known.process))
    if verdict != USED:
        return
    point = newest(memory.points, known.track)
    if point.period > SELDOM:
        return
    if point.measurement.has_way and rules.trust.lag > 0.0:
        if point.measurement.framed:
            # Dozens of frames within one error of the wheels would pass for as many proofs.
            return
        # Where commands stand in for motion, what is seen across the line of sight tells how the follower
        # obeys, not how the leader drives.
        point = point._replace(measurement=seen_in_range(point.measurement))
    learned = learn(known.process, memory.bank, point, rules.process_learning, rules.filter)
    store(processes, 0, learned)


@kernel
def _check(knowns: Rows[Known], memory: Memory, rules: Rules, told: OdometrySample) -> None:
    """Take a sample of odometry into its check, and into what is found of its noise."""
    known = load(Known, knowns, 0)
    check = known.odometry_check
    known = with_answer(known, rules, told)
    store(within(Known, knowns, 0, "answer"), 0, known.answer)
    told = answered_sample(known, rules, told)
    if check.heard and finds_odometry_noise(rules):
        noise = noise_with_sample(known.odometry_noise, check.last, told, rules.trust, rules.own_noise)
        store(within(Known, knowns, 0, "odometry_noise"), 0, noise)
    checked = with_sample(check, memory.ways, told, rules.own_noise)
    store(within(Known, knowns, 0, "odometry_check"), 0, checked)
    if known.own.length > 0:
        learns = rules.noise_learning.learns
        seen = with_noise(rules, scaled_noise(rules.noise, known.noise)) if learns else rules
        with_judged_odometry(knowns, memory, seen)


@kernel
def take_odometry(knowns: Rows[Known], memory: Memory, rules: Rules, told: OdometrySample) -> None:
    """Take in a sample of odometry, and fold again what came after the sample before it."""
    sample = MotionSample(told.stamp_ns, told.v2, told.u2, 0.0, 0.0)
    if rules.source == AUTO:
        known = load(Known, knowns, 0)
        check = known.odometry_check
        if source_now(known, rules) == POSE and told.has_pose and check.last.has_pose:
            sample = by_pose(check.last, told)
        _check(knowns, memory, rules, told)
    known = load(Known, knowns, 0)
    ring = remember(memory.history, known.odometry, sample, rules.span)
    time_constant = time_constant_of(rules.trust, known.correction)
    if time_constant > 0.0:
        answer_again(memory.history, ring, sample.stamp_ns, time_constant)
    store(within(Known, knowns, 0, "odometry"), 0, ring)
    known = known._replace(odometry=ring)
    n = known.track.length
    if not rules.reprocesses or n == 0 or source_now(known, rules) == TRACK:
        return
    k, since_ns = sample_place(memory.history, ring, sample.stamp_ns), 0
    if k > 0:
        before = sample_at(memory.history, ring, k - 1)
        since_ns = before.stamp_ns + delay_ns(rules.trust, known.correction) + 1
    if capture_at(memory.points, known.track, n - 1) < since_ns:
        return
    first = place_of(memory.points, known.track, since_ns)
    if rules.source == FUSED:
        own_again(known, memory, rules, since_ns)
        changed = _with_own_motion(known, memory, rules, first)
    else:
        changed = _with_odometry(known, memory, rules, first)
    if changed:
        reprocessed(memory.points, known.track, first, rules.settings, rules.filter)


@kernel
def _with_odometry(known: Known, memory: Memory, rules: Rules, first: int) -> bool:
    """Give the points from the ``first`` on the motion that odometry now tells; whether any has changed."""
    changed = False
    for k in range(first, known.track.length):
        point = point_at(memory.points, known.track, k)
        capture_ns = point.measurement.capture_ns
        if rules.source == AUTO:
            motion = by_either_at(known, memory, rules, capture_ns)
        else:
            motion = by_odometry(known, memory, rules, capture_ns)
        measurement = with_motion(point, motion).measurement
        measurement = way_known(known, memory, rules, measurement, k)
        changed = _put_measurement(known, memory, k, measurement) or changed
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
            if own.capture_ns == capture_ns and rules.source == AUTO:
                motion = by_either_at(known, memory, rules, capture_ns)
                changed = _put_motion(known, memory, k, point, motion) or changed
            elif own.capture_ns == capture_ns:
                changed = _put_motion(known, memory, k, point, motion_of(own)) or changed
    return changed


@kernel
def _put_motion(known: Known, memory: Memory, k: int, point: TrackPoint, motion: FollowerMotion) -> bool:
    return _put_measurement(known, memory, k, with_motion(point, motion).measurement)


@kernel
def _put_measurement(known: Known, memory: Memory, k: int, measurement: Measurement) -> bool:
    """Put another motion and way of the follower in at a point; whether they are other ones."""
    point = point_at(memory.points, known.track, k)
    was = point.measurement
    same = _same_motion(was.motion, measurement.motion) and _same_motion(was.way, measurement.way)
    same = same and was.has_way == measurement.has_way
    if not same:
        store(memory.points, place(known.track, memory.points, k), point._replace(measurement=measurement))
    return not same


@kernel
def _same_motion(a: FollowerMotion, b: FollowerMotion) -> bool:
    return a.v2 == b.v2 and a.u2 == b.u2 and a.sd_v2 == b.sd_v2 and a.sd_u2 == b.sd_u2


@kernel
def estimate(known: Known, points: Rows[TrackPoint], rules: Rules, now_ns: int) -> Told:
    """Newest estimate of a track that has one, its status as seen at ``now_ns``."""
    point = newest(points, known.track)
    point = point._replace(belief=rules.filter.leader(point.belief, point.measurement))
    status, cause = status_of(point, now_ns, rules.settings), point.cause
    # A leader that stands need not be waited for while the follower must not be driven anyway.
    waits = status in (TRACKING, INITIALISING)
    if waits and rules.mounts.stops and known.mount_check.off:
        status, cause = REJECTING, MOUNT
    belief = point.belief
    if rules.settings.notices_manoeuvres:
        belief = borne(belief, point.manoeuvre, point.noise, rules.filter.limits, point.period)
    told = rules.filter.told_speed(belief)
    found = estimate_at(point._replace(belief=told.belief), status)
    found = guessed_if_standing(found, told.standing)
    return Told(guessed_when_slow(found, rules.filter.limits.v_eps), cause)
