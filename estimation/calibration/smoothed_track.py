"""True motion out of a recorded mocap track, smoothed offline with what came before and after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from formation.angles import FloatArray, wrap

WINDOW_S = 0.5
"""Length of the local fit: short against a robot's manoeuvre, long against a frame."""

DEGREE = 3
LONGEST_GAP_S = 0.1
"""Poses further apart than this say nothing of what lies between them."""

_STEP_S = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class SmoothedMotion:
    """Poses (n, 3) x [m], y [m], theta [rad], and motion (n, 2) v [m/s], u [rad/s]; NaN where unknown."""

    poses: FloatArray
    motion: FloatArray


def smoothed_motion(
    stamps_ns: NDArray[np.int64], poses: FloatArray, moments_ns: NDArray[np.int64]
) -> SmoothedMotion:
    """Fit a track (n,), (n, 3) by a cubic over a symmetric window of half a second around every moment.

    The track is put on an even grid of 10 ms for a Savitzky-Golay filter. The fit neither lags nor leads; its
    noise on v and u is that of a pose times about 3 per second at 60 poses a second. v is the velocity along
    the heading. Unknown within half a window of an end and of a gap.
    """
    start_ns = int(stamps_ns[0])
    times, wanted = _seconds(stamps_ns, start_ns), _seconds(moments_ns, start_ns)
    grid = np.arange(0.0, times[-1], _STEP_S)
    length = 2 * round(0.5 * WINDOW_S / _STEP_S) + 1
    if len(grid) < length:
        unknown = np.full((len(wanted), 5), np.nan)
        return SmoothedMotion(unknown[:, :3], unknown[:, 3:])
    free = poses.copy()
    free[:, 2] = np.unwrap(poses[:, 2])
    even = np.column_stack([np.interp(grid, times, column) for column in free.T])
    place = savgol_filter(even, length, DEGREE, axis=0)
    rate = savgol_filter(even, length, DEGREE, deriv=1, delta=_STEP_S, axis=0)
    forward = rate[:, 0] * np.cos(place[:, 2]) + rate[:, 1] * np.sin(place[:, 2])
    fitted = np.column_stack([place, forward, rate[:, 2]])
    rows = np.column_stack([np.interp(wanted, grid, column) for column in fitted.T])
    rows[_unknown(times, wanted)] = np.nan
    rows[:, 2] = wrap(rows[:, 2])
    return SmoothedMotion(rows[:, :3], rows[:, 3:])


def poses_at(stamps_ns: NDArray[np.int64], poses: FloatArray, moments_ns: NDArray[np.int64]) -> FloatArray:
    """Poses (m, 3) of a track at other moments, linear between neighbours; NaN outside and in gaps."""
    start_ns = int(stamps_ns[0])
    times, wanted = _seconds(stamps_ns, start_ns), _seconds(moments_ns, start_ns)
    free = poses.copy()
    free[:, 2] = np.unwrap(poses[:, 2])
    rows = np.column_stack([np.interp(wanted, times, column) for column in free.T])
    after = np.clip(np.searchsorted(stamps_ns, moments_ns), 1, max(len(stamps_ns) - 1, 1))
    gap = np.diff(times)[after - 1] > LONGEST_GAP_S if len(times) > 1 else np.ones(len(wanted), np.bool_)
    unknown = (wanted < times[0]) | (wanted > times[-1]) | (gap & ~np.isin(moments_ns, stamps_ns))
    rows[unknown] = np.nan
    rows[:, 2] = wrap(rows[:, 2])
    return rows


def _seconds(stamps_ns: NDArray[np.int64], start_ns: int) -> FloatArray:
    return (stamps_ns - start_ns).astype(np.float64) * 1e-9


def _unknown(times: FloatArray, wanted: FloatArray) -> NDArray[np.bool_]:
    """Which moments have an end or a gap of the track within half a window."""
    half = 0.5 * WINDOW_S
    unknown: NDArray[np.bool_] = (wanted < times[0] + half) | (wanted > times[-1] - half)
    for before in np.flatnonzero(np.diff(times) > LONGEST_GAP_S):
        unknown |= (wanted > times[before] - half) & (wanted < times[before + 1] + half)
    return unknown
