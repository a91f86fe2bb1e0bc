"""A noise-free run in which the follower is told to change sides, with commands held between samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from controllers.laws import Gains, Law
from controllers.limits import Limits
from controllers.side_change import change_step, change_to, kept
from formation.angles import FloatArray
from formation.closed_loop import Trajectory
from formation.leader import LeaderProgram
from formation.pose import Pose, advance
from formation.shape import shape_of

LONGEST_STEP = 0.05
"""Commands are held for at most this long [s]."""


def run_with_changes(
    leader: Pose,
    follower: Pose,
    program: LeaderProgram,
    law: Law,
    gains: Gains,
    limits: Limits,
    moments: Sequence[float],
    times: FloatArray,
    *,
    knows_turn: bool,
) -> Trajectory:
    """Trajectory at evenly spaced times [s], starting under the law at the station of the gains.

    At each of the ``moments`` [s] the follower is told to go to the other side of where it then is, or is on
    its way to. Both robots drive exact arcs over steps of at most :data:`LONGEST_STEP`, the leader by its
    program at the middle of each. Unless ``knows_turn``, the follower takes the leader's turn rate as 0.
    """
    dt = float(times[1] - times[0])
    substeps = max(1, round(np.ceil(dt / LONGEST_STEP - 1e-9)))
    held, waiting = dt / substeps, sorted(moments)
    state = kept(gains)
    rows: list[tuple[float, ...]] = []
    for t in times.tolist():
        for substep in range(substeps):
            now = t + substep * held
            shape, driven = shape_of(leader, follower), program(now + 0.5 * held)
            while waiting and now >= waiting[0]:
                waiting.pop(0)
                state = change_to(state.station.side.other, shape, gains)
            u1 = driven.u if knows_turn else 0.0
            state, wanted = change_step(state, shape, driven.v, u1, law, gains, limits, held)
            motion, _ = limits.apply(wanted)
            if substep == 0:
                places = (leader.x, leader.y, leader.theta, follower.x, follower.y, follower.theta)
                at = (shape.rho, shape.alpha1, shape.alpha2, driven.v, driven.u, motion.v, motion.u)
                rows.append((*at, *places))
            leader = advance(leader, driven.v, driven.u, held)
            follower = advance(follower, motion.v, motion.u, held)
    table = np.array(rows)
    rho, alpha1, alpha2, v1, u1, v2, u2 = table[:, :7].T
    return Trajectory(times, rho, alpha1, alpha2, v1, u1, v2, u2, table[:, 7:10], table[:, 10:])
