"""The track of a leader: its point right after one measurement, and what else is known there."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

from estimation.filters.filter import Filter
from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import FollowerMotion, ProcessNoise, mean_motion
from estimation.models.measurement import NO_MOTION, Measurement, way_between
from estimation.tracking.follower_check import BELIEVED, FollowerCheck, check_from
from estimation.tracking.follower_check import GATED as LEADER_OFF
from estimation.tracking.manoeuvre import Manoeuvre, steady
from formation.kernel import kernel
from formation.pose import Pose

_NS = 1e-9


class Verdict(IntEnum):
    """What became of a measurement."""

    USED = 0
    GATED = 1
    RESTARTED = 2
    LATE = 3
    DUPLICATE = 4

    @property
    def word(self) -> str:
        """The name that it is counted by."""
        return _WORDS[self]


_WORDS = ("used", "gated", "restarted", "too_late", "duplicate")

USED = Verdict.USED.value
GATED = Verdict.GATED.value
RESTARTED = Verdict.RESTARTED.value
LATE = Verdict.LATE.value
DUPLICATE = Verdict.DUPLICATE.value

SAME_NS = 100_000
"""Captures this close are one: no motion capture takes 10,000 frames a second, but some send one twice."""


class JumpUncertainty(NamedTuple):
    """A jump that was followed without being explained: either where it led is wrong, or where it began.

    position [m] and heading [rad] of the follower: sums of the jumps. since_ns: capture time of the last.
    """

    position: float
    heading: float
    since_ns: int


NO_JUMP = JumpUncertainty(0.0, 0.0, 0)


class TentativeTrack(NamedTuple):
    """A second track made of rejected measurements only, waiting for enough of them to agree.

    frames: how many it is made of, 0 for none. framed: whether the last one came from a mocap frame, with
    the follower's pose in it.
    """

    belief: Gaussian
    capture_ns: int
    motion: FollowerMotion
    frames: int
    framed: bool
    pose: Pose


class TrackPoint(NamedTuple):
    """The track right after one measurement.

    verdict: a :class:`Verdict`; cause: why the measurement was not used, a
    :class:`~estimation.tracking.follower_check.Cause`. used_ns: capture time of the newest one that was used.
    noise: what the leader was taken to be driven by. manoeuvre: what innovations tell of jumps of its motion.
    period: typical time [s] from one measurement to the next, 0 while there was but one.
    way, way_s: the follower's mean motion that the belief was moved by, and for how long [s].
    """

    measurement: Measurement
    belief: Gaussian
    verdict: int
    nis: float
    used_ns: int
    settled: bool
    tentative: TentativeTrack
    check: FollowerCheck
    cause: int
    jump: JumpUncertainty
    noise: ProcessNoise
    manoeuvre: Manoeuvre
    period: float = 0.0
    way: FollowerMotion = NO_MOTION
    way_s: float = 0.0


@kernel
def no_tentative(belief: Gaussian) -> TentativeTrack:
    """No tentative track; its fields must hold something, so take the belief."""
    return TentativeTrack(belief, 0, FollowerMotion(0.0, 0.0, 0.0, 0.0), 0, False, Pose(0.0, 0.0, 0.0))


@kernel
def begun(measurement: Measurement, estimator: Filter) -> TrackPoint:
    """First point of a track that knows nothing but this measurement."""
    belief = estimator.start(measurement)
    return TrackPoint(
        measurement,
        belief,
        RESTARTED,
        math.nan,
        measurement.capture_ns,
        False,
        no_tentative(belief),
        check_from(measurement),
        BELIEVED,
        JumpUncertainty(0.0, 0.0, 0),
        estimator.noise,
        steady(),
        0.0,
        FollowerMotion(0.0, 0.0, 0.0, 0.0),
        0.0,
    )


@kernel
def way_to(last: TrackPoint, measurement: Measurement, believed: bool, dt: float) -> FollowerMotion:
    """Mean motion of the follower over the dt [s] from a point to the measurement after it.

    It is that between measured poses where belief and measurement are along their axes and the new one is
    ``believed``, else what is known of the way, else the mean of the motions at both ends.
    """
    before = last.measurement
    if measurement.anchored and before.anchored and believed:
        shown = last.cause == BELIEVED or last.cause == LEADER_OFF
        pose = before.seen.follower if shown else last.check.pose
        return way_between(pose, measurement.seen.follower, dt)
    return measurement.way if measurement.has_way else mean_motion(before.motion, measurement.motion)


@kernel
def next_period(period: float, dt: float) -> float:
    """Typical time [s] between measurements after one more: it nears their median by steps of a tenth."""
    if period <= 0.0:
        return dt
    step = 0.1 * period
    return period + min(step, max(-step, dt - period))


@kernel
def lasting(jump: JumpUncertainty, now_ns: int, uncertain_for: float) -> JumpUncertainty:
    """Uncertainty as it is now: a body that has stayed where it jumped for ``uncertain_for`` [s] is there."""
    if (now_ns - jump.since_ns) * _NS <= uncertain_for:
        return jump
    return JumpUncertainty(0.0, 0.0, 0)


@kernel
def with_motion(point: TrackPoint, motion: FollowerMotion) -> TrackPoint:
    """Point whose measurement has another motion of the follower; its belief is still the old one."""
    return point._replace(measurement=point.measurement._replace(motion=motion))
