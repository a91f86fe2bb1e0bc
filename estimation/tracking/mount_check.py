"""Whether the follower's body sits on its robot as is said: recursively, from how the robot's pose moves.

A robot on wheels moves along its heading. Over a short arc the chord lies along the mean of the headings at
its ends, whatever speed and turn rate are: what it has across that tells by how much the heading is off, and
in turns how far the place is ahead of the wheel axis. Only mocap is looked at, so that slip along the way,
odometry and latency make no difference; that a body faces backwards it cannot tell from a robot that does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.models.measurement import PoseNoise
from formation.kernel import kernel
from formation.pose import Pose
from formation.wrapping import wrapped

_NS = 1e-9
_ARC_NS = 250_000_000
"""Length of an arc: at a tenth of a metre per second some hundred times the noise of mocap."""
_LONGEST_ARC_NS = 600_000_000
_TURNED = 0.2  # [rad]: an arc that has turned by this is over, as speed and turn rate change in hard turns
_SHARPEST_ARC = 1.0  # [rad]; on a longer one heading and speed may do anything in between
_CLEAR = 6.0  # standard deviations of noise that an arc is longer than, or turns by more than
_MEMORY = 0.99  # of what was known per arc that moves: a body that is knocked aside is noticed, too
_SLIP = 0.02  # share of an arc by which it may go aside without a mount being off
_LIKELY_PLACE = 0.1  # [m]: how far off the middle of the wheel axis a body may sit, as a standard deviation
_FEWEST = 8  # arcs before anything is said
_OUTLIER = 3.0  # standard deviations from which on an arc counts less
_SURE = 4.0  # standard deviations by which anything said is off zero

MOST_YAW = math.radians(5.0)
"""A heading that is off by more than this [rad] is not to be driven by."""
NOTED_YAW, NOTED_PLACE = math.radians(2.0), 0.005
"""A heading [rad] or place [m] that is off by more than this is worth a word."""


class MountCheck(NamedTuple):
    """What is known of a mount that is left over: sums over arcs, older ones counting less.

    ``begun``, ``since_ns``, ``since``: the arc under way. Of each arc ``ahead`` [m] along the mean heading,
    ``turn`` [rad] and ``aside`` [m] across, in standard deviations of the latter; ``arcs``: their number.
    ``off``: whether by them the robot must not be driven by its heading.
    """

    begun: bool
    since_ns: int
    since: Pose
    ahead_ahead: float
    ahead_turn: float
    turn_turn: float
    ahead_aside: float
    turn_aside: float
    aside_aside: float
    arcs: float
    off: bool


NO_MOUNT_CHECK = MountCheck(False, 0, Pose(0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, off=False)


class MountLeft(NamedTuple):
    """Yaw [rad] and place [m] ahead of the wheel axis that are left over, with their standard deviations.

    Not ``known`` before there were enough arcs. ``usual``: by how much more arcs vary than noise lets them.
    """

    known: bool
    yaw: float
    place: float
    sd_yaw: float
    sd_place: float
    usual: float


@kernel
def mount_checked(
    check: MountCheck, capture_ns: int, pose: Pose, noise: PoseNoise, jumped: bool
) -> MountCheck:
    """Check with the robot's newest pose; after a jump an arc begins anew."""
    if not check.begun or jumped:
        return check._replace(begun=True, since_ns=capture_ns, since=pose)
    turn = wrapped(pose.theta - check.since.theta)
    if capture_ns - check.since_ns < _ARC_NS and abs(turn) < _TURNED:
        return check
    usable = capture_ns - check.since_ns <= _LONGEST_ARC_NS and abs(turn) <= _SHARPEST_ARC
    after = _with_arc(check, pose, turn, noise) if usable else check
    return after._replace(since_ns=capture_ns, since=pose)


@kernel(inline=False)
def _with_arc(check: MountCheck, pose: Pose, turn: float, noise: PoseNoise) -> MountCheck:
    """Check with an arc that moves, the same otherwise."""
    dx, dy = pose.x - check.since.x, pose.y - check.since.y
    blur, twist = 2.0 * noise.position * noise.position, 2.0 * noise.heading * noise.heading
    square = dx * dx + dy * dy
    turns = turn * turn > _CLEAR * _CLEAR * twist
    if not (turns or square > _CLEAR * _CLEAR * blur):
        return check
    middle = check.since.theta + 0.5 * turn
    cos, sin, whole = math.cos(middle), math.sin(middle), 2.0 * math.sin(0.5 * turn)
    ahead, aside = cos * dx + sin * dy, cos * dy - sin * dx
    # Noise of place and heading may go together: a turn that may be noise tells no place, but hides one.
    bend = whole if turns else 0.0
    hidden = _LIKELY_PLACE * (whole - bend)
    # The mean of two headings has half the variance of one.
    variance = blur + square * (0.25 * twist + _SLIP * _SLIP) + hidden * hidden
    left = mount_left(check)
    off = 0.0
    if left.known:
        off = (aside + ahead * math.tan(left.yaw) - bend * left.place) / math.sqrt(variance)
    far = abs(off) / (_OUTLIER * math.sqrt(left.usual))
    weight = 1.0 if far <= 1.0 else 1.0 / far
    share = weight / variance
    check = check._replace(
        ahead_ahead=_MEMORY * check.ahead_ahead + share * ahead * ahead,
        ahead_turn=_MEMORY * check.ahead_turn - share * ahead * bend,
        turn_turn=_MEMORY * check.turn_turn + share * bend * bend,
        ahead_aside=_MEMORY * check.ahead_aside - share * ahead * aside,
        turn_aside=_MEMORY * check.turn_aside + share * bend * aside,
        aside_aside=_MEMORY * check.aside_aside + share * aside * aside,
        arcs=_MEMORY * check.arcs + 1.0,
    )
    # Once for an arc: it is asked at every estimate.
    left = mount_left(check)
    return check._replace(off=left.known and surely_above(left.yaw, left.sd_yaw, MOST_YAW))


@kernel
def _nothing_left() -> MountLeft:
    return MountLeft(False, 0.0, 0.0, math.inf, math.inf, 1.0)


@kernel
def mount_left(check: MountCheck) -> MountLeft:
    """Yaw and place by least squares; residuals that are larger than noise make them the less certain."""
    if check.arcs < _FEWEST:
        return _nothing_left()
    p, q = check.ahead_ahead, check.ahead_turn
    r = check.turn_turn + 1.0 / (_LIKELY_PLACE * _LIKELY_PLACE)
    det = p * r - q * q
    if not det > 1e-9 * p * r:
        return _nothing_left()
    slope = (r * check.ahead_aside - q * check.turn_aside) / det
    place = (p * check.turn_aside - q * check.ahead_aside) / det
    rest = check.aside_aside - slope * check.ahead_aside - place * check.turn_aside
    usual = max(1.0, rest / (check.arcs - 2.0))
    sd_yaw, sd_place = math.sqrt(usual * r / det), math.sqrt(usual * p / det)
    return MountLeft(True, math.atan(slope), place, sd_yaw, sd_place, usual)


@kernel
def surely_above(value: float, sd: float, limit: float) -> bool:
    """Whether something is larger than a limit either way, beyond doubt."""
    return abs(value) - _SURE * sd > limit
