"""How much measurements scatter, from a whole recording: poses by themselves, odometry against poses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.calibration.smoothed_track import smoothed_motion
from estimation.consistency.noise_estimate import LONGEST_NS, STRIDE_NS
from estimation.consistency.noise_level import CLIP, CLIPPED_MEAN
from formation.angles import FloatArray

LEAST_DIFFERENCES = 100
"""Fewer than these tell no deviation to a tenth."""

_NS = 1e-9
_POINTS = 4
_ROUNDS = 60


def pose_scatter(
    stamps_ns: NDArray[np.int64], values: FloatArray, places: FloatArray, least_speed: float
) -> float | None:
    """Standard deviation of the noise of each of the columns ``values`` (n, k) of a track; None if unknown.

    Headings must be unwrapped. Third differences tell it of neighbouring frames, and of frames 100 ms apart
    for the part that neighbours share; the larger counts. Only where the body moves by its ``places`` (n, 2)
    [m] faster than ``least_speed`` [m/s]: who stands is quieter.
    """
    found = [
        sd
        for stride_ns in (0, STRIDE_NS)
        if (sd := _scatter(stamps_ns, values, places, least_speed, stride_ns)) is not None
    ]
    return max(found) if found else None


def _scatter(
    stamps_ns: NDArray[np.int64], values: FloatArray, places: FloatArray, least_speed: float, stride_ns: int
) -> float | None:
    rows = _windows(stamps_ns, stride_ns)
    first, last = rows[:, -1], rows[:, 0]
    span = (stamps_ns[last] - stamps_ns[first]) * _NS
    wide = _windows(stamps_ns, STRIDE_NS) if stride_ns == 0 else rows
    moves = np.zeros(len(stamps_ns), dtype=np.bool_)
    ways = np.linalg.norm(places[wide[:, 0]] - places[wide[:, -1]], axis=1)
    moves[wide[:, 0]] = ways > least_speed * (stamps_ns[wide[:, 0]] - stamps_ns[wide[:, -1]]) * _NS
    distinct = np.all(np.any(np.diff(values[rows], axis=1) != 0.0, axis=2), axis=1)
    kept = moves[last] & (span <= LONGEST_NS * _NS) & distinct
    rows = rows[kept]
    if len(rows) < LEAST_DIFFERENCES:
        return None
    times = (stamps_ns[rows] - stamps_ns[rows[:, :1]]).astype(np.float64) * _NS
    differences = np.einsum("ij,ijk->ik", third_differences(times), values[rows])
    return robust_deviation(differences.ravel())


def _windows(stamps_ns: NDArray[np.int64], stride_ns: int) -> NDArray[np.int64]:
    """Rows (m, 4), newest first, that are neighbours or at least a stride apart."""
    newest = np.arange(len(stamps_ns))
    columns = [newest]
    for _ in range(_POINTS - 1):
        before = np.searchsorted(stamps_ns, stamps_ns[columns[-1]] - max(stride_ns, 1), side="right") - 1
        columns.append(np.where(columns[-1] < 0, -1, before))
    rows = np.column_stack(columns)
    return np.asarray(rows[np.all(rows >= 0, axis=1)], dtype=np.int64)


def third_differences(times: FloatArray) -> FloatArray:
    """Weights (m, 4) of third divided differences at such times (m, 4), with unit gain for white noise."""
    weights = np.ones_like(times)
    for one in range(_POINTS):
        for other in range(_POINTS):
            if other != one:
                weights[:, one] /= times[:, one] - times[:, other]
    unit: FloatArray = weights / np.linalg.norm(weights, axis=1, keepdims=True)
    return unit


def robust_deviation(values: FloatArray) -> float:
    """Standard deviation of what is normal for the most part; no value counts for more than 1.5 of it."""
    variance = float(np.median(values * values)) / 0.4549
    for _ in range(_ROUNDS):
        if variance == 0.0:
            break
        variance *= float(np.mean(np.minimum(values * values / variance, CLIP))) / CLIPPED_MEAN
    return float(np.sqrt(variance))


def odometry_scatter(
    stamps_ns: NDArray[np.int64], poses: FloatArray, odometry_ns: NDArray[np.int64], motions: FloatArray
) -> tuple[float, float] | None:
    """Standard deviations of v2 [m/s] and u2 [rad/s] of odometry against a smoothed track; None if unknown.

    Whatever makes the two differ counts: scale and slip too. ``odometry_ns``: when the motion was.
    """
    if len(stamps_ns) < _POINTS or len(odometry_ns) == 0:
        return None
    off = motions - smoothed_motion(stamps_ns, poses, odometry_ns).motion
    off = off[np.all(np.isfinite(off), axis=1)]
    if len(off) < LEAST_DIFFERENCES:
        return None
    return robust_deviation(off[:, 0]), robust_deviation(off[:, 1])
