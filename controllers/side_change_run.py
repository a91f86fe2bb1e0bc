"""A noise-free run in which the follower is ordered to change sides, with commands held between samples."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from controllers.station_keeper import StationKeeper
from formation.angles import FloatArray
from formation.closed_loop import Trajectory
from formation.leader import LeaderProgram
from formation.pose import Pose, advance
from formation.shape import shape_of
from formation.station import Side

LONGEST_STEP = 0.05
"""Commands are held for at most this long [s]."""


def run_with_changes(
    leader: Pose,
    follower: Pose,
    program: LeaderProgram,
    keeper: StationKeeper,
    orders: Sequence[tuple[float, Side]],
    times: FloatArray,
) -> Trajectory:
    """Trajectory at evenly spaced times [s], starting under the law at the station of the keeper's gains.

    ``orders``: when [s] the follower is told to go to which side, earliest first; the keeper takes or refuses
    them, and decides when a change begins, as it does for a robot. It sees the truth. Both robots drive exact
    arcs over steps of at most :data:`LONGEST_STEP`, the leader by its program at the middle of each.
    """
    dt = float(times[1] - times[0])
    substeps = max(1, round(np.ceil(dt / LONGEST_STEP - 1e-9)))
    held, waiting = dt / substeps, deque(orders)
    station = keeper.begin()
    rows: list[tuple[float, ...]] = []
    for t in times.tolist():
        for substep in range(substeps):
            now = t + substep * held
            shape, driven = shape_of(leader, follower), program(now + 0.5 * held)
            while waiting and now >= waiting[0][0]:
                station = keeper.order(station, waiting.popleft()[1]) or station
            station, wanted = keeper.drive(station, shape, driven, driven.u, held)
            motion, _ = keeper.limits.apply(wanted)
            if substep == 0:
                places = (leader.x, leader.y, leader.theta, follower.x, follower.y, follower.theta)
                at = (shape.rho, shape.alpha1, shape.alpha2, driven.v, driven.u, motion.v, motion.u)
                rows.append((*at, *places))
            leader = advance(leader, driven.v, driven.u, held)
            follower = advance(follower, motion.v, motion.u, held)
    table = np.array(rows)
    rho, alpha1, alpha2, v1, u1, v2, u2 = table[:, :7].T
    return Trajectory(times, rho, alpha1, alpha2, v1, u1, v2, u2, table[:, 7:10], table[:, 10:])
