"""The truth of a run as arrays, at the moments of its messages and in between."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray, wrap
from formation.mount import Mount, is_aligned
from hil.wire.message_types import Truth
from hil.wire.messages import to_ns

LONGEST_GAP_NS = 500_000_000
"""Truths that are further apart than this say nothing of what lies between them."""

Stamps = NDArray[np.int64]

_POSES = ("leader_x", "leader_y", "leader_theta", "follower_x", "follower_y", "follower_theta")
_RECORDED = attrgetter(*_POSES, "v1", "u1", "v2", "u2")
_RECORDED_SIZE, _SHAPE_SIZE = 10, 5
_HEADINGS, _V1 = [2, 5], 6


@dataclass(frozen=True, slots=True, eq=False)
class TrueStates:
    """The truth at n moments: arrays of shape (n,), the poses ``leader`` and ``follower`` (n, 3) x, y, theta.

    NaN where something is not known. Moments increase. Shape and rates follow from poses and motions.
    """

    capture_ns: Stamps
    leader: FloatArray
    follower: FloatArray
    v1: FloatArray
    u1: FloatArray
    v2: FloatArray
    u2: FloatArray
    rho: FloatArray
    alpha1: FloatArray
    alpha2: FloatArray
    rho_dot: FloatArray
    alpha2_dot: FloatArray

    @staticmethod
    def of(truth: Sequence[Truth]) -> TrueStates:
        """Columns of messages in the order of their stamps; of several with one stamp the first counts."""
        recorded = np.array(list(map(_RECORDED, truth)), dtype=np.float64).reshape(-1, _RECORDED_SIZE)
        stamps = np.array([to_ns(each.header.stamp) for each in truth], dtype=np.int64)
        moments_ns, first = np.unique(stamps, return_index=True)
        return _states(moments_ns, _with_shape(recorded[first]))

    @staticmethod
    def of_rows(rows: NDArray[np.void]) -> TrueStates:
        """Columns of rows of :class:`hil.replay.kept_rows.TruthRow`, the same way."""
        moments_ns, first = np.unique(rows["capture_ns"], return_index=True)
        recorded = np.column_stack([rows[name][first] for name in (*_POSES, "v1", "u1", "v2", "u2")])
        return _states(moments_ns, _with_shape(recorded))

    @staticmethod
    def along(moments_ns: Stamps, recorded: FloatArray) -> TrueStates:
        """Columns of increasing moments: rows (n, 10) of both poses, v1, u1, v2, u2."""
        return _states(moments_ns, _with_shape(recorded))

    def at(self, moments_ns: Stamps) -> TrueStates:
        """The truth at other moments: exact where there is one, else linear between its neighbours.

        Headings turn the short way round the circle. Unknown outside, and between neighbours that are more
        than :data:`LONGEST_GAP_NS` apart.
        """
        known = self._rows()
        rows = np.full((len(moments_ns), _RECORDED_SIZE + _SHAPE_SIZE), math.nan)
        if len(known):
            after = np.searchsorted(self.capture_ns, moments_ns)
            here, before = np.minimum(after, len(known) - 1), np.maximum(after - 1, 0)
            exact = self.capture_ns[here] == moments_ns
            rows[exact] = known[here[exact]]
            gap_ns = self.capture_ns[here] - self.capture_ns[before]
            between = ~exact & (after > 0) & (after < len(known)) & (gap_ns <= LONGEST_GAP_NS)
            share = (moments_ns - self.capture_ns[before])[between] / gap_ns[between]
            first, second = known[before[between], :_RECORDED_SIZE], known[here[between], :_RECORDED_SIZE]
            change = second - first
            change[:, _HEADINGS] = wrap(change[:, _HEADINGS])
            rows[between] = _with_shape(first + share[:, np.newaxis] * change)
        return _states(moments_ns, rows)

    def of_robots(self, leader: Mount, follower: Mount) -> TrueStates:
        """The truth of the robots, if this is of bodies that sit on them so; unchanged where none is mounted.

        A body's speed along its own axis is cos(yaw) (v - u y) + sin(yaw) u x, which tells the robot's v.
        """
        if is_aligned(leader) and is_aligned(follower):
            return self
        rows = self._rows()[:, :_RECORDED_SIZE].copy()
        for first, (v, u), mount in ((0, (6, 7), leader), (3, (8, 9), follower)):
            theta = rows[:, first + 2] - mount.yaw
            cos, sin = np.cos(theta), np.sin(theta)
            rows[:, first] -= cos * mount.x - sin * mount.y
            rows[:, first + 1] -= sin * mount.x + cos * mount.y
            rows[:, first + 2] = theta
            aside = math.sin(mount.yaw) * rows[:, u] * mount.x
            rows[:, v] = (rows[:, v] - aside) / math.cos(mount.yaw) + rows[:, u] * mount.y
        return _states(self.capture_ns, _with_shape(rows))

    def _rows(self) -> FloatArray:
        motions = (self.v1, self.u1, self.v2, self.u2)
        shapes = (self.rho, self.alpha1, self.alpha2, self.rho_dot, self.alpha2_dot)
        return np.column_stack([self.leader, self.follower, *motions, *shapes])


def _states(moments_ns: Stamps, rows: FloatArray) -> TrueStates:
    return TrueStates(moments_ns, rows[:, 0:3], rows[:, 3:6], *rows[:, 6:].T)


def _with_shape(recorded: FloatArray) -> FloatArray:
    """Rows of both poses and both motions with the shape and its rates behind: Eqs. (2) and (3) of the paper.

    NaN where both robots are in one place: there is no shape. A leader that drives backwards is turned round,
    as its alpha1 is that of its direction of travel.
    """
    # Column by column in memory: everything that follows works on columns.
    rows = np.empty((_RECORDED_SIZE + _SHAPE_SIZE, len(recorded))).T
    rows[:, :_RECORDED_SIZE] = recorded
    backwards = rows[:, _V1] < 0.0
    if np.any(backwards):
        rows[backwards, _HEADINGS[0]] += math.pi
        rows[backwards, _V1] *= -1.0
    for heading in _HEADINGS:
        rows[:, heading] = wrap(rows[:, heading])
    lx, ly, ltheta, fx, fy, ftheta, v1, _, v2, u2 = rows.T[:_RECORDED_SIZE]
    dx, dy = fx - lx, fy - ly
    rho, line = np.hypot(dx, dy), np.arctan2(dy, dx)
    rho = np.where(rho > 0.0, rho, math.nan)
    apart = 0.0 * rho
    alpha1, alpha2 = wrap(line - ltheta) + apart, wrap(line + math.pi - ftheta) + apart
    turning = (v1 * np.sin(alpha1) + v2 * np.sin(alpha2)) / rho
    rho_dot = -v1 * np.cos(alpha1) - v2 * np.cos(alpha2)
    for column, values in enumerate((rho, alpha1, alpha2, rho_dot, turning - u2), _RECORDED_SIZE):
        rows[:, column] = values
    return rows
