"""A variance over the one that is told, learned from squares one by one, and what of it is certain."""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.kernel import kernel

LEAST_SCALE, MOST_SCALE = 0.1, 30.0
"""Within which the noise is looked for, in multiples of what is told."""

CLIP = 2.25  # variances that a square counts for at the most: outliers and speed steps are few
CLIPPED_MEAN = 0.7785  # of the square of a standard normal that is cut off there
_SLOPE = (
    0.614  # of that mean, relatively, by the variance: steps are larger by this, so that errors fade as 1/n
)
_BEGIN = 6.0  # differences that what is told counts as
_QUICK, _SLOW = 100.0, 1600.0  # differences that the two means reach back
_CHANGED = 2.2  # factor between the two variances, some four deviations, by which the noise has changed
_ANEW = 50.0  # differences that it then counts as
_MUCH = 1.5  # from which on a level of strides would be noticed
_VARIANCE = 6.0  # of a mean over n, times n: 2 of squares, 2.3 as differences overlap, 1.3 as they are cut
_SURE = 2.5  # standard deviations by which the noise must differ from what is told


class Level(NamedTuple):
    """A variance over the one that is told: by many differences, by the last few, and how many they are."""

    ratio: float
    quick: float
    weight: float


class Innovation(NamedTuple):
    """Square of an innovation and variance of the prediction, both over the noise's variance as used."""

    square: float
    predicted: float


AS_TOLD = Level(1.0, 1.0, _BEGIN)


@kernel
def learned(level: Level, news: Innovation, scale: float) -> Level:
    """Level with one more square, of noise that was taken to have a scale."""
    variance = scale * scale
    square, predicted = variance * news.square, variance * news.predicted
    weight = min(level.weight + 1.0, _SLOW)
    ratio = _mean_with(level.ratio, square, predicted, weight)
    quick = _mean_with(level.quick, square, predicted, min(weight, _QUICK))
    if weight > _QUICK and (quick > _CHANGED * ratio or ratio > _CHANGED * quick):
        return Level(quick, quick, _ANEW)
    return Level(ratio, quick, weight)


@kernel
def level_or_anew(by_stride: Level, before: Level, after: Level) -> Level:
    """Level of strides, cut down where it is made of noise of frames that has ended; they tell so far sooner.

    What shakes bodies besides has not ended with that, nor is it known to be less than was told.
    """
    ended = after.weight < before.weight and by_stride.ratio < _CHANGED * before.ratio
    most = max(1.0, after.ratio)
    if not ended or by_stride.ratio < _MUCH:
        return by_stride
    return Level(min(by_stride.ratio, most), min(by_stride.quick, most), min(by_stride.weight, _BEGIN))


@kernel
def _mean_with(mean: float, square: float, predicted: float, weight: float) -> float:
    """Mean of squares, none of which counts for more than the clip, with one more of them.

    predicted: how much of the square the prediction accounts for; the less of it is noise, the less it tells.
    """
    expected = mean + predicted
    news = (min(square / expected, CLIP) / CLIPPED_MEAN - 1.0) * mean / expected
    most, least = MOST_SCALE * MOST_SCALE, LEAST_SCALE * LEAST_SCALE
    return min(most, max(least, mean * (1.0 + news / (_SLOPE * weight))))


@kernel
def certain_scale(by_frame: Level, by_stride: Level) -> float:
    """Scale of standard deviations: as told where the noise may well be, as found where it surely is not."""
    strided = by_stride.ratio / _unsure(by_stride)
    ratio, unsure = max(by_frame.ratio, min(1.0, strided)), _unsure(by_frame)
    if ratio < 1.0:
        return 1.0 / math.sqrt(_certain(1.0 / ratio, unsure))
    return math.sqrt(_certain(ratio, unsure))


@kernel
def shaken_scale(by_stride: Level, by_long_stride: Level) -> float:
    """Scale of what shakes bodies over a stride, if it surely exceeds what is told, else 0.

    Over twice the stride a motion leaves four times the variance at the least, for a speed that changes at
    once, and 64 times for one that changes evenly. So a quarter of that is all that motion can be of this,
    and where half of it leaves too little it may be motion.
    """
    unsure = _unsure(by_long_stride)
    if by_stride.ratio - 0.5 * by_long_stride.ratio < unsure:
        return 0.0
    return math.sqrt(_certain(by_stride.ratio - 0.25 * by_long_stride.ratio, unsure))


@kernel
def _unsure(level: Level) -> float:
    """Factor within which a level may be off."""
    return 1.0 + _SURE * math.sqrt(_VARIANCE / level.weight)


@kernel
def _certain(ratio: float, unsure: float) -> float:
    """How much of a ratio above one is certain: nothing within the factor, all of it beyond its square."""
    if ratio <= unsure:
        return 1.0
    beyond = ratio / unsure
    return ratio if beyond > unsure else beyond * beyond
