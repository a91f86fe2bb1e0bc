"""Odometry that comes late or falls short, put right by what the follower's own mocap track shows.

Delay, lag and scales are those of :func:`estimation.own_motion.input_alignment.align_odometry`, over the last
half minute and of the odometry as it came, so that a correction never feeds back into what it is estimated
from.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from estimation.own_motion.input_alignment import UNKNOWN, Alignment, Known, align_odometry
from estimation.own_motion.odometry_history import (
    IDEAL,
    Correction,
    InputTrust,
    MotionSample,
    time_constant_of,
)
from formation.pose import Pose

SPAN_NS = 30_000_000_000
"""How far back is looked."""

EVERY_NS = 1_000_000_000
"""How often."""

_DECIMATED_NS = 30_000_000  # between two poses or samples that are kept
SDS_LEFT = 3.0
"""Standard deviations of delay and lag together by which a motion that is corrected may come later still."""

LEAST_LAG, LEAST_SCALE = 0.02, 0.02
"""Below these [s], [1] nothing is worth correcting."""

_SURE = 4.0  # standard deviations off the ideal, before a correction begins
_LEAST_DELAY = 0.02  # [s]; below this nothing is worth correcting


@dataclass(frozen=True, slots=True)
class OdometryComparison:
    """What alignment rests on, decimated: poses (capture_ns, pose) and samples of odometry.

    ``found``: what it let know last; ``applied``: what odometry is corrected by.
    """

    poses: tuple[tuple[int, Pose], ...] = ()
    samples: tuple[MotionSample, ...] = ()
    found: Alignment = UNKNOWN
    applied: Correction = IDEAL
    next_ns: int = 0


PERFECT = InputTrust(0.0, 0.0)
"""Odometry that tells the motion as it is."""

NOTHING_SEEN = OdometryComparison()


def with_pose(comparison: OdometryComparison, capture_ns: int, pose: Pose) -> OdometryComparison:
    """Comparison with a mocap pose of the follower, if it is new and not too close to the one before."""
    poses = comparison.poses
    if poses and capture_ns < poses[-1][0] + _DECIMATED_NS:
        return comparison
    first = 0
    while first < len(poses) and poses[first][0] < capture_ns - SPAN_NS:
        first += 1
    return replace(comparison, poses=(*poses[first:], (capture_ns, pose)))


def with_sample(comparison: OdometryComparison, sample: MotionSample) -> OdometryComparison:
    """Comparison with a sample of odometry, if it is new and not too close to the one before."""
    samples = comparison.samples
    if samples and sample.stamp_ns < samples[-1].stamp_ns + _DECIMATED_NS:
        return comparison
    first = 0
    while first < len(samples) and samples[first].stamp_ns < sample.stamp_ns - SPAN_NS:
        first += 1
    return replace(comparison, samples=(*samples[first:], sample))


def reconsidered(
    comparison: OdometryComparison, now_ns: int, given: InputTrust = PERFECT
) -> OdometryComparison:
    """Comparison after alignment of what it holds, once a second; ``given``: what odometry is trusted with.

    A correction begins where the odometry, as given, is off by more than 20 ms or 2 % and by four standard
    deviations, and follows every later finding until that is within half of this; what is no longer known
    stays. What the motion may come later still is then what delay and lag together are uncertain by, three
    standard deviations, and what of them is not corrected. Where the two are not told apart, a motion that is
    given to come up to a time later keeps that.
    """
    if now_ns < comparison.next_ns:
        return comparison
    comparison = replace(comparison, next_ns=now_ns + EVERY_NS)
    if len(comparison.poses) < 2 or len(comparison.samples) < 2:
        return comparison
    zero_ns = comparison.poses[0][0]
    found = align_odometry(
        np.array([(at_ns - zero_ns) * 1e-9 for at_ns, _ in comparison.poses]),
        np.array([(pose.x, pose.y, pose.theta) for _, pose in comparison.poses]),
        np.array([(sample.stamp_ns - zero_ns) * 1e-9 + given.delay for sample in comparison.samples]),
        np.array([(given.scale_v * sample.v2, given.scale_u * sample.u2) for sample in comparison.samples]),
    )
    return replace(comparison, found=found, applied=_corrected(found, comparison.applied, given))


def _corrected(found: Alignment, before: Correction, given: InputTrust) -> Correction:
    """What is applied after a finding."""
    scaled = before._replace(
        scale_v=_applied(found.scale_v, before.scale_v, 1.0, LEAST_SCALE),
        scale_u=_applied(found.scale_u, before.scale_u, 1.0, LEAST_SCALE),
    )
    if found.delay is None or found.late is None:
        return scaled
    lag = time_constant_of(given, before)
    applied, none_sure = lag, 0.0
    if found.lag is not None:
        applied = _applied(found.lag, lag, given.time_constant, LEAST_LAG)
        none_sure = found.lag.sd if found.lag.value == 0.0 else 0.0
    # A delay that was told apart from another lag is none beside this one.
    late = Known(found.late.value - applied, found.delay.sd)
    told_apart = applied != given.time_constant or none_sure > 0.0 or before.left >= 0.0
    if not told_apart and 0.0 <= late.value < given.lag:
        # A motion that comes up to so much later, nobody knows how, is better told so than by a delay.
        return scaled
    delay = _applied(late, before.delay, 0.0, _LEAST_DELAY)
    return scaled._replace(
        delay=delay,
        time_constant=before.time_constant if applied == lag else applied,
        left=SDS_LEFT * (found.late.sd + none_sure) + abs(late.value - delay),
    )


def correction_report(applied: Correction, given: InputTrust) -> dict[str, float]:
    """What odometry is corrected by beside what is told of it, and by what lag it is answered, by name."""
    return {
        "odometry.delay": applied.delay,
        "odometry.scale_v": applied.scale_v,
        "odometry.scale_u": applied.scale_u,
        "odometry.time_constant": time_constant_of(given, applied),
    }


def is_surely_off(found: Known | None, ideal: float, least: float) -> bool:
    """Whether a finding is off what is ideal by more than is worth a correction, and by more than chance."""
    if found is None:
        return False
    off = abs(found.value - ideal)
    return off > least and off > _SURE * found.sd


def _applied(found: Known | None, before: float, ideal: float, least: float) -> float:
    if found is None:
        return before
    if before == ideal:
        return found.value if is_surely_off(found, ideal, least) else ideal
    return found.value if abs(found.value - ideal) > 0.5 * least else ideal
