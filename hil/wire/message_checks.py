"""Message checks: nothing off the wire is trusted, and what is refused has a cause to count it by."""

from __future__ import annotations

import math
from enum import IntEnum

from formation.kernel import kernel
from formation.pose import Pose
from formation.records import Rows, load
from hil.wire.records import (
    Body,
    CheckedMotion,
    Frame,
    FrameHead,
    Odometry,
    Placement,
    RangeAndBearing,
    ReadEstimate,
    Sighting,
    Wanted,
    is_time,
    ns_of,
)

ANY_TIME_NS = 2**62
"""Latest stamp for a reader that takes those of the future too."""

FARTHEST = 1e4
"""Largest coordinate or range [m] that is believed; beyond it the squares of a filter lose their meaning."""

FASTEST, HARDEST = 20.0, 50.0
"""Largest speed [m/s] and turn rate [rad/s] of a robot that is believed: none in a room reaches them."""

_UNIT_TOLERANCE = 0.01
_UPRIGHT = math.cos(math.radians(30.0))


class Cause(IntEnum):
    """Why a message is not used.

    unknown_body: the frame holds strangers only. tilted: z of a body is not up. bad_range: not above zero.
    """

    ACCEPTED = 0
    MALFORMED = 1
    BAD_STAMP = 2
    UNKNOWN_BODY = 3
    MISSING_LEADER = 4
    MISSING_FOLLOWER = 5
    DUPLICATE_BODY = 6
    NOT_FINITE = 7
    OUT_OF_RANGE = 8
    BAD_QUATERNION = 9
    TILTED = 10
    BAD_RANGE = 11

    @property
    def word(self) -> str:
        """What it is counted by."""
        return self.name.lower()


ACCEPTED = Cause.ACCEPTED.value
MALFORMED = Cause.MALFORMED.value
BAD_STAMP = Cause.BAD_STAMP.value
UNKNOWN_BODY = Cause.UNKNOWN_BODY.value
MISSING_LEADER = Cause.MISSING_LEADER.value
MISSING_FOLLOWER = Cause.MISSING_FOLLOWER.value
DUPLICATE_BODY = Cause.DUPLICATE_BODY.value
NOT_FINITE = Cause.NOT_FINITE.value
OUT_OF_RANGE = Cause.OUT_OF_RANGE.value
BAD_QUATERNION = Cause.BAD_QUATERNION.value
TILTED = Cause.TILTED.value
BAD_RANGE = Cause.BAD_RANGE.value

_LAST_STATUS = 4


@kernel
def check_frame(head: FrameHead, bodies: Rows[Body], wanted: Wanted) -> Frame:
    """Check a frame and reduce it to a pair."""
    strangers, number = head.strangers, head.frame_number
    if not head.sound:
        return _refused(MALFORMED, 0, 0, 0)
    if not is_time(head.stamp) or ns_of(head.stamp) > wanted.latest_ns:
        return _refused(BAD_STAMP, 0, number, strangers)
    capture_ns = ns_of(head.stamp)
    first, second = load(Body, bodies, wanted.leader), load(Body, bodies, wanted.follower)
    cause = _pair_cause(first.seen, second.seen, strangers)
    if cause == ACCEPTED:
        cause = leader_cause(first.place)
    if cause == ACCEPTED:
        cause = place_cause(second.place)
    if cause != ACCEPTED:
        return _refused(cause, capture_ns, number, strangers)
    pose = planar(second.place)
    return Frame(
        ACCEPTED, capture_ns, number, strangers, first.place.x, first.place.y, pose.x, pose.y, pose.theta
    )


@kernel
def _refused(cause: int, capture_ns: int, frame_number: int, strangers: int) -> Frame:
    return Frame(cause, capture_ns, frame_number, strangers, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def _pair_cause(leaders: int, followers: int, strangers: int) -> int:
    if leaders > 1 or followers > 1:
        return DUPLICATE_BODY
    if leaders == 0 and followers == 0 and strangers > 0:
        return UNKNOWN_BODY
    if leaders == 0:
        return MISSING_LEADER
    return ACCEPTED if followers > 0 else MISSING_FOLLOWER


@kernel
def place_cause(place: Placement) -> int:
    """Why a body's pose is not one of a robot on the ground, ACCEPTED if it is."""
    p = place
    if not _all_finite(p):
        return NOT_FINITE
    if not _all_within(p, FARTHEST):
        return OUT_OF_RANGE
    norm = _norm(p)
    if abs(norm - 1.0) > _UNIT_TOLERANCE:
        return BAD_QUATERNION
    x, y = p.qx / norm, p.qy / norm
    return ACCEPTED if 1.0 - 2.0 * (x * x + y * y) >= _UPRIGHT else TILTED


@kernel
def leader_cause(place: Placement) -> int:
    """The same of the leader, of whom the position is all that is used: it may lack an orientation."""
    if has_orientation(place):
        return place_cause(place)
    if not (math.isfinite(place.x) and math.isfinite(place.y) and math.isfinite(place.z)):
        return NOT_FINITE
    far = abs(place.x) > FARTHEST or abs(place.y) > FARTHEST or abs(place.z) > FARTHEST
    return OUT_OF_RANGE if far else ACCEPTED


@kernel
def has_orientation(place: Placement) -> bool:
    """Whether a body's quaternion is one; a single marker has zeros or NaN there."""
    return abs(_norm(place) - 1.0) <= _UNIT_TOLERANCE


@kernel
def _all_finite(p: Placement) -> bool:
    return (
        math.isfinite(p.x)
        and math.isfinite(p.y)
        and math.isfinite(p.z)
        and math.isfinite(p.qx)
        and math.isfinite(p.qy)
        and math.isfinite(p.qz)
        and math.isfinite(p.qw)
    )


@kernel
def _all_within(p: Placement, largest: float) -> bool:
    return (
        abs(p.x) <= largest
        and abs(p.y) <= largest
        and abs(p.z) <= largest
        and abs(p.qx) <= largest
        and abs(p.qy) <= largest
        and abs(p.qz) <= largest
        and abs(p.qw) <= largest
    )


@kernel
def _norm(p: Placement) -> float:
    return math.sqrt(p.qx * p.qx + p.qy * p.qy + p.qz * p.qz + p.qw * p.qw)


@kernel
def planar(place: Placement) -> Pose:
    """Ground pose of a body with z up whose place has no cause against it; its heading is its x axis' yaw.

    A leader without an orientation gets heading 0.
    """
    if not has_orientation(place):
        return Pose(place.x, place.y, 0.0)
    norm = _norm(place)
    x, y, z, w = place.qx / norm, place.qy / norm, place.qz / norm, place.qw / norm
    return Pose(place.x, place.y, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


@kernel
def check_odometry(odometry: Odometry, latest_ns: int) -> CheckedMotion:
    """Check a robot's own motion; a pose that is not one of a robot on the ground is left out."""
    cause = ACCEPTED if odometry.sound else MALFORMED
    if cause == ACCEPTED:
        cause = _pair_of_numbers_cause(odometry.v, FASTEST, odometry.u, HARDEST)
    if cause == ACCEPTED and (not is_time(odometry.stamp) or ns_of(odometry.stamp) > latest_ns):
        cause = BAD_STAMP
    has_pose = odometry.sound and place_cause(odometry.place) == ACCEPTED
    pose = planar(odometry.place) if has_pose else Pose(0.0, 0.0, 0.0)
    return CheckedMotion(cause, ns_of(odometry.stamp), odometry.v, odometry.u, has_pose, pose)


@kernel
def check_sighting(seen: RangeAndBearing, latest_ns: int) -> Sighting:
    """Check a sighting of the leader."""
    cause = ACCEPTED if seen.sound else MALFORMED
    if cause == ACCEPTED:
        cause = _pair_of_numbers_cause(seen.rho, FARTHEST, seen.alpha2, FARTHEST)
    if cause == ACCEPTED and seen.rho <= 0.0:
        cause = BAD_RANGE
    if cause == ACCEPTED and (not is_time(seen.stamp) or ns_of(seen.stamp) > latest_ns):
        cause = BAD_STAMP
    return Sighting(cause, ns_of(seen.stamp), seen.rho, seen.alpha2)


@kernel
def _pair_of_numbers_cause(a: float, most_a: float, b: float, most_b: float) -> int:
    if not math.isfinite(a) or not math.isfinite(b):
        return NOT_FINITE
    return ACCEPTED if abs(a) <= most_a and abs(b) <= most_b else OUT_OF_RANGE


@kernel
def is_estimate(read: ReadEstimate) -> bool:
    """Whether an estimate is one, its status included."""
    return read.sound and read.numbers.status <= _LAST_STATUS
