"""Offsets of a range and bearing sensor, found where the true range and bearing are known.

A scanner measures to the surface of a robot and not to its centre, and is mounted with a twist that nobody
measures. Both hardly change while a robot drives, so that a short span watched by mocap gives them for good.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.models.motion import Matrix, Vector
from formation.angles import wrap

FEWEST = 20
"""Sightings that an offset rests on at least; below it one wrong one in ten could not be told."""

_TUNING = 4.685  # of Tukey's biweight: 95 % as good as the mean where errors are Gaussian
_ROUNDS = 50
_BLOCKS = 8


class TooFewSightingsError(ValueError):
    """A span from which no offset can be told; the message says what it has."""


@dataclass(frozen=True, slots=True)
class Offset:
    """A sensor's mean error, measured minus true, its standard deviation, and the spread of single errors."""

    value: float
    sd: float
    spread: float


@dataclass(frozen=True, slots=True)
class SensorBias:
    """Offsets of range [m] and bearing [rad]; ``outliers`` of the ``samples`` were left out of them."""

    range: Offset
    bearing: Offset
    samples: int
    outliers: int


def find_sensor_bias(seen: Matrix, true: Matrix) -> SensorBias:
    """Offsets of sightings (n, 2) of range [m] and bearing [rad], in order of time, against the truth (n, 2).

    Tukey's biweight, started at the median and scaled by the median absolute deviation, so that up to nearly
    half of the sightings may be of something else. Rows that are not finite in both are passed over. An
    error that wanders, as a late bearing does in turns, makes neighbours err alike: the standard deviation is
    the larger one of what independent errors would leave and what means over eighths of the span show.
    Raises :class:`TooFewSightingsError` if fewer than :data:`FEWEST` sightings are good in both, or fewer
    than half of all.
    """
    errors = seen - true
    errors = errors[np.isfinite(errors).all(axis=1)]
    if len(errors) < FEWEST:
        raise TooFewSightingsError(
            f"{len(errors)} sightings have a true pose beside them, expected {FEWEST} or more"
        )
    # Bearings are averaged around one of them, so that they may lie on both sides of the cut at pi.
    around = _middle_angle(errors[:, 1])
    errors = np.column_stack([errors[:, 0], wrap(errors[:, 1] - around)])
    (centre_r, spread_r, good_r), (centre_b, spread_b, good_b) = map(_biweight, errors.T)
    good = good_r & good_b
    if np.count_nonzero(good) < max(FEWEST, 0.5 * len(errors)):
        raise TooFewSightingsError(
            f"{np.count_nonzero(good)} of {len(errors)} sightings agree with each other, "
            f"expected at least {max(FEWEST, math.ceil(0.5 * len(errors)))}"
        )
    kept = errors[good]
    return SensorBias(
        Offset(centre_r, _sd_of_mean(kept[:, 0]), spread_r),
        Offset(float(wrap(centre_b + around)), _sd_of_mean(kept[:, 1]), spread_b),
        len(errors),
        len(errors) - len(kept),
    )


def _middle_angle(angles: Vector) -> float:
    """The one of the angles that is least far from all others."""
    apart = np.abs(wrap(angles[:, None] - angles[None, :])).sum(axis=0)
    return float(angles[np.argmin(apart)])


def _biweight(values: Vector) -> tuple[float, float, NDArray[np.bool_]]:
    """Centre and spread (standard deviation) of the bulk of some values, and which belong to it."""
    centre = float(np.median(values))
    spread = 1.4826 * float(np.median(np.abs(values - centre)))
    reach = max(_TUNING * spread, 1e-9 * (1.0 + abs(centre)))
    for _ in range(_ROUNDS):
        weights = np.square(np.maximum(0.0, 1.0 - np.square((values - centre) / reach)))
        before, centre = centre, float(weights @ values / weights.sum())
        if abs(centre - before) <= 1e-9 * reach:
            break
    return centre, spread, np.abs(values - centre) < reach


def _sd_of_mean(values: Vector) -> float:
    alone = float(values.std(ddof=1)) / math.sqrt(len(values))
    means = [float(block.mean()) for block in np.array_split(values, _BLOCKS)]
    return max(alone, float(np.std(means, ddof=1)) / math.sqrt(_BLOCKS))
