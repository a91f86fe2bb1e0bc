"""The leader as its follower believes it to be: where it is, and how sure it is of how it moves on."""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.pose import Pose
from formation.wrapping import wrapped

AHEAD_S = 2.0
"""How far the belief is carried on [s] to be drawn."""

DEVIATIONS = 3.0


class Ellipse(NamedTuple):
    """Half axes [m], the longer one first, and the direction of that [rad]."""

    major: float
    minor: float
    angle: float


def believed_pose(follower: Pose, rho: float, alpha1: float, alpha2: float) -> Pose:
    """Pose of the leader by its follower's and the shape that this believes in."""
    line = follower.theta + alpha2
    return Pose(
        follower.x + rho * math.cos(line),
        follower.y + rho * math.sin(line),
        wrapped(line - math.pi - alpha1),
    )


def motion_ellipse(
    theta: float, v1: float, var_v1: float, cov_v1_alpha1: float, var_alpha1: float
) -> Ellipse | None:
    """Where the leader is :data:`AHEAD_S` later, to :data:`DEVIATIONS` standard deviations about v1 ahead.

    ``theta``: its heading. To first order the speed acts along it, and alpha1 across it. None where the
    covariance is none.
    """
    scale = (AHEAD_S * DEVIATIONS) ** 2
    along, across = scale * var_v1, scale * v1 * v1 * var_alpha1
    # The heading turns by as much as alpha1 is less.
    both = -scale * v1 * cov_v1_alpha1
    mean, half = 0.5 * (along + across), 0.5 * (along - across)
    spread = math.hypot(half, both)
    if not (math.isfinite(mean + spread + theta) and var_v1 >= 0.0 and var_alpha1 >= 0.0):
        return None
    return Ellipse(
        math.sqrt(mean + spread),
        math.sqrt(max(0.0, mean - spread)),
        wrapped(theta + 0.5 * math.atan2(both, half)),
    )
