"""How odometry relates to the motion that mocap saw: how much later the robot moves, and by what share of it.

Both are averaged over the same windows, odometry as the integral of its samples, mocap as the way between two
poses, so that no filter comes between them. Motion is then taken for scale times odometry ``delay`` earlier.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.models.motion import Matrix, Vector
from formation.angles import wrap

WINDOW = 0.5
"""Length [s] over which motion is averaged: mocap noise is then far below what a driven robot does."""

LONGEST_DELAY = 1.0
"""Delays of either sign up to this [s] are tried."""

_STEP = 0.1  # between windows [s]; they overlap, so that only one in WINDOW / _STEP counts as independent
_GRID = 0.02  # of delays [s]
_APART = 0.3  # delays further than this [s] from the best one must be worse by _DROP
_DROP = 4.5  # of log-likelihood: three standard deviations
_LARGEST_SD_SCALE = 0.2
_FEWEST = 10  # independent windows
_LONGEST_GAP = 0.2  # between two poses or two samples of odometry for a window to count [s]


@dataclass(frozen=True, slots=True)
class Known:
    """A value with its standard deviation."""

    value: float
    sd: float


@dataclass(frozen=True, slots=True)
class Alignment:
    """``motion(t) = scale * odometry(t - delay)``; None for what the span does not let know.

    ``delay`` [s] is positive for odometry that runs ahead of the robot, as commands do.
    """

    delay: Known | None
    scale_v: Known | None
    scale_u: Known | None


UNKNOWN = Alignment(None, None, None)


def align_odometry(times: Vector, poses: Matrix, odometry_times: Vector, odometry: Matrix) -> Alignment:
    """Delay and scales of odometry (m, 2) v [m/s], u [rad/s] against a track (n, 3) x, y [m], theta [rad].

    Times (n,), (m,) [s] increase and have one zero. Every delay of a grid gets its scales by least squares;
    the profile likelihood of all delays, n/2 log of the residuals of both channels, gives the best and, by
    its curvature, the standard deviation. A delay is unknown if another one far from it does about as well,
    as where the robot hardly changes its motion; a scale is unknown if its standard deviation is above 0.2.
    """
    if len(times) < 2 or len(odometry_times) < 2:
        return UNKNOWN
    half, reach = 0.5 * WINDOW, 0.5 * WINDOW + LONGEST_DELAY
    first = max(times[0] + half, odometry_times[0] + reach)
    last = min(times[-1] - half, odometry_times[-1] - reach)
    centres = np.arange(first, last, _STEP)
    centres = centres[_covered(times, centres, half) & _covered(odometry_times, centres, reach)]
    independent = len(centres) * _STEP / WINDOW
    if independent < _FEWEST:
        return UNKNOWN
    seen = _mean_motion(times, poses, centres)
    delays = np.arange(-LONGEST_DELAY, LONGEST_DELAY + 0.5 * _GRID, _GRID)
    ways = _ways(odometry_times, odometry)
    rests = np.array([_fit(seen, _mean_odometry(odometry_times, ways, centres - d))[1] for d in delays])
    likelihood = -0.5 * independent * np.log(np.maximum(rests, 1e-12)).sum(axis=1)
    best = int(np.argmax(likelihood))
    delay = _peak(delays, likelihood, best)
    by_odometry = _mean_odometry(odometry_times, ways, centres - (delay.value if delay else delays[best]))
    scales, rest = _fit(seen, by_odometry)
    power = np.mean(by_odometry**2, axis=0)
    sds = np.sqrt(rest / np.maximum(power, 1e-12) / independent)
    scale_v, scale_u = (
        Known(scale, sd) if sd < _LARGEST_SD_SCALE else None
        for scale, sd in zip(scales.tolist(), sds.tolist(), strict=True)
    )
    return Alignment(delay, scale_v, scale_u)


def _fit(seen: Matrix, by_odometry: Matrix) -> tuple[Vector, Vector]:
    """Scales (2,) through the origin by least squares, and the mean squares (2,) of what they leave."""
    scales = np.sum(by_odometry * seen, axis=0) / np.maximum(np.sum(by_odometry**2, axis=0), 1e-12)
    return scales, np.mean((seen - scales * by_odometry) ** 2, axis=0)


def _peak(delays: Vector, likelihood: Vector, best: int) -> Known | None:
    """Vertex of the parabola through the best delay and its neighbours, if it stands alone."""
    if not 0 < best < len(delays) - 1:
        return None
    apart = np.abs(delays - delays[best]) > _APART
    if likelihood[best] - np.max(likelihood[apart]) < _DROP:
        return None
    before, top, after = likelihood[best - 1 : best + 2].tolist()
    curvature = (before - 2.0 * top + after) / _GRID**2
    if curvature >= 0.0:
        return None
    shift = 0.5 * (before - after) / (before - 2.0 * top + after) * _GRID
    return Known(float(delays[best]) + shift, 1.0 / math.sqrt(-curvature))


def _mean_motion(times: Vector, poses: Matrix, centres: Vector) -> Matrix:
    """Mean v and u (k, 2) over the windows around the centres, from the poses at their ends."""
    turned = np.unwrap(poses[:, 2])
    ends = [
        np.column_stack([np.interp(centres + side, times, column) for column in (*poses[:, :2].T, turned)])
        for side in (-0.5 * WINDOW, 0.5 * WINDOW)
    ]
    way = ends[1] - ends[0]
    middle = ends[0][:, 2] + 0.5 * way[:, 2]
    chord = way[:, 0] * np.cos(middle) + way[:, 1] * np.sin(middle)
    return np.column_stack([chord / np.sinc(wrap(way[:, 2]) / (2.0 * np.pi)), way[:, 2]]) / WINDOW


def _ways(times: Vector, odometry: Matrix) -> list[Vector]:
    """What odometry, linear between samples, adds up to in v and in u since the first one."""
    steps = 0.5 * (odometry[1:] + odometry[:-1]) * np.diff(times)[:, np.newaxis]
    return [np.concatenate([[0.0], np.cumsum(column)]) for column in steps.T]


def _mean_odometry(times: Vector, ways: list[Vector], centres: Vector) -> Matrix:
    """Mean v and u (k, 2) of odometry that adds up to ``ways``, over the windows around the centres."""
    begins, ends = (centres + side for side in (-0.5 * WINDOW, 0.5 * WINDOW))
    sums = [np.interp(ends, times, way) - np.interp(begins, times, way) for way in ways]
    return np.column_stack(sums) / WINDOW


def _covered(times: Vector, centres: Vector, reach: float) -> NDArray[np.bool_]:
    """Which centres have no gap of the times within reach."""
    gaps = np.flatnonzero(np.diff(times) > _LONGEST_GAP)
    covered = np.ones(len(centres), dtype=np.bool_)
    for gap in gaps:
        covered &= (centres + reach < times[gap]) | (centres - reach > times[gap + 1])
    return covered
