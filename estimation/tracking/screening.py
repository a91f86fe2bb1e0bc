"""What a mocap frame must pass before it is believed: the follower's own pose, and bodies that stand frozen.

The leader has a filter of its own to be compared with. The follower's pose is compared with where its motion
has carried it since the last pose that was believed, so that an outlier, a step, a turned heading or two
bodies that have changed places are noticed on the follower too. All of it is part of the fold over captures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from estimation.models.measurement import PairSeen, PoseNoise
from estimation.models.motion import FollowerMotion
from formation.angles import wrap
from formation.pose import Pose, advance

_SCALE = 0.1  # share of a motion by which slip and wheel sizes may falsify it


class Cause(Enum):
    """Why a frame was not believed; the value is the name it is counted by.

    GATED: the leader is not where the track has it. FOLLOWER: the follower is not where its own motion took
    it. FLIPPED: nor is its heading, but the opposite one would be. SWAPPED: the leader is where the follower
    should be instead. FROZEN: a body that moves has the very pose of the frame before.
    """

    GATED = "gated"
    FOLLOWER = "follower_outlier"
    FLIPPED = "flipped_heading"
    SWAPPED = "swapped"
    FROZEN = "frozen"


STANDING = frozenset({Cause.FLIPPED, Cause.SWAPPED, Cause.FROZEN})
"""Causes that no real motion has: such frames do not even begin a new track while the screen can tell."""


@dataclass(frozen=True, slots=True)
class Watch:
    """What the screen knows at one capture time.

    pose: the follower's last believed pose, carried on by its own motion since. sd_position [m], sd_heading
    [rad]: what this has added to the noise of the pose. shown: the newest frame, believed or not.
    leader_frozen, follower_frozen: whether that one repeats the pose of a body that moves.
    """

    pose: Pose
    sd_position: float
    sd_heading: float
    shown: PairSeen
    leader_frozen: bool = False
    follower_frozen: bool = False


@dataclass(frozen=True, slots=True)
class Doubt:
    """A jump that was followed without being explained: either where it led is wrong, or where it began.

    position [m] and heading [rad] of the follower: sums of the jumps. since_ns: capture time of the last.
    """

    position: float = 0.0
    heading: float = 0.0
    since_ns: int = 0


NO_DOUBT = Doubt()


def watch_from(seen: PairSeen) -> Watch:
    """Watch of one who has nothing but this frame, and believes it."""
    return Watch(seen.follower, 0.0, 0.0, seen)


def carried(watch: Watch, before: FollowerMotion, after: FollowerMotion, dt: float) -> Watch:
    """Watch after dt [s], the follower having moved as measured at both ends.

    Its mean motion is uncertain by the noise of the ends, by a tenth for slip and scale, and by half of the
    change in between. Such errors last, so that the standard deviations grow with time and not with its root.
    """
    v, u = 0.5 * (before.v2 + after.v2), 0.5 * (before.u2 + after.u2)
    sd_v = max(before.sd_v2, after.sd_v2) + _SCALE * abs(v) + 0.5 * abs(after.v2 - before.v2)
    sd_u = max(before.sd_u2, after.sd_u2) + _SCALE * abs(u) + 0.5 * abs(after.u2 - before.u2)
    sd_heading = watch.sd_heading + sd_u * dt
    sd_position = watch.sd_position + (sd_v + abs(v) * sd_heading) * dt
    return Watch(
        advance(watch.pose, v, u, dt),
        sd_position,
        sd_heading,
        watch.shown,
        watch.leader_frozen,
        watch.follower_frozen,
    )


def misfit(watch: Watch, pose: Pose, noise: PoseNoise) -> float:
    """Square of the distance between the watch and a pose in standard deviations: position or heading.

    The larger of both counts. That of the position is chi-square with 2 degrees of freedom, that of the
    heading with 1, so that the quantile of the former is safe for both.
    """
    return max(
        _position_misfit(watch, pose.x, pose.y, noise),
        _heading_misfit(watch, pose.theta - watch.pose.theta, noise),
    )


def looked_at(watch: Watch, seen: PairSeen, gate: float, *, leader_moves: bool) -> tuple[Watch, float]:
    """Watch with a frame taken in, and the misfit of the follower's pose.

    A pose within the gate takes the place of the carried one, unless it is the last one bit for bit: that
    brings no news. A leader that moves has frozen as soon as its position repeats, the follower when its own
    motion has taken it out of the gate; either stays so until another pose comes, for who sees nothing stops.
    """
    follower, shown = seen.follower, watch.shown
    off = misfit(watch, follower, seen.noise)
    leader_frozen = seen.leader == shown.leader and (watch.leader_frozen or leader_moves)
    if follower == shown.follower:
        follower_frozen = watch.follower_frozen or off > gate
        return Watch(
            watch.pose, watch.sd_position, watch.sd_heading, seen, leader_frozen, follower_frozen
        ), off
    if off > gate:
        return Watch(watch.pose, watch.sd_position, watch.sd_heading, seen, leader_frozen), off
    return Watch(follower, 0.0, 0.0, seen, leader_frozen), off


def cause_of(watch: Watch, off: float, gate: float) -> Cause | None:
    """Cause against the newest frame of a watch whose misfit is ``off``; None if there is none to be seen."""
    seen = watch.shown
    if watch.leader_frozen or watch.follower_frozen:
        return Cause.FROZEN
    if off <= gate:
        return None
    if _position_misfit(watch, *seen.leader, seen.noise) <= gate:
        return Cause.SWAPPED
    if _position_misfit(watch, seen.follower.x, seen.follower.y, seen.noise) <= gate:
        turned = seen.follower.theta - watch.pose.theta + math.pi
        if _heading_misfit(watch, turned, seen.noise) <= gate:
            return Cause.FLIPPED
    return Cause.FOLLOWER


def _position_misfit(watch: Watch, x: float, y: float, noise: PoseNoise) -> float:
    dx, dy = x - watch.pose.x, y - watch.pose.y
    return (dx * dx + dy * dy) / (2.0 * noise.position**2 + watch.sd_position**2)


def _heading_misfit(watch: Watch, turned: float, noise: PoseNoise) -> float:
    return float(wrap(turned)) ** 2 / (2.0 * noise.heading**2 + watch.sd_heading**2)
