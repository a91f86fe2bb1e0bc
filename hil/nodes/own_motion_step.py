"""The follower's own motion at a step of the estimator: by odometry, its track, or what is right."""

from __future__ import annotations

from estimation.consistency.slip_estimate import with_slip
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import Measurement, PairSeen
from estimation.own_motion.interval_motion import motion_between
from estimation.own_motion.judged_odometry import (
    age_of,
    aged,
    contradicts,
    fresh_for,
    is_better,
    with_own_track,
)
from estimation.own_motion.odometry_check import (
    POSE,
    TRACK,
    OdometrySample,
    awaits_track,
    source_of,
    way_between,
)
from estimation.own_motion.odometry_history import (
    InputTrust,
    MotionSample,
    answered,
    follower_motion,
    scaled_motion,
    time_constant_of,
)
from estimation.own_motion.odometry_noise import noise_with_window, with_found_noise
from estimation.own_motion.own_track import (
    OwnPoint,
    motion_of,
    own_begun,
    own_followed,
    own_place,
    own_point,
    own_predicted,
    own_reprocessed,
)
from estimation.tracking.tracker import capture_at
from formation.kernel import kernel
from formation.records import Rows, load, store, within
from formation.ring import place
from hil.nodes.estimator_records import AUTO, FUSED, MOCAP, ODOMETRY, Known, Memory, Rules

_NS = 1e-9


@kernel
def by_odometry(known: Known, memory: Memory, rules: Rules, capture_ns: int) -> FollowerMotion:
    """Motion of the follower as odometry tells it, put right where that is known to be wrong."""
    motion = follower_motion(memory.history, known.odometry, capture_ns, rules.trust, known.correction)
    return with_slip(motion, known.slip) if rules.learns_slip else motion


@kernel
def way_known(known: Known, memory: Memory, rules: Rules, measurement: Measurement, k: int) -> Measurement:
    """Measurement, the track's k-th, with the way by odometry since the one before, where that counts."""
    if rules.filter.in_world or measurement.anchored or k == 0 or known.odometry.length == 0:
        return measurement
    to_ns = measurement.capture_ns
    if measurement.framed and rules.source != ODOMETRY:
        return measurement._replace(has_way=False)
    from_ns = capture_at(memory.points, known.track, k - 1)
    if from_ns >= to_ns:
        return measurement
    way = motion_between(memory.history, known.odometry, (from_ns, to_ns), rules.trust, known.correction)
    if rules.learns_slip:
        way = with_slip(way, known.slip)
    return measurement._replace(has_way=True, way=way)


@kernel
def due_pose(known: Known, memory: Memory, rules: Rules, capture_ns: int, seen: PairSeen) -> OwnPoint:
    """The follower's pose, ready to be folded into its own track, with odometry if that is fused."""
    told = rules.source == FUSED and known.odometry.length > 0
    odometry = FollowerMotion(0.0, 0.0, 0.0, 0.0)
    if told:
        odometry = by_odometry(known, memory, rules, capture_ns)
    return own_begun(capture_ns, seen.follower, told, odometry, rules.own_noise)


@kernel
def by_pose(before: OdometrySample, after: OdometrySample) -> MotionSample:
    """Mean motion from one pose of odometry to the next, in the middle between them."""
    span_ns = after.stamp_ns - before.stamp_ns
    if span_ns <= 0:
        return MotionSample(after.stamp_ns, after.v2, after.u2, 0.0, 0.0)
    way, dt = way_between(before.pose, after.pose), span_ns * _NS
    return MotionSample(before.stamp_ns + span_ns // 2, way.v / dt, way.u / dt, 0.0, 0.0)


@kernel
def source_now(known: Known, rules: Rules) -> int:
    """What the follower's motion is taken from.

    Where the motion is a lag's answer to the signal, odometry's pose cannot stand in for it: wheels that add
    up their turns have no such lag.
    """
    source = source_of(known.odometry_check)
    return TRACK if source == POSE and time_constant_of(rules.trust, known.correction) > 0.0 else source


@kernel
def with_answer(known: Known, rules: Rules, told: OdometrySample) -> Known:
    """Known with the lag's answer to the newest sample, if there is a lag."""
    time_constant, last = time_constant_of(rules.trust, known.correction), known.answer
    if time_constant <= 0.0 or told.stamp_ns <= last.stamp_ns:
        return known
    now = MotionSample(told.stamp_ns, told.v2, told.u2, told.v2, told.u2)
    if last.stamp_ns > 0:
        now = answered(last, now, told.stamp_ns, time_constant)
    return known._replace(answer=now)


@kernel
def answered_sample(known: Known, rules: Rules, told: OdometrySample) -> OdometrySample:
    """The newest sample as the motion that it stands for: what the lag makes of it, scaled."""
    now = MotionSample(told.stamp_ns, told.v2, told.u2, 0.0, 0.0)
    if known.answer.stamp_ns == told.stamp_ns and time_constant_of(rules.trust, known.correction) > 0.0:
        now = now._replace(v2=known.answer.answer_v, u2=known.answer.answer_u)
    now = scaled_motion(now, rules.trust, known.correction)
    return told._replace(v2=now.v2, u2=now.u2)


@kernel
def _trust(known: Known, rules: Rules) -> InputTrust:
    """What is known of odometry, its delay as it is corrected."""
    return rules.trust._replace(delay=rules.trust.delay + known.correction.delay)


@kernel
def _fresh_odometry(known: Known, memory: Memory, rules: Rules, capture_ns: int) -> FollowerMotion:
    """Motion by odometry that is believed, as old as it is; by nothing at all if there is none to believe."""
    motion, check = by_odometry(known, memory, rules, capture_ns), known.odometry_check
    motion = with_found_noise(motion, known.odometry_noise)
    if source_now(known, rules) == TRACK or not check.heard:
        return motion._replace(sd_v2=rules.own_noise.v_max, sd_u2=rules.own_noise.u_max)
    return aged(motion, check, age_of(check, capture_ns, _trust(known, rules)), rules.own_noise)


@kernel
def is_fresh(known: Known, rules: Rules, capture_ns: int) -> bool:
    """Whether odometry is believed and covers a capture."""
    check = known.odometry_check
    age = age_of(check, capture_ns, _trust(known, rules))
    return check.heard and source_now(known, rules) != TRACK and age <= fresh_for(check)


@kernel
def _either(motion: FollowerMotion, fresh: bool, own: OwnPoint, rules: Rules) -> FollowerMotion:
    """Motion by odometry while that is fresh and no pose speaks against it, else by what is known better."""
    shown = motion_of(own)
    if fresh:
        return shown if contradicts(motion, own) else motion
    return shown if is_better(shown, motion, rules.own_noise) else motion


@kernel
def by_either(known: Known, memory: Memory, rules: Rules, due: OwnPoint) -> FollowerMotion:
    """Motion at a pose that is due: by odometry, or by the follower's own track."""
    motion = _fresh_odometry(known, memory, rules, due.capture_ns)
    fresh = is_fresh(known, rules, due.capture_ns)
    ring = known.own
    # What the newest point has nothing against need not cost a step of the track's filter.
    if fresh and (ring.length == 0 or not contradicts(motion, own_point(memory.own, ring, ring.length - 1))):
        return motion
    return _either(motion, fresh, own_predicted(memory.own, ring, due, rules.own_noise), rules)


@kernel
def by_either_at(known: Known, memory: Memory, rules: Rules, capture_ns: int) -> FollowerMotion:
    """The same at a point of the follower's own track, which may not have it."""
    motion = _fresh_odometry(known, memory, rules, capture_ns)
    at = own_place(memory.own, known.own, capture_ns)
    if at == known.own.length:
        return motion
    point = own_point(memory.own, known.own, at)
    if point.capture_ns != capture_ns:
        return motion
    return _either(motion, is_fresh(known, rules, capture_ns), point, rules)


@kernel
def with_judged_odometry(knowns: Rows[Known], memory: Memory, rules: Rules) -> None:
    """Take in what the follower's own track has to say of odometry, and of how far it is off."""
    if awaits_track(load(Known, knowns, 0).odometry_check):
        _judge_odometry(knowns, memory, rules)


@kernel(inline=False)
def _judge_odometry(knowns: Rows[Known], memory: Memory, rules: Rules) -> None:
    known = load(Known, knowns, 0)
    before = known.odometry_check
    after = with_own_track(before, memory.ways, memory.own, known.own, rules.own_noise, _trust(known, rules))
    store(within(Known, knowns, 0, "odometry_check"), 0, after)
    if not finds_odometry_noise(rules) or not before.windowed or not after.windowed:
        return
    if after.since.stamp_ns > before.since.stamp_ns:
        noise = noise_with_window(
            known.odometry_noise, before.since, after.since, rules.trust, rules.own_noise
        )
        store(within(Known, knowns, 0, "odometry_noise"), 0, noise)


@kernel
def finds_odometry_noise(rules: Rules) -> bool:
    """Whether the own track tells the noise of odometry; along own axes a lag of commands is told for it."""
    return rules.noise_learning.learns and (rules.filter.in_world or rules.trust.lag == 0.0)


@kernel
def take_not_finite(known: Known, now_ns: int) -> Known:
    """Take note of odometry that came with a number that is none."""
    return known._replace(odometry_check=known.odometry_check._replace(bad_ns=now_ns))


@kernel(inline=False)
def own_again(known: Known, memory: Memory, rules: Rules, since_ns: int) -> None:
    """Fold the follower's own track anew from a time on, with the odometry that is now known at its poses."""
    ring, noise = known.own, rules.own_noise
    first = max(1, own_place(memory.own, ring, since_ns))
    for k in range(first, ring.length):
        due = own_point(memory.own, ring, k)
        due = own_reprocessed(due, by_odometry(known, memory, rules, due.capture_ns), noise)
        point = own_followed(own_point(memory.own, ring, k - 1), due, noise)
        store(memory.own, place(ring, memory.own, k), point)


@kernel
def is_under_way(known: Known, rules: Rules) -> bool:
    """Whether there is all that estimates rest on: the leader's track, and motion of the follower."""
    if known.track.length == 0:
        return False
    if rules.source == MOCAP:
        return known.own.length > 0
    return known.odometry.length > 0 or (rules.source == AUTO and known.own.length > 0)
