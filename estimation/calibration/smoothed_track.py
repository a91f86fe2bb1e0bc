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

_ONE_ANGLE = 0.98
"""Length of the mean of unit vectors whose angles scatter by 0.2 rad."""


@dataclass(frozen=True, slots=True)
class LocalFit:
    """A cubic over a window [s] around every step [s]; nothing is said of what lies in longer gaps [s]."""

    step: float
    window: float
    longest_gap: float


LOCAL_FIT = LocalFit(_STEP_S, WINDOW_S, LONGEST_GAP_S)


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
    grid, place, rate = _fitted(times, poses, LOCAL_FIT)
    if not len(grid):
        unknown = np.full((len(wanted), 5), np.nan)
        return SmoothedMotion(unknown[:, :3], unknown[:, 3:])
    forward = rate[:, 0] * np.cos(place[:, 2]) + rate[:, 1] * np.sin(place[:, 2])
    fitted = np.column_stack([place, forward, rate[:, 2]])
    rows = np.column_stack([np.interp(wanted, grid, column) for column in fitted.T])
    rows[_unknown(times, wanted, LOCAL_FIT)] = np.nan
    rows[:, 2] = wrap(rows[:, 2])
    return SmoothedMotion(rows[:, :3], rows[:, 3:])


def travelled_motion(
    stamps_ns: NDArray[np.int64], poses: FloatArray, moments_ns: NDArray[np.int64], slowest: float
) -> SmoothedMotion:
    """The same of a body that travels: its heading is that of its travel, wherever its own axes point.

    Who is faster than ``slowest`` [m/s] shows where it travels. Where that and the heading of the body, which
    may be NaN, keep one angle, heading and turn rate are the body's, by that angle; elsewhere they are the
    travel's, and held while it stands. Unknown of one that never travels. Backwards is who goes so on the
    mean of the window, too: before a start the cubic swings back by a tenth of the speed to come.
    """
    start_ns = int(stamps_ns[0])
    times, wanted = _seconds(stamps_ns, start_ns), _seconds(moments_ns, start_ns)
    has_heading = bool(np.all(np.isfinite(poses[:, 2])))
    told = poses if has_heading else np.column_stack([poses[:, :2], np.zeros(len(poses))])
    grid, place, rate = _fitted(times, told, LOCAL_FIT)
    mean = _mean_velocity(times, told, LOCAL_FIT)
    along = np.sum(mean * rate[:, :2], axis=1)
    moving = (np.hypot(*rate[:, :2].T) > slowest) & (np.hypot(*mean.T) > slowest) & (along > 0.0)
    if not np.any(moving):
        unknown = np.full((len(wanted), 5), np.nan)
        return SmoothedMotion(unknown[:, :3], unknown[:, 3:])
    heading, turn = _travelled_heading(place, rate, moving, has_heading=has_heading)
    forward, backwards = (
        each[:, 0] * np.cos(heading) + each[:, 1] * np.sin(heading) for each in (rate, -mean)
    )
    forward[(forward < 0.0) & (backwards < slowest)] = 0.0
    fitted = np.column_stack([place[:, :2], heading, forward, turn])
    rows = np.column_stack([np.interp(wanted, grid, column) for column in fitted.T])
    rows[_unknown(times, wanted, LOCAL_FIT)] = np.nan
    rows[:, 2] = wrap(rows[:, 2])
    return SmoothedMotion(rows[:, :3], rows[:, 3:])


def _travelled_heading(
    place: FloatArray, rate: FloatArray, moving: NDArray[np.bool_], *, has_heading: bool
) -> tuple[FloatArray, FloatArray]:
    """Heading, unwrapped, and turn rate along a fitted track."""
    travel = np.arctan2(rate[moving, 1], rate[moving, 0])
    aside = np.mean(np.exp(1j * (travel - place[moving, 2])))
    if has_heading and abs(aside) > _ONE_ANGLE:
        return place[:, 2] + np.angle(aside), rate[:, 2]
    rows = np.arange(len(place))
    heading = np.interp(rows, rows[moving], np.unwrap(travel))
    length = 2 * round(0.5 * WINDOW_S / _STEP_S) + 1
    return heading, savgol_filter(heading, length, DEGREE, deriv=1, delta=_STEP_S)


def fitted_rates(
    t: FloatArray, poses: FloatArray, fit: LocalFit
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times (m,) [s] on an even grid, the track fitted there, headings unwrapped, and its rates (m, 3).

    ``t`` (n,) [s], increasing; ``poses`` (n, 3). NaN where it is not known.
    """
    start = t[0] if len(t) else 0.0
    grid, place, rate = _fitted(t - start, poses, fit)
    unknown = _unknown(t - start, grid, fit)
    place[unknown], rate[unknown] = np.nan, np.nan
    return grid + start, place, rate


def _fitted(times: FloatArray, poses: FloatArray, fit: LocalFit) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Grid from 0 on, and the fit on it; all empty for a track that is too short."""
    grid, even, length = _even(times, poses, fit)
    if not len(grid):
        return grid, even, even
    place = savgol_filter(even, length, DEGREE, axis=0)
    rate = savgol_filter(even, length, DEGREE, deriv=1, delta=fit.step, axis=0)
    return grid, place, rate


def _mean_velocity(times: FloatArray, poses: FloatArray, fit: LocalFit) -> FloatArray:
    """Slopes (m, 2) of straight lines through the windows on the grid: no velocity counts negative there."""
    grid, even, length = _even(times, poses, fit)
    if not len(grid):
        return even[:, :2]
    return savgol_filter(even[:, :2], length, 1, deriv=1, delta=fit.step, axis=0)


def _even(times: FloatArray, poses: FloatArray, fit: LocalFit) -> tuple[FloatArray, FloatArray, int]:
    """Grid from 0 on, the track on it with headings unwrapped, and the window's length in steps.

    Grid and track are empty for a track that is shorter than the window.
    """
    grid = np.arange(0.0, times[-1] if len(times) else 0.0, fit.step)
    # A track without duration may come with steps of no length.
    length = 2 * round(0.5 * fit.window / fit.step) + 1 if len(grid) else 1
    if len(grid) < length:
        return np.empty(0), np.empty((0, 3)), length
    free = poses.copy()
    free[:, 2] = np.unwrap(poses[:, 2])
    return grid, np.column_stack([np.interp(grid, times, column) for column in free.T]), length


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


def _unknown(times: FloatArray, wanted: FloatArray, fit: LocalFit) -> NDArray[np.bool_]:
    """Which moments have an end or a gap of the track within half a window."""
    half = 0.5 * fit.window
    unknown: NDArray[np.bool_] = np.ones(len(wanted), np.bool_)
    if not len(times):
        return unknown
    unknown = (wanted < times[0] + half) | (wanted > times[-1] - half)
    for before in np.flatnonzero(np.diff(times) > fit.longest_gap):
        unknown |= (wanted > times[before] - half) & (wanted < times[before + 1] + half)
    return unknown
