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
from hil.judge.true_shapes import (
    ALPHA1,
    FOLLOWER_THETA,
    FOLLOWER_X,
    FOLLOWER_Y,
    LEADER_THETA,
    LEADER_X,
    LEADER_Y,
    RHO,
)
from hil.wire.message_types import Truth
from hil.wire.messages import to_ns

LONGEST_GAP_NS = 500_000_000
"""Truths that are further apart than this say nothing of what lies between them."""

Stamps = NDArray[np.int64]

_POSES = ("leader_x", "leader_y", "leader_theta", "follower_x", "follower_y", "follower_theta")
_RECORDED = attrgetter(*_POSES, "v1", "u1", "v2", "u2")
_RECORDED_SIZE, _SHAPE_SIZE = 10, 5
_HEADINGS = [LEADER_THETA, FOLLOWER_THETA]


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


def run_of(moments_ns: Stamps, wanted_ns: Stamps) -> slice | None:
    """Where wanted moments lie among increasing ones, if there one after the other and all of them.

    That is so where nothing was lost, and spares a search for each of them.

    >>> run_of(np.array([3, 5, 8, 9]), np.array([5, 8]))
    slice(1, 3, None)
    """
    if not len(wanted_ns):
        return None
    first = int(np.searchsorted(moments_ns, wanted_ns[0]))
    place = slice(first, first + len(wanted_ns))
    return place if np.array_equal(moments_ns[place], wanted_ns) else None


def _states(moments_ns: Stamps, rows: FloatArray) -> TrueStates:
    return TrueStates(moments_ns, rows[:, 0:3], rows[:, 3:6], *rows[:, 6:].T)


def _with_shape(recorded: FloatArray) -> FloatArray:
    """Rows of both poses and both motions with the shape and its rates behind: Eqs. (2) and (3) of the paper.

    NaN where both robots are in one place: there is no shape. A leader that drives backwards is turned round,
    as its alpha1 is that of its direction of travel.
    """
    from hil.judge.entries import fill_shapes  # compiles, which who only needs the records is spared

    # Column by column in memory: everything that follows works on columns.
    columns = np.empty((_RECORDED_SIZE + _SHAPE_SIZE, len(recorded)))
    columns[:_RECORDED_SIZE] = recorded.T
    dx = columns[FOLLOWER_X] - columns[LEADER_X]
    dy = columns[FOLLOWER_Y] - columns[LEADER_Y]
    np.hypot(dx, dy, out=columns[RHO])
    columns[RHO, ~(columns[RHO] > 0.0)] = math.nan
    np.arctan2(dy, dx, out=columns[ALPHA1])
    fill_shapes(columns)
    return columns.T
