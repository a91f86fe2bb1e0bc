"""How far a body sits beside the middle of its robot's wheel axis: by how its speed differs from the wheels'.

A body at m_y to the left moves along the heading by ``v - u m_y``. Over windows of half a second, in which
the mocap track and odometry went their ways, the difference in proportion to the turn rate tells m_y, beside
wheels of another size than is said and what slips in turns, alike to the left and to the right. Sums of
windows are kept, older ones counting less.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimation.models.motion import Matrix, Vector
from estimation.own_motion.odometry_check import SCALE, WINDOW, WayEntry, mean_ways

_NS = 1e-9
_MEMORY = 0.99  # of what was known per window that turns
_TURNS = 0.05  # [rad/s] below which a window tells no place
_LIKELY = np.array([0.1, SCALE, SCALE])  # [m], [1], [m]: of place, scale and slip, as standard deviations
_FEWEST = 10  # windows before anything is said
_UNKNOWNS = 3
_ROUNDS = 3  # for what varies and what is found by it


class SidewaysCheck(NamedTuple):
    """Normal equations of place [m], scale and slip over windows; ``until_ns``: end of the newest one.

    ``normal`` (9,) by rows, ``tied`` (3,) and ``whole``: of the difference in speed. ``windows``: how many.
    """

    until_ns: int
    normal: tuple[float, ...]
    tied: tuple[float, ...]
    whole: float
    windows: float


NO_SIDEWAYS_CHECK = SidewaysCheck(0, (0.0,) * 9, (0.0,) * 3, 0.0, 0.0)


def with_ways(check: SidewaysCheck, entries: Sequence[WayEntry]) -> SidewaysCheck:
    """Check with all windows between entries, in their order, whose track is known and that are new to it."""
    since: WayEntry | None = None
    for entry in entries:
        if entry.stamp_ns < check.until_ns:
            continue
        if since is None:
            since = entry
        elif (entry.stamp_ns - since.stamp_ns) * _NS >= WINDOW:
            check = _with_window(check, since, entry)._replace(until_ns=entry.stamp_ns)
            since = entry
    return check


def _with_window(check: SidewaysCheck, before: WayEntry, after: WayEntry) -> SidewaysCheck:
    dt = (after.stamp_ns - before.stamp_ns) * _NS
    track, told = mean_ways(after.track, before.track, dt), mean_ways(after.twist, before.twist, dt)
    if abs(track.u) < _TURNS:
        return check
    row: Vector = np.array([-track.u, told.v, abs(track.u)])
    off = track.v - told.v
    normal = _MEMORY * np.array(check.normal) + np.outer(row, row).ravel()
    tied = _MEMORY * np.array(check.tied) + off * row
    return SidewaysCheck(
        check.until_ns,
        tuple(normal.tolist()),
        tuple(tied.tolist()),
        _MEMORY * check.whole + off * off,
        _MEMORY * check.windows + 1.0,
    )


def sideways_left(check: SidewaysCheck) -> tuple[float, float] | None:
    """Place [m] to the left of the wheel axis that is left over, and its deviation; None before it is known.

    The deviation is that of windows as they vary: what differs otherwise makes it the larger.
    """
    if check.windows < _FEWEST:
        return None
    normal: Matrix = np.array(check.normal).reshape(3, 3)
    tied = np.array(check.tied)
    found, variance = np.zeros(3), check.whole / check.windows
    prior = np.zeros((3, 3))
    for _ in range(_ROUNDS):
        prior = np.diag(max(variance, 1e-12) / np.square(_LIKELY))
        found = np.linalg.solve(normal + prior, tied)
        rest = check.whole - 2.0 * found @ tied + found @ normal @ found
        variance = max(0.0, float(rest)) / max(1.0, check.windows - _UNKNOWNS)
    covariance = variance * np.linalg.inv(normal + prior)
    return float(found[0]), math.sqrt(max(0.0, float(covariance[0, 0])))
