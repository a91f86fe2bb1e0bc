"""What comes of an input of the estimator: it is read and checked, and then taken into the tracks.

All work on the node's :class:`hil.nodes.estimator_desk.Desk`. Entries of these kernels are in
:mod:`hil.nodes.estimator_entries`, one for each input, and :mod:`hil.replay.replay_entries`, for many.
"""

from __future__ import annotations

import math

from controllers.guard import CLOCK_TOLERANCE_NS
from estimation.bounds.window_velocity import window_velocity
from estimation.models.measurement import PairSeen, from_sensor, measure_body
from estimation.own_motion.odometry_check import OdometrySample
from estimation.tracking.track_point import DUPLICATE, GATED, LATE
from estimation.tracking.tracker import COASTING, LOST, status_of
from estimation.tracking.tracker import newest as newest_point
from formation.kernel import kernel
from formation.pose import Pose
from formation.records import load, store
from formation.wrapping import wrapped
from hil.nodes import estimator_step as step
from hil.nodes.counting import count
from hil.nodes.estimator_desk import Desk, NodeRules, Notes, TimedFrame, forget, forget_tracks, noted
from hil.nodes.estimator_records import AUTO, Known, Rules, Taken
from hil.nodes.frame_time import time_of
from hil.nodes.noise_step import with_sight_noise
from hil.nodes.own_motion_step import by_either_at, by_odometry, take_not_finite
from hil.nodes.refusals import (
    BAD_RANGE,
    NO_BODY_FRONT_END,
    NOT_FINITE,
    NOT_REFUSED,
    ODOMETRY_NOT_FINITE,
    SAME_PLACE,
    TAKEN_FRAME,
    TAKEN_LATE,
    TAKEN_ODOMETRY,
    TAKEN_USED,
    UNKNOWN_BODY,
    refusal_of,
)
from hil.nodes.status_reasons import reason_number
from hil.wire.estimate_message import estimate_numbers, write_estimate_message
from hil.wire.frame_layout import read_bodies
from hil.wire.message_checks import check_frame, check_odometry, check_sighting
from hil.wire.odometry_layout import read_odometry, read_sighting
from hil.wire.records import Frame, FrameHead, Sighting, Wanted

SEEN, RESTARTED, SET_BACK = 1, 2, 4
"""What comes of an input that is seen, added up: it can be used, the clock of the frames has jumped, this
host's clock was set back. Either of the last two makes what was known before worthless."""

FRAME, SIGHTING, ODOMETRY = range(3)
"""What can be taken."""

TICK_NS = 50_000_000
"""How often a node looks whether there is still something to estimate from."""

_SAME_PLACE = 1e-3  # two robots whose centres are this close [m] are one body under two names


@kernel
def _received(desk: Desk, digest: int, now_ns: int) -> int:
    """Take note of an input; without what is known no more, if the clock was set back."""
    if noted(desk, digest, now_ns):
        return 0
    # All that comes would be too late for what was heard before.
    forget(desk)
    return SET_BACK


@kernel
def _read_frame(desk: Desk, payload: bytes, names: bytes, again: bool) -> Frame:
    if not again:
        store(desk.heads, 0, read_bodies(payload, names, desk.bodies))
    return check_frame(load(FrameHead, desk.heads, 0), desk.bodies, load(Wanted, desk.wanted, 0))


@kernel(inline=False)
def _estimated(desk: Desk, reasons: bytes, now_ns: int) -> int:
    """Put the newest estimate of a track that has one down, and its message into the buffer; its length."""
    rules, notes = load(NodeRules, desk.rules, 0), load(Notes, desk.notes, 0)
    known = load(Known, desk.known, 0)
    newest = step.estimate(known, desk.points, rules.step, now_ns)
    estimate = newest.estimate
    window = window_velocity(desk.points, known.track, rules.assumed.positions.longest)
    store(desk.newest, 0, estimate)
    reason = reason_number(estimate.status, newest.cause)
    numbers = estimate_numbers(estimate, window, rules.assumed, reason, notes.receipts, now_ns)
    store(desk.notes, 0, notes._replace(receipts=0, estimated_ns=now_ns))
    return write_estimate_message(
        desk.buffer, rules.times_at, reasons, numbers, estimate.joint, desk.receipts
    )


@kernel
def _moved_on(desk: Desk, taken: Taken, reasons: bytes, now_ns: int) -> int:
    """Keep what has become of a measurement, count it, and estimate from it if it was not in vain."""
    notes, verdict = load(Notes, desk.notes, 0), taken.verdict
    store(desk.notes, 0, notes._replace(verdict=verdict, cause=taken.cause, late=taken.late))
    if verdict in (GATED, DUPLICATE, LATE):
        count(desk.counts, refusal_of(verdict, taken.cause))
    else:
        count(desk.counts, TAKEN_USED)
    if taken.late and verdict != DUPLICATE:
        count(desk.counts, TAKEN_LATE)
    return 0 if verdict in (DUPLICATE, LATE) else _estimated(desk, reasons, now_ns)


@kernel
def frame_seen(desk: Desk, payload: bytes, names: bytes, again: bool, digest: int, now_ns: int) -> int:
    """Read a mocap frame. ``names``: of the bodies, packed; ``again``: it has been read by another node."""
    came = _received(desk, digest, now_ns)
    frame = _read_frame(desk, payload, names, again)
    if frame.cause != NOT_REFUSED:
        count(desk.counts, frame.cause)
        return came
    notes, rules = load(Notes, desk.notes, 0), load(NodeRules, desk.rules, 0)
    timed = time_of(notes.times, desk.time, rules.time, frame, now_ns)
    store(desk.notes, 0, notes._replace(times=timed.times))
    if timed.refusal != NOT_REFUSED:
        count(desk.counts, timed.refusal)
        return came
    if timed.restart:
        forget_tracks(desk)
        came += RESTARTED
    count(desk.counts, TAKEN_FRAME)
    if frame.strangers > 0:
        count(desk.counts, UNKNOWN_BODY)
    dx, dy = frame.leader_x - frame.follower_x, frame.leader_y - frame.follower_y
    if math.sqrt(dx * dx + dy * dy) < _SAME_PLACE:
        count(desk.counts, SAME_PLACE)
        return came
    body = Pose(frame.follower_x, frame.follower_y, frame.follower_theta)
    seen = step.with_robot(PairSeen(frame.leader_x, frame.leader_y, body), rules.step.mounts)
    store(desk.frame, 0, TimedFrame(timed.capture_ns, seen))
    return came + SEEN


@kernel
def odometry_seen(desk: Desk, payload: bytes, digest: int, now_ns: int) -> int:
    """Read the follower's odometry."""
    came = _received(desk, digest, now_ns)
    motion = check_odometry(read_odometry(payload), now_ns + CLOCK_TOLERANCE_NS)
    if motion.cause == NOT_FINITE:
        count(desk.counts, ODOMETRY_NOT_FINITE)
        store(desk.known, 0, take_not_finite(load(Known, desk.known, 0), now_ns))
        return came
    if motion.cause != NOT_REFUSED:
        count(desk.counts, motion.cause)
        return came
    told = OdometrySample(motion.stamp_ns, motion.v2, motion.u2, motion.has_pose, motion.pose)
    store(desk.sample, 0, told)
    count(desk.counts, TAKEN_ODOMETRY)
    return came + SEEN


@kernel
def sighting_seen(desk: Desk, payload: bytes, digest: int, now_ns: int) -> int:
    """Read a sighting of the leader, and put it right by what is known of the sensor."""
    came, sensor = _received(desk, digest, now_ns), load(NodeRules, desk.rules, 0).sensor
    if not sensor.used:
        count(desk.counts, NO_BODY_FRONT_END)
        return came
    sighting = check_sighting(read_sighting(payload), now_ns + CLOCK_TOLERANCE_NS)
    if sighting.cause != NOT_REFUSED:
        count(desk.counts, sighting.cause)
        return came
    count(desk.counts, TAKEN_FRAME)
    rho, alpha2 = sighting.rho - sensor.range_bias, wrapped(sighting.alpha2 - sensor.bearing_bias)
    if rho <= 0.0:
        count(desk.counts, BAD_RANGE)
        return came
    if sensor.x != 0.0 or sensor.y != 0.0:
        rho, alpha2 = from_sensor(rho, alpha2, (sensor.x, sensor.y))
    if rho < _SAME_PLACE:
        count(desk.counts, SAME_PLACE)
        return came
    store(desk.sighting, 0, sighting._replace(rho=rho, alpha2=alpha2))
    return came + SEEN


@kernel
def _take_frame(desk: Desk, rules: Rules) -> Taken:
    """Take the frame that was seen into the tracks."""
    frame = load(TimedFrame, desk.frame, 0)
    return step.take_frame(desk.known, desk.memory(), rules, frame.capture_ns, frame.seen)


@kernel
def _take_sighting(desk: Desk, rules: Rules) -> Taken:
    """Take the sighting that was seen into the leader's track."""
    known = load(Known, desk.known, 0)
    memory, sensor = desk.memory(), load(NodeRules, desk.rules, 0).sensor
    seen = load(Sighting, desk.sighting, 0)
    if rules.source == AUTO:
        motion = by_either_at(known, memory, rules, seen.capture_ns)
    else:
        motion = by_odometry(known, memory, rules, seen.capture_ns)
    scale = known.noise.scale
    sd_range, sd_bearing = scale.range * sensor.sigma_range, scale.bearing * sensor.sigma_bearing
    measurement = measure_body(seen.capture_ns, seen.rho, seen.alpha2, sd_range, sd_bearing, motion)
    return with_sight_noise(step.take(desk.known, memory, rules, measurement), desk.known, memory, rules)


@kernel
def taken(desk: Desk, what: int, reasons: bytes, now_ns: int) -> int:
    """Take what was seen into the tracks; the length of the estimate's message, 0 for none.

    ``what``: FRAME, SIGHTING, or ODOMETRY, which folds again what came after the sample before it. One kernel
    for all three, so that the filter is compiled into its entry once.
    """
    rules = load(NodeRules, desk.rules, 0).step
    if what == ODOMETRY:
        sample = load(OdometrySample, desk.sample, 0)
        step.take_odometry(desk.known, desk.memory(), rules, sample)
        return 0
    if what == FRAME:
        return _moved_on(desk, _take_frame(desk, rules), reasons, now_ns)
    return _moved_on(desk, _take_sighting(desk, rules), reasons, now_ns)


@kernel
def ticked(desk: Desk, reasons: bytes, now_ns: int) -> int:
    """Speak up if measurements are missing; the length of the message, 0 for none."""
    known = load(Known, desk.known, 0)
    if known.track.length == 0:
        return 0
    settings = load(NodeRules, desk.rules, 0).step.settings
    found = status_of(newest_point(desk.points, known.track), now_ns, settings)
    missing = found in (COASTING, LOST)
    due = (now_ns - load(Notes, desk.notes, 0).estimated_ns) * 2 > TICK_NS
    return _estimated(desk, reasons, now_ns) if missing and due else 0
