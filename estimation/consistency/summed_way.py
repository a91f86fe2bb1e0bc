"""The follower's way while measurements are put together for a bank: sums of its motion times time."""

from __future__ import annotations

import math

from estimation.models.coordinated_turn import FollowerMotion
from formation.kernel import kernel


@kernel
def way_added(was: FollowerMotion, way: FollowerMotion, dt: float) -> FollowerMotion:
    """Sums with a mean motion over dt [s] added; in the place of deviations are variances times time."""
    return FollowerMotion(
        was.v2 + way.v2 * dt,
        was.u2 + way.u2 * dt,
        was.sd_v2 + way.sd_v2 * way.sd_v2 * dt,
        was.sd_u2 + way.sd_u2 * way.sd_u2 * dt,
    )


@kernel
def mean_of_way(way: FollowerMotion, span: float) -> FollowerMotion:
    """Mean motion over the time [s] of such sums, with its deviations."""
    by = 1.0 / span
    return FollowerMotion(way.v2 * by, way.u2 * by, math.sqrt(way.sd_v2 * by), math.sqrt(way.sd_u2 * by))
