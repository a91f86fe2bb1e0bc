"""What a replay notes of messages that no node is put through: truth, the follower's own motion, stops."""

from __future__ import annotations

from controllers.guard import CLOCK_TOLERANCE_NS
from estimation.time.host_time import HostTime
from formation.byte_access import bytes_at
from formation.kernel import kernel
from formation.records import load, size, store
from hil.nodes.estimator_desk import NodeRules
from hil.nodes.frame_time import time_of
from hil.nodes.refusals import NOT_REFUSED
from hil.replay.kept_rows import DriveRow, MotionRow, PoseRow, TruthRow
from hil.replay.pair_desk import DONE, NEVER, ROOM, Lengths, Pair, Roles, Tallies
from hil.replay.repeated_estimates import payload_of
from hil.replay.window import Extent, Logged, Window
from hil.wire.cdr import after_text, begin, ends
from hil.wire.command_layout import read_truth
from hil.wire.frame_layout import read_bodies
from hil.wire.message_checks import ACCEPTED, check_frame, check_odometry
from hil.wire.odometry_layout import read_odometry
from hil.wire.records import Wanted, is_time

_LARGEST = 1e12


@kernel(inline=False)
def noted_messages(pair: Pair, window: Window) -> int:
    """Note what there is in the window; why it ends: DONE, or ROOM where there is none to keep more."""
    roles, extent = load(Roles, pair.roles, 0), load(Extent, window.extent, 0)
    while True:
        tallies = load(Tallies, pair.tallies, 0)
        if tallies.next >= extent.admitted:
            return DONE
        if not _has_room(pair, tallies):
            return ROOM
        store(pair.tallies, 0, _noted(pair, window, roles, tallies)._replace(next=tallies.next + 1))


@kernel
def _has_room(pair: Pair, tallies: Tallies) -> bool:
    return (
        tallies.truths < size(pair.truths)
        and tallies.poses < size(pair.poses)
        and tallies.motions < size(pair.motions)
        and tallies.driven < size(pair.driven)
    )


@kernel
def _noted(pair: Pair, window: Window, roles: Roles, tallies: Tallies) -> Tallies:
    logged = load(Logged, window.logged, tallies.next)
    topic = logged.topic
    if topic == roles.truth:
        return _true(pair, payload_of(window, tallies.next), tallies)
    if topic == roles.frame and roles.tracks:
        return _seen(pair, payload_of(window, tallies.next), logged.log_ns, tallies)
    if topic == roles.odometry and roles.tracks:
        return _moved(pair, payload_of(window, tallies.next), logged.log_ns, tallies)
    if topic == roles.drive:
        store(pair.driven, tallies.driven, DriveRow(logged.digest, NEVER))
        return tallies._replace(driven=tallies.driven + 1)
    if topic == roles.stop and tallies.stopped_ns == NEVER and _is_text(payload_of(window, tallies.next)):
        return tallies._replace(stopped_ns=logged.log_ns)
    return tallies


@kernel
def _is_text(payload: bytes) -> bool:
    return ends(payload, after_text(payload, begin(payload)))


@kernel
def _true(pair: Pair, payload: bytes, tallies: Tallies) -> Tallies:
    read = read_truth(payload)
    n = read.numbers
    if not read.sound or not is_time(read.stamp) or not _can_be(n.leader_x, n.leader_y, n.leader_theta):
        return tallies
    if not _can_be(n.follower_x, n.follower_y, n.follower_theta):
        return tallies
    if not _can_be(n.v1, n.u1, n.v2) or not _can_be(n.u2, 0.0, 0.0):
        return tallies
    row = TruthRow(
        n.stamp_ns,
        n.frame_number,
        n.leader_x,
        n.leader_y,
        n.leader_theta,
        n.follower_x,
        n.follower_y,
        n.follower_theta,
        n.v1,
        n.u1,
        n.v2,
        n.u2,
    )
    store(pair.truths, tallies.truths, row)
    return tallies._replace(truths=tallies.truths + 1)


@kernel
def _can_be(a: float, b: float, c: float) -> bool:
    """Whether no number is larger than any that makes sense; NaN stands for what is not known."""
    return not (abs(a) > _LARGEST or abs(b) > _LARGEST or abs(c) > _LARGEST)


@kernel(inline=False)
def _seen(pair: Pair, payload: bytes, log_ns: int, tallies: Tallies) -> Tallies:
    """With the follower's pose of a frame, at its capture by the host's clock."""
    desk = pair.estimator
    names = bytes_at(pair.names, 0, load(Lengths, pair.lengths, 0).names)
    frame = check_frame(read_bodies(payload, names, desk.bodies), desk.bodies, load(Wanted, desk.wanted, 0))
    if frame.cause != ACCEPTED:
        return tallies
    times, rules = load(HostTime, pair.times, 0), load(NodeRules, desk.rules, 0).time
    timed = time_of(times, pair.time, rules, frame, log_ns)
    store(pair.times, 0, timed.times)
    if timed.refusal != NOT_REFUSED:
        return tallies
    pose = PoseRow(timed.capture_ns, frame.follower_x, frame.follower_y, frame.follower_theta)
    store(pair.poses, tallies.poses, pose)
    return tallies._replace(poses=tallies.poses + 1)


@kernel
def _moved(pair: Pair, payload: bytes, log_ns: int, tallies: Tallies) -> Tallies:
    """With the follower's odometry."""
    motion = check_odometry(read_odometry(payload), log_ns + CLOCK_TOLERANCE_NS)
    if motion.cause != ACCEPTED:
        return tallies
    store(pair.motions, tallies.motions, MotionRow(motion.stamp_ns, motion.v2, motion.u2))
    return tallies._replace(motions=tallies.motions + 1)
