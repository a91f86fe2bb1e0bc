"""How noisy a motion capture is, as its own frames tell: the scale of what the estimator was told of it.

Third divided differences of four positions, scaled to unit gain for white noise, hold nothing of a motion
whose acceleration changes evenly, whatever the spacing of the frames. What a robot's motion leaves in them is
its jerk times the cube of the spacing over 4.5: micrometres at 100 frames a second, and tenths of a
millimetre at ten. So they tell noise from manoeuvres without knowing any model of either.

Noise that one frame shares with the next, as filtered or shaking markers have it, is missing in them.
Therefore the same differences are taken over strides of 50 ms as well. Over these a speed step is as large as
noise is, so that they can keep the scale from falling below one, and no more.

Noise is that of bodies that move; who stands is quieter, and isn't asked.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.models.measurement import PairSeen, PoseNoise
from formation.angles import wrapped
from formation.kernel import kernel
from formation.pose import Pose

LEAST_SCALE, MOST_SCALE = 0.1, 30.0
"""Within which the noise is looked for, in multiples of what is told."""

REFUTED = 1.3
"""Scale above which what was told is refuted."""

_NS = 1e-9
_STRIDE_NS = 50_000_000  # longer than marker filters and the shaking of a wheel remember
_LONGEST_NS = 500_000_000  # four positions further apart tell more of the motion than of the noise
_CLIP = 2.25  # variances that a square counts for at the most: outliers and speed steps are few
_CLIPPED_MEAN = 0.7785  # of the square of a standard normal that is cut off there
_BEGIN = 4.0  # differences that what is told counts as
_QUICK, _SLOW = 128.0, 1000.0  # differences that the two means reach back
_CHANGED = 2.0  # factor between the two variances by which the noise has become another
_VARIANCE = (
    6.0  # of a mean over n differences, times n: 2 as squares, 2.3 as they overlap, 1.3 as they are cut
)
_SURE = 1.5  # standard deviations by which the noise must differ from what is told
_HALF_TRACK = 0.1  # by which a turn rate is the speed of a wheel [m]


class NoiseLearning(NamedTuple):
    """What noise is learned by: whether it is, what is told of it, and the speed [m/s] of who moves."""

    learns: bool
    told: PoseNoise
    moving: float


class Level(NamedTuple):
    """A variance over the one that is told: by many differences, by the last few, and how many they are."""

    ratio: float
    quick: float
    weight: float


class Moment(NamedTuple):
    """A frame that was looked at."""

    capture_ns: int
    seen: PairSeen


class Moments(NamedTuple):
    """The last three frames, newest first, and how many of them there are."""

    held: int
    a: Moment
    b: Moment
    c: Moment


class Levels(NamedTuple):
    """Of positions and of headings."""

    position: Level
    heading: Level


class NoiseScale(NamedTuple):
    """Standard deviations over those that are told: of a position, and of the follower's heading."""

    position: float
    heading: float


class NoiseEstimate(NamedTuple):
    """All that is known of the noise.

    scale: what measurements are taken with now. frames, strides: neighbouring frames, and frames at least
    50 ms apart. gated: whether the newest frame wasn't believed.
    """

    scale: NoiseScale
    by_frame: Levels
    by_stride: Levels
    frames: Moments
    strides: Moments
    gated: bool


class Weights(NamedTuple):
    """Of four positions, newest first, in their difference; it has unit gain for white noise."""

    new: float
    a: float
    b: float
    c: float


_AS_TOLD = Level(1.0, 1.0, _BEGIN)
_NO_MOMENT = Moment(0, PairSeen(0.0, 0.0, Pose(0.0, 0.0, 0.0)))
_NO_MOMENTS = Moments(0, _NO_MOMENT, _NO_MOMENT, _NO_MOMENT)
NOISE_AS_TOLD = NoiseEstimate(
    NoiseScale(1.0, 1.0),
    Levels(_AS_TOLD, _AS_TOLD),
    Levels(_AS_TOLD, _AS_TOLD),
    _NO_MOMENTS,
    _NO_MOMENTS,
    gated=False,
)
"""What is known of the noise before any frame."""


@kernel
def scaled_noise(told: PoseNoise, estimate: NoiseEstimate) -> PoseNoise:
    """Noise of a mocap pose as it is known now."""
    return PoseNoise(told.position * estimate.scale.position, told.heading * estimate.scale.heading)


@kernel
def kept_noise(estimate: NoiseEstimate) -> NoiseEstimate:
    """What stays known of the noise when the frames before are forgotten."""
    frames, strides = estimate.frames, estimate.strides
    return estimate._replace(frames=frames._replace(held=0), strides=strides._replace(held=0), gated=False)


@kernel(inline=False)
def noise_with_frame(
    estimate: NoiseEstimate, moment: Moment, gated: bool, learning: NoiseLearning
) -> NoiseEstimate:
    """Estimate after a frame newer than those before; ``gated``: whether the track did not believe it.

    A frame that alone is not believed is left out, as an outlier; where one after the other is not, the gate
    may well be too narrow for the noise.
    """
    if gated and not estimate.gated:
        return estimate._replace(gated=True)
    estimate = estimate._replace(gated=gated)
    if estimate.frames.held > 0 and moment.capture_ns <= estimate.frames.a.capture_ns:
        return estimate
    by_frame = _differenced(estimate.by_frame, estimate.frames, estimate.strides, moment, learning)
    by_stride, strides = estimate.by_stride, estimate.strides
    if strides.held == 0 or moment.capture_ns - strides.a.capture_ns >= _STRIDE_NS:
        by_stride = _differenced(by_stride, strides, strides, moment, learning)
        strides = _pushed(strides, moment)
    scale = NoiseScale(
        _scale(by_frame.position, by_stride.position), _scale(by_frame.heading, by_stride.heading)
    )
    return NoiseEstimate(scale, by_frame, by_stride, _pushed(estimate.frames, moment), strides, gated)


@kernel
def _pushed(moments: Moments, moment: Moment) -> Moments:
    return Moments(min(3, moments.held + 1), moment, moments.a, moments.b)


@kernel
def _differenced(
    levels: Levels, before: Moments, long_before: Moments, moment: Moment, learning: NoiseLearning
) -> Levels:
    """Levels with the differences of a frame and the three before it, of the bodies that move."""
    far = moment.capture_ns - before.c.capture_ns > _LONGEST_NS
    if before.held < 3 or long_before.held < 3 or far:
        return levels
    since = long_before.c
    dt = (moment.capture_ns - since.capture_ns) * _NS
    new, a, b, c = moment.seen, before.a.seen, before.b.seen, before.c.seen
    w = _weights(moment.capture_ns, before)
    position, heading = levels.position, levels.heading
    variance = learning.told.position * learning.told.position
    way = _distance(new.leader_x - since.seen.leader_x, new.leader_y - since.seen.leader_y)
    repeats = (new.leader_x == a.leader_x and new.leader_y == a.leader_y) or (
        a.leader_x == b.leader_x and a.leader_y == b.leader_y
    )
    if way > learning.moving * dt and not repeats:
        x = w.new * new.leader_x + w.a * a.leader_x + w.b * b.leader_x + w.c * c.leader_x
        y = w.new * new.leader_y + w.a * a.leader_y + w.b * b.leader_y + w.c * c.leader_y
        position = _learned(_learned(position, x * x / variance), y * y / variance)
    here, was = new.follower, since.seen.follower
    way = _distance(here.x - was.x, here.y - was.y) + _HALF_TRACK * abs(wrapped(here.theta - was.theta))
    repeats = (here.x == a.follower.x and here.y == a.follower.y) or (
        a.follower.x == b.follower.x and a.follower.y == b.follower.y
    )
    if way > learning.moving * dt and not repeats:
        x = w.new * here.x + w.a * a.follower.x + w.b * b.follower.x + w.c * c.follower.x
        y = w.new * here.y + w.a * a.follower.y + w.b * b.follower.y + w.c * c.follower.y
        position = _learned(_learned(position, x * x / variance), y * y / variance)
        turn = _heading_difference(w, here.theta, before)
        heading = _learned(heading, turn * turn / (learning.told.heading * learning.told.heading))
    return Levels(position, heading)


@kernel
def _distance(dx: float, dy: float) -> float:
    return math.sqrt(dx * dx + dy * dy)


@kernel
def _heading_difference(w: Weights, theta: float, before: Moments) -> float:
    """Difference of headings [rad]; as the weights add up to nothing, they may be counted from the newest."""
    a = wrapped(before.a.seen.follower.theta - theta)
    b = wrapped(before.b.seen.follower.theta - theta)
    c = wrapped(before.c.seen.follower.theta - theta)
    return w.a * a + w.b * b + w.c * c


@kernel
def _weights(new_ns: int, before: Moments) -> Weights:
    """Weights of the third divided difference at these times, whose squares add up to one."""
    a = (new_ns - before.a.capture_ns) * _NS
    b = (new_ns - before.b.capture_ns) * _NS
    c = (new_ns - before.c.capture_ns) * _NS
    # Times a b c (b - a) (c - a) (c - b), so that nothing is divided by.
    ab, ac, bc = b - a, c - a, c - b
    new, first = ab * ac * bc, -b * c * bc
    second, third = a * c * ac, -a * b * ab
    by = 1.0 / math.sqrt(new * new + first * first + second * second + third * third)
    return Weights(new * by, first * by, second * by, third * by)


@kernel
def _learned(level: Level, square: float) -> Level:
    """Level with one more square, over the variance that is told."""
    weight = min(level.weight + 1.0, _SLOW)
    ratio = _mean_with(level.ratio, square, weight)
    quick = _mean_with(level.quick, square, min(weight, _QUICK))
    if weight > _QUICK and (quick > _CHANGED * ratio or ratio > _CHANGED * quick):
        return Level(quick, quick, _QUICK)
    return Level(ratio, quick, weight)


@kernel
def _mean_with(mean: float, square: float, weight: float) -> float:
    """Mean of squares, none of which counts for more than the clip, with one more of them."""
    news = min(square / mean, _CLIP) / _CLIPPED_MEAN - 1.0
    most, least = MOST_SCALE * MOST_SCALE, LEAST_SCALE * LEAST_SCALE
    return min(most, max(least, mean * (1.0 + news / weight)))


@kernel
def _scale(by_frame: Level, by_stride: Level) -> float:
    """Scale of standard deviations that is certain: as told, where the noise doesn't clearly differ."""
    ratio, unsure = by_frame.ratio, 1.0 + _SURE * math.sqrt(_VARIANCE / (2.0 * by_frame.weight))
    strided = by_stride.ratio / (1.0 + _SURE * math.sqrt(_VARIANCE / (2.0 * by_stride.weight)))
    ratio = max(ratio, min(1.0, strided))
    if ratio > unsure:
        return math.sqrt(ratio / unsure)
    if ratio * unsure < 1.0:
        return math.sqrt(ratio * unsure)
    return 1.0
