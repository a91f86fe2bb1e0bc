"""What a mocap frame must pass before it is believed: the follower's own pose, and bodies that stand frozen.

The leader has a filter of its own to be compared with. The follower's pose is compared with where its motion
has carried it since the last pose that was believed, so that an outlier, a step, a turned heading or two
bodies that have changed places are noticed on the follower too. All of it is part of the fold over captures.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import Measurement, PairSeen, PoseNoise
from formation.kernel import kernel
from formation.pose import Pose, advance
from formation.wrapping import wrapped

_SCALE = 0.1  # share of a motion by which slip and wheel sizes may falsify it


class Cause(IntEnum):
    """Why a frame was not believed.

    GATED: the leader is not where the track has it. FOLLOWER: the follower is not where its own motion took
    it. FLIPPED: nor is its heading, but the opposite one would be. SWAPPED: the leader is where the follower
    should be instead. FROZEN: a body that moves has the very pose of the frame before. MOUNT: frames are as
    they should be, but the follower's heading is not its direction of travel.
    """

    NONE = 0
    GATED = 1
    FOLLOWER = 2
    FLIPPED = 3
    SWAPPED = 4
    FROZEN = 5
    MOUNT = 6

    @property
    def word(self) -> str:
        """The name that it is counted by."""
        return _WORDS[self]


_WORDS = ("", "gated", "follower_outlier", "flipped_heading", "swapped", "frozen", "wrong_mount")

BELIEVED = Cause.NONE.value
GATED = Cause.GATED.value
FOLLOWER = Cause.FOLLOWER.value
FLIPPED = Cause.FLIPPED.value
SWAPPED = Cause.SWAPPED.value
FROZEN = Cause.FROZEN.value
MOUNT = Cause.MOUNT.value


class FollowerCheck(NamedTuple):
    """What is known of the follower at one capture time; not ``known`` while no mocap frame has come.

    pose: the follower's last believed pose, carried on by its own motion since. sd_position [m], sd_heading
    [rad]: what this has added to the noise of the pose. shown: the newest frame, believed or not.
    leader_frozen, follower_frozen: whether that one repeats the pose of a body that moves.
    """

    known: bool
    pose: Pose
    sd_position: float
    sd_heading: float
    shown: PairSeen
    leader_frozen: bool
    follower_frozen: bool


class Checked(NamedTuple):
    """A check with a frame taken in, and what there is against this frame."""

    check: FollowerCheck
    cause: int


@kernel
def check_from(measurement: Measurement) -> FollowerCheck:
    """Check of one who has nothing but this measurement, and believes its frame if it has one."""
    seen = measurement.seen
    return FollowerCheck(measurement.framed, seen.follower, 0.0, 0.0, seen, False, False)


@kernel
def carried(check: FollowerCheck, before: FollowerMotion, after: FollowerMotion, dt: float) -> FollowerCheck:
    """Check after dt [s], the follower having moved as measured at both ends.

    Its mean motion is uncertain by the noise of the ends, by a tenth for slip and scale, and by half of the
    change in between. Such errors last, so that the standard deviations grow with time and not with its root.
    """
    v, u = 0.5 * (before.v2 + after.v2), 0.5 * (before.u2 + after.u2)
    sd_v = max(before.sd_v2, after.sd_v2) + _SCALE * abs(v) + 0.5 * abs(after.v2 - before.v2)
    sd_u = max(before.sd_u2, after.sd_u2) + _SCALE * abs(u) + 0.5 * abs(after.u2 - before.u2)
    sd_heading = check.sd_heading + sd_u * dt
    sd_position = check.sd_position + (sd_v + abs(v) * sd_heading) * dt
    pose = advance(check.pose, v, u, dt)
    return check._replace(pose=pose, sd_position=sd_position, sd_heading=sd_heading)


@kernel
def position_misfit(check: FollowerCheck, x: float, y: float, noise: PoseNoise) -> float:
    """Square of a position's distance [standard deviations]: chi-square with 2 degrees of freedom."""
    dx, dy = x - check.pose.x, y - check.pose.y
    variance = 2.0 * noise.position * noise.position + check.sd_position * check.sd_position
    return _ratio(dx * dx + dy * dy, variance)


@kernel
def heading_misfit(check: FollowerCheck, theta: float, noise: PoseNoise) -> float:
    """Square of a heading's distance [standard deviations]: chi-square with 1 degree of freedom."""
    off = wrapped(theta - check.pose.theta)
    return _ratio(off * off, 2.0 * noise.heading * noise.heading + check.sd_heading * check.sd_heading)


@kernel
def misfit(check: FollowerCheck, pose: Pose, noise: PoseNoise) -> float:
    """The larger of both misfits of a pose.

    The quantile of the chi-square with 2 degrees of freedom is safe for both.
    """
    return max(position_misfit(check, pose.x, pose.y, noise), heading_misfit(check, pose.theta, noise))


@kernel
def checked(
    check: FollowerCheck, seen: PairSeen, noise: PoseNoise, gate: float, leader_moves: bool
) -> Checked:
    """Check with a frame taken in, and what there is against it.

    A pose within the gate takes the place of the carried one, unless it is the last one bit for bit: that
    brings no news. A leader that moves has frozen as soon as its position repeats, the follower when its own
    motion has taken it out of the gate; either stays so until another pose comes, for who sees nothing stops.
    """
    follower, shown = seen.follower, check.shown
    off = misfit(check, follower, noise)
    repeats = seen.leader_x == shown.leader_x and seen.leader_y == shown.leader_y
    leader_frozen = repeats and (check.leader_frozen or leader_moves)
    follower_repeats = same_pose(follower, shown.follower)
    follower_frozen = follower_repeats and (check.follower_frozen or off > gate)
    cause = _cause(check, seen, noise, gate, off)
    if leader_frozen or follower_frozen:
        cause = FROZEN
    after = check._replace(shown=seen, leader_frozen=leader_frozen, follower_frozen=follower_frozen)
    if follower_repeats or off > gate:
        return Checked(after, cause)
    return Checked(after._replace(pose=follower, sd_position=0.0, sd_heading=0.0), cause)


@kernel
def same_pose(a: Pose, b: Pose) -> bool:
    """Whether two poses are the same bit for bit."""
    return a.x == b.x and a.y == b.y and a.theta == b.theta


@kernel
def _cause(check: FollowerCheck, seen: PairSeen, noise: PoseNoise, gate: float, off: float) -> int:
    """What there is against a frame whose follower is ``off``; frozen bodies apart."""
    if off <= gate:
        return BELIEVED
    if position_misfit(check, seen.leader_x, seen.leader_y, noise) <= gate:
        return SWAPPED
    in_place = position_misfit(check, seen.follower.x, seen.follower.y, noise) <= gate
    if in_place and heading_misfit(check, seen.follower.theta + math.pi, noise) <= gate:
        return FLIPPED
    return FOLLOWER


@kernel
def _ratio(square: float, variance: float) -> float:
    """Misfit of what has no noise at all: none if it is exact, else infinite."""
    if variance > 0.0:
        return square / variance
    return math.inf if square > 0.0 else 0.0
