"""The shape of a pair: distance and two bearings, their dynamics, and what they tell of the leader.

``rho`` is the distance. ``alpha1`` is the bearing under which the leader sees the follower, ``alpha2`` the
bearing under which the follower sees the leader, each from its own heading, counter-clockwise positive. With
the follower abreast on the right of the leader, alpha1 = -pi/2 and alpha2 = +pi/2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.kernel import kernel
from formation.pose import Motion, Pose
from formation.wrapping import wrapped

ABREAST_ALPHA1 = -0.5 * math.pi
ABREAST_ALPHA2 = 0.5 * math.pi


class Shape(NamedTuple):
    """Distance rho [m] and bearings alpha1, alpha2 [rad] (Eq. (2) of the paper)."""

    rho: float
    alpha1: float
    alpha2: float


class ShapeRates(NamedTuple):
    """Time derivatives of a :class:`Shape`: rho_dot [m/s], alpha1_dot and alpha2_dot [rad/s]."""

    rho_dot: float
    alpha1_dot: float
    alpha2_dot: float


def shape_of(leader: Pose, follower: Pose) -> Shape:
    """Shape of the pair, bearings wrapped. Two robots in one place have none: :class:`ValueError`."""
    shape = shape_between(leader, follower)
    if shape.rho == 0.0:
        raise ValueError(
            f"leader and follower are both at ({leader.x}, {leader.y}); bearings need a distance"
        )
    return shape


@kernel
def shape_between(leader: Pose, follower: Pose) -> Shape:
    """Shape of the pair, bearings wrapped. In one place rho is 0, and the bearings mean nothing."""
    dx, dy = follower.x - leader.x, follower.y - leader.y
    rho = math.sqrt(dx * dx + dy * dy)
    alpha1 = wrapped(math.atan2(dy, dx) - leader.theta)
    alpha2 = wrapped(math.atan2(-dy, -dx) - follower.theta)
    return Shape(rho, alpha1, alpha2)


@kernel
def follower_pose(shape: Shape, leader: Pose) -> Pose:
    """Pose of the follower that stands in ``shape`` to ``leader``: the inverse of :func:`shape_of`."""
    line = leader.theta + shape.alpha1
    return Pose(
        leader.x + shape.rho * math.cos(line),
        leader.y + shape.rho * math.sin(line),
        wrapped(line + math.pi - shape.alpha2),
    )


@kernel
def shape_rates(shape: Shape, leader: Motion, follower: Motion) -> ShapeRates:
    """Shape dynamics, Eq. (3) of the paper, for the motions of both robots. Needs rho > 0."""
    line_rate = (leader.v * math.sin(shape.alpha1) + follower.v * math.sin(shape.alpha2)) / shape.rho
    return ShapeRates(
        -leader.v * math.cos(shape.alpha1) - follower.v * math.cos(shape.alpha2),
        line_rate - leader.u,
        line_rate - follower.u,
    )


@kernel
def leader_velocity(
    rho: float, alpha2: float, rho_dot: float, alpha2_dot: float, follower: Motion
) -> tuple[float, float]:
    """Leader's velocity (X, Y) [m/s] from what the follower can measure, the step before Eq. (7).

    X = v1 cos(alpha1) is its component along the line from leader to follower, Y = v1 sin(alpha1) the one
    that turns this line; both hold in any frame. ``follower`` is its measured motion at the time of the
    measurement, never a command.
    """
    x = -rho_dot - follower.v * math.cos(alpha2)
    y = rho * (alpha2_dot + follower.u) - follower.v * math.sin(alpha2)
    return x, y


@kernel
def polar_velocity(x: float, y: float) -> tuple[float, float]:
    """(v1, alpha1) from (X, Y), Eq. (7) of the paper with ``atan2`` in the place of ``arctan``.

    The desired alpha1 = -pi/2 lies at X = 0, where arctan(Y/X) jumps by pi; atan2 is smooth there. A leader
    that stands still has no direction: it gives v1 = 0 and an alpha1 without meaning.
    """
    return math.sqrt(x * x + y * y), wrapped(math.atan2(y, x))
