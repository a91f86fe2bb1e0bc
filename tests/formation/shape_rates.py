"""Further forms of the shape dynamics, which others are held against."""

from __future__ import annotations

import math

from formation.pose import Motion
from formation.shape import Shape, shape_rates


def reduced_rates(rho: float, alpha1: float, leader: Motion, v2: float) -> tuple[float, float]:
    """(rho_dot, alpha1_dot) on the manifold alpha2 = pi/2, Eq. (5) of the paper. Needs rho > 0."""
    return -leader.v * math.cos(alpha1), (leader.v * math.sin(alpha1) + v2) / rho - leader.u


def relative_rates(
    rho: float, alpha2: float, v1: float, alpha1: float, follower: Motion
) -> tuple[float, float]:
    """(rho_dot, alpha2_dot) that a leader of speed v1 and bearing alpha1 causes: inverse of Eq. (7)."""
    rates = shape_rates(Shape(rho, alpha1, alpha2), Motion(v1, 0.0), follower)
    return rates.rho_dot, rates.alpha2_dot
