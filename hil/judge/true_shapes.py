"""The shape of a pair and its rates at every truth of a run: Eqs. (2) and (3) of the paper."""

from __future__ import annotations

import math

from formation.kernel import kernel
from formation.pose import Motion
from formation.records import Matrix
from formation.shape import Shape, shape_rates
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
        rho, line = columns[RHO, k], columns[ALPHA1, k]
        apart = 0.0 * rho
        shape = Shape(rho, wrapped(line - leader) + apart, wrapped(line + math.pi - follower) + apart)
        rates = shape_rates(shape, Motion(v1, columns[U1, k]), Motion(columns[V2, k], columns[U2, k]))
        columns[LEADER_THETA, k], columns[FOLLOWER_THETA, k], columns[V1, k] = leader, follower, v1
        columns[ALPHA1, k], columns[ALPHA2, k] = shape.alpha1, shape.alpha2
        columns[RHO_DOT, k], columns[ALPHA2_DOT, k] = rates.rho_dot, rates.alpha2_dot
