"""The leader's body beside its wheel axis: a belief about the robot as one about the body, and back.

Mocap shows b = p + R(psi) m, with m the body's place on the robot and psi the direction of travel, which is
that of the velocity w. The direction is the estimated one: no orientation of the leader's is looked at.
Beliefs are carried over by the Jacobian of this map, which can be undone. A measured b is linear in the one
about the body, so that what is learned of the velocity does not depend on where the map was linearised.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.filters.gaussian import Gaussian
from formation.kernel import kernel


class Lever(NamedTuple):
    """Place of the leader's body [m], ahead of the middle of its wheel axis and to the left of it."""

    x: float
    y: float

    @kernel
    def is_centred(self) -> bool:
        """Whether the body sits above the middle of the wheel axis."""
        return self.x == 0.0 and self.y == 0.0


NO_LEVER = Lever(0.0, 0.0)


class Arm(NamedTuple):
    """The way from the robot to its body in the frame of the belief [m], and its derivatives by w [s]."""

    x: float
    y: float
    x_vx: float
    x_vy: float
    y_vx: float
    y_vy: float


@kernel
def arm_at(vx: float, vy: float, lever: Lever, v_eps: float) -> Arm:
    """Arm of a leader at a velocity.

    Below ``v_eps`` [m/s] the velocity says little of a direction: the arm shrinks with the speed there, and
    its derivative stays what it is at that speed: an uncertain velocity leaves the place uncertain by
    about the arm.
    """
    speed = math.sqrt(vx * vx + vy * vy)
    if speed < v_eps:
        a, b = lever.x / v_eps, lever.y / v_eps
        return Arm(a * vx - b * vy, b * vx + a * vy, a, -b, b, a)
    ex, ey = vx / speed, vy / speed
    x, y = ex * lever.x - ey * lever.y, ey * lever.x + ex * lever.y
    nx, ny = -ey / speed, ex / speed
    return Arm(x, y, -y * nx, -y * ny, x * nx, x * ny)


@kernel
def _shifted(b: Gaussian, arm: Arm, sign: float) -> Gaussian:
    """Belief of which the position is moved along the arm, or back by it."""
    xx, xy, yx, yy = sign * arm.x_vx, sign * arm.x_vy, sign * arm.y_vx, sign * arm.y_vy
    # Covariances of what is added with the velocity.
    x_vx, x_vy = xx * b.vx_vx + xy * b.vx_vy, xx * b.vx_vy + xy * b.vy_vy
    y_vx, y_vy = yx * b.vx_vx + yy * b.vx_vy, yx * b.vx_vy + yy * b.vy_vy
    return b._replace(
        x=b.x + sign * arm.x,
        y=b.y + sign * arm.y,
        x_x=b.x_x + 2.0 * (xx * b.x_vx + xy * b.x_vy) + (xx * x_vx + xy * x_vy),
        x_y=b.x_y + (xx * b.y_vx + xy * b.y_vy) + (yx * b.x_vx + yy * b.x_vy) + (yx * x_vx + yy * x_vy),
        x_vx=b.x_vx + x_vx,
        x_vy=b.x_vy + x_vy,
        x_u=b.x_u + xx * b.vx_u + xy * b.vy_u,
        y_y=b.y_y + 2.0 * (yx * b.y_vx + yy * b.y_vy) + (yx * y_vx + yy * y_vy),
        y_vx=b.y_vx + y_vx,
        y_vy=b.y_vy + y_vy,
        y_u=b.y_u + yx * b.vx_u + yy * b.vy_u,
    )


@kernel
def at_body(belief: Gaussian, lever: Lever, v_eps: float) -> Gaussian:
    """Belief about the leader's body out of one about the leader."""
    return _shifted(belief, arm_at(belief.vx, belief.vy, lever, v_eps), 1.0)


@kernel
def at_robot(belief: Gaussian, lever: Lever, v_eps: float) -> Gaussian:
    """Belief about the leader out of one about its body."""
    return _shifted(belief, arm_at(belief.vx, belief.vy, lever, v_eps), -1.0)
