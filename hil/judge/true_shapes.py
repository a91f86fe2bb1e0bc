"""The shape of a pair and its rates at every truth of a run: Eqs. (2) and (3) of the paper."""

from __future__ import annotations

import math

from formation.kernel import kernel
from formation.records import Matrix
from formation.wrapping import wrapped

LEADER_X, LEADER_Y, LEADER_THETA, FOLLOWER_X, FOLLOWER_Y, FOLLOWER_THETA, V1, U1, V2, U2 = range(10)
RHO, ALPHA1, ALPHA2, RHO_DOT, ALPHA2_DOT = range(10, 15)
"""Columns of a truth as it is recorded, then of its shape."""


@kernel
def shapes_filled(columns: Matrix) -> None:
    """Fill in shape and rates of n truths as columns (15, n), and wrap the headings.

    rho, NaN where there is no shape, and in the place of ``ALPHA1`` the direction [rad] of the line from the
    leader to the follower are given. A leader that drives backwards is turned round.
    """
    for k in range(columns.shape[1]):
        leader, v1 = columns[LEADER_THETA, k], columns[V1, k]
        if v1 < 0.0:
            leader, v1 = leader + math.pi, -1.0 * v1
        leader, follower = wrapped(leader), wrapped(columns[FOLLOWER_THETA, k])
        rho, line, v2 = columns[RHO, k], columns[ALPHA1, k], columns[V2, k]
        apart = 0.0 * rho
        alpha1, alpha2 = wrapped(line - leader) + apart, wrapped(line + math.pi - follower) + apart
        turning = (v1 * math.sin(alpha1) + v2 * math.sin(alpha2)) / rho
        columns[LEADER_THETA, k], columns[FOLLOWER_THETA, k], columns[V1, k] = leader, follower, v1
        columns[ALPHA1, k], columns[ALPHA2, k] = alpha1, alpha2
        columns[RHO_DOT, k] = -v1 * math.cos(alpha1) - v2 * math.cos(alpha2)
        columns[ALPHA2_DOT, k] = turning - columns[U2, k]
