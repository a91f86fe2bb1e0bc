"""How noisy a motion capture is, as its own frames tell: the scale of what the estimator was told of it.

Third divided differences of four positions, scaled to unit gain for white noise, hold nothing of a motion
whose acceleration changes evenly, whatever the spacing of the frames. What a robot's motion leaves in them is
its jerk times the cube of the spacing over 4.5: micrometres at 100 frames a second, and tenths of a
millimetre at ten. So they tell noise from manoeuvres without knowing any model of either.

Noise that one frame shares with the next is missing in them: that of filtered poses, and of bodies that rock
as they drive, some five times a second. Therefore the same differences are taken over strides of some 100 ms
as well, half of such a swing. Over these a speed step is as large as noise is, so that by themselves they
keep the scale from falling below one, and no more. Strides of twice that tell how much of them motion can be.

Noise is that of bodies that move; who stands is quieter, and isn't asked.

A sensor on board sees the leader too seldom for that, and from a robot that turns. Its noise is told by the
innovations of the track instead, less what of them the prediction accounts for.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.consistency.noise_level import (
    AS_TOLD,
    Innovation,
    Level,
    certain_scale,
    learned,
    level_or_anew,
    shaken_scale,
)
from estimation.models.measurement import PairSeen, PoseNoise
from estimation.tracking.track_point import GATED, RESTARTED, TrackPoint
from formation.kernel import kernel
from formation.pose import Pose
from formation.wrapping import wrapped

REFUTED = 1.3
"""Scale above which what was told is refuted."""

_NS = 1e-9
STRIDE_NS = 97_000_000  # no multiple of a usual spacing of frames, so that a microsecond doesn't matter
_LONG_STRIDES = 2
LONGEST_NS = 520_000_000  # four positions further apart tell more of the motion than of the noise
_ANOTHER = 2.0  # factor between two scales that don't agree; real bodies rock now more, now less
_FOLLOWED = 3.0  # [s] in which what rests on a scale follows one that becomes known more exactly
_LEAST_LEFT = 0.05  # of an innovation after the update; what leaves less tells nothing of the noise
_HALF_TRACK = 0.1  # by which a turn rate is the speed of a wheel [m]


class NoiseLearning(NamedTuple):
    """What noise is learned by: whether it is, what is told of it, and the speed [m/s] of who moves."""

    learns: bool
    told: PoseNoise
    moving: float


NOISE_GIVEN = NoiseLearning(False, PoseNoise(1.0, 1.0), 0.0)
"""Nothing is learned of the noise."""


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


class SightLevels(NamedTuple):
    """Of ranges and of bearings."""

    range: Level
    bearing: Level


class NoiseScale(NamedTuple):
    """Standard deviations over those told: of positions, the follower's heading, ranges and bearings."""

    position: float
    heading: float
    range: float
    bearing: float


class NoiseEstimate(NamedTuple):
    """All that is known of the noise.

    scale: what measurements are taken with now. frames, strides, long_strides: neighbouring frames, and such
    as are some 100 and 200 ms apart. gated: whether the newest frame or sighting wasn't believed. basis:
    scale of positions that what is learned of the leader's driving rests on.
    """

    scale: NoiseScale
    by_frame: Levels
    by_stride: Levels
    by_long_stride: Levels
    sight: SightLevels
    frames: Moments
    strides: Moments
    long_strides: Moments
    gated: bool
    basis: float


class Weights(NamedTuple):
    """Of four positions, newest first, in their difference; it has unit gain for white noise."""

    new: float
    a: float
    b: float
    c: float


_NO_MOMENT = Moment(0, PairSeen(0.0, 0.0, Pose(0.0, 0.0, 0.0)))
_NO_MOMENTS = Moments(0, _NO_MOMENT, _NO_MOMENT, _NO_MOMENT)
NOISE_AS_TOLD = NoiseEstimate(
    NoiseScale(1.0, 1.0, 1.0, 1.0),
    Levels(AS_TOLD, AS_TOLD),
    Levels(AS_TOLD, AS_TOLD),
    Levels(AS_TOLD, AS_TOLD),
    SightLevels(AS_TOLD, AS_TOLD),
    _NO_MOMENTS,
    _NO_MOMENTS,
    _NO_MOMENTS,
    gated=False,
    basis=1.0,
)
"""What is known of the noise before any frame."""


@kernel
def scaled_noise(told: PoseNoise, estimate: NoiseEstimate) -> PoseNoise:
    """Noise of a mocap pose as it is known now."""
    return PoseNoise(told.position * estimate.scale.position, told.heading * estimate.scale.heading)


@kernel
def kept_noise(estimate: NoiseEstimate) -> NoiseEstimate:
    """What stays known of the noise when the frames before are forgotten."""
    return estimate._replace(
        frames=estimate.frames._replace(held=0),
        strides=estimate.strides._replace(held=0),
        long_strides=estimate.long_strides._replace(held=0),
        gated=False,
    )


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
    estimate, followed = estimate._replace(gated=gated), 0.0
    if estimate.frames.held > 0:
        since_ns = moment.capture_ns - estimate.frames.a.capture_ns
        if since_ns <= 0:
            return estimate
        followed = min(1.0, since_ns * _NS / _FOLLOWED)
        if since_ns > LONGEST_NS:
            estimate = kept_noise(estimate)._replace(gated=gated)
    frames, strides = estimate.frames, estimate.strides
    by_frame = _differenced(estimate.by_frame, frames, strides, moment, learning, LONGEST_NS)
    estimate = estimate._replace(
        by_frame=by_frame,
        by_stride=_or_anew(estimate.by_stride, estimate.by_frame, by_frame),
        by_long_stride=_or_anew(estimate.by_long_stride, estimate.by_frame, by_frame),
        frames=_pushed(frames, moment),
    )
    if _is_due(strides, moment, STRIDE_NS):
        estimate = _strode(estimate, moment, learning)
    by_stride, by_long_stride = estimate.by_stride, estimate.by_long_stride
    position = certain_scale(by_frame.position, by_stride.position)
    heading = certain_scale(by_frame.heading, by_stride.heading)
    position = max(position, shaken_scale(by_stride.position, by_long_stride.position))
    heading = max(heading, shaken_scale(by_stride.heading, by_long_stride.heading))
    scale, basis = estimate.scale._replace(position=position, heading=heading), estimate.basis
    return estimate._replace(scale=scale, basis=basis + followed * (position - basis))


@kernel(inline=False)
def _strode(estimate: NoiseEstimate, moment: Moment, learning: NoiseLearning) -> NoiseEstimate:
    """Estimate with the differences over strides that end with a frame, long ones every other time."""
    strides, long_strides, by_long = estimate.strides, estimate.long_strides, estimate.by_long_stride
    by_stride = _differenced(estimate.by_stride, strides, strides, moment, learning, LONGEST_NS)
    if _is_due(long_strides, moment, _LONG_STRIDES * STRIDE_NS):
        longest_ns = _LONG_STRIDES * LONGEST_NS
        by_long = _differenced(by_long, long_strides, strides, moment, learning, longest_ns)
        long_strides = _pushed(long_strides, moment)
    return estimate._replace(
        by_stride=by_stride,
        by_long_stride=by_long,
        strides=_pushed(strides, moment),
        long_strides=long_strides,
    )


@kernel
def _or_anew(levels: Levels, before: Levels, after: Levels) -> Levels:
    """Levels of strides, anew where those of frames show that the noise has become another one."""
    position = level_or_anew(levels.position, before.position, after.position)
    return Levels(position, level_or_anew(levels.heading, before.heading, after.heading))


@kernel
def _is_due(strides: Moments, moment: Moment, stride_ns: int) -> bool:
    return strides.held == 0 or moment.capture_ns - strides.a.capture_ns >= stride_ns


@kernel
def is_another(estimate: NoiseEstimate) -> bool:
    """Whether the noise of positions is another one than what was learned of the leader rests on."""
    scale, basis = estimate.scale.position, estimate.basis
    return scale > _ANOTHER * basis or basis > _ANOTHER * scale


@kernel(inline=False)
def noise_with_sighting(estimate: NoiseEstimate, point: TrackPoint) -> NoiseEstimate:
    """Estimate after a sighting that has led to the newest point of a track.

    Along the line of sight the innovation is one of range, across it one of bearing.
    """
    gated = point.verdict == GATED
    if (gated and not estimate.gated) or point.verdict == RESTARTED:
        return estimate._replace(gated=gated)
    x, y, b = point.measurement.x, point.measurement.y, point.belief
    rho = math.sqrt(x * x + y * y)
    if rho <= 0.0:
        return estimate
    c, s = x / rho, y / rho
    r, (dx, dy) = point.measurement.spread, (x - b.x, y - b.y)
    along = _innovation(
        c * dx + s * dy,
        c * c * r.xx + 2.0 * c * s * r.xy + s * s * r.yy,
        c * c * b.x_x + 2.0 * c * s * b.x_y + s * s * b.y_y,
        gated,
    )
    across = _innovation(
        c * dy - s * dx,
        s * s * r.xx - 2.0 * c * s * r.xy + c * c * r.yy,
        s * s * b.x_x - 2.0 * c * s * b.x_y + c * c * b.y_y,
        gated,
    )
    scale = estimate.scale
    sight = SightLevels(
        learned(estimate.sight.range, along, scale.range),
        learned(estimate.sight.bearing, across, scale.bearing),
    )
    scale = scale._replace(
        range=certain_scale(sight.range, sight.range), bearing=certain_scale(sight.bearing, sight.bearing)
    )
    return estimate._replace(scale=scale, sight=sight, gated=gated)


@kernel
def _innovation(residual: float, noise: float, spread: float, gated: bool) -> Innovation:
    """Innovation of one coordinate, out of what is left of it after the update.

    noise: variance that it was taken with. spread: variance after the update, or before it if there was none.
    With the gain K what is left is 1 - K of the innovation, and the variance K of the noise.
    """
    if gated:
        return Innovation(residual * residual / noise, spread / noise)
    left = max(1.0 - spread / noise, _LEAST_LEFT)
    return Innovation(residual * residual / (noise * left * left), 1.0 / left - 1.0)


@kernel
def _pushed(moments: Moments, moment: Moment) -> Moments:
    return Moments(min(3, moments.held + 1), moment, moments.a, moments.b)


@kernel
def _differenced(
    levels: Levels,
    before: Moments,
    long_before: Moments,
    moment: Moment,
    learning: NoiseLearning,
    longest_ns: int,
) -> Levels:
    """Levels with the differences of a frame and the three before it, of the bodies that move.

    Those of frames further apart than ``longest_ns`` tell nothing.
    """
    far = moment.capture_ns - before.c.capture_ns > longest_ns
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
        position = learned(position, Innovation(x * x / variance, 0.0), 1.0)
        position = learned(position, Innovation(y * y / variance, 0.0), 1.0)
    here, was = new.follower, since.seen.follower
    way = _distance(here.x - was.x, here.y - was.y) + _HALF_TRACK * abs(wrapped(here.theta - was.theta))
    repeats = (here.x == a.follower.x and here.y == a.follower.y) or (
        a.follower.x == b.follower.x and a.follower.y == b.follower.y
    )
    if way > learning.moving * dt and not repeats:
        x = w.new * here.x + w.a * a.follower.x + w.b * b.follower.x + w.c * c.follower.x
        y = w.new * here.y + w.a * a.follower.y + w.b * b.follower.y + w.c * c.follower.y
        position = learned(position, Innovation(x * x / variance, 0.0), 1.0)
        position = learned(position, Innovation(y * y / variance, 0.0), 1.0)
        turn = _heading_difference(w, here.theta, before)
        square = turn * turn / (learning.told.heading * learning.told.heading)
        heading = learned(heading, Innovation(square, 0.0), 1.0)
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
