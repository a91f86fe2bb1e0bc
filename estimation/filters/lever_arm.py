"""The leader's body beside its wheel axis: a filter tracks the body, and this tells the robot under it.

Mocap shows b = p + R(psi) m, with m the body's place on the robot and psi the direction of travel. The body
drives circles about the same centre as the robot and turns as fast, so that the coordinated turn holds for
its velocity V as it does for the robot's w; a change of the turn rate u changes V, too. What is measured is
then linear in the belief, however little is known of psi. Along the robot's axes V is (v - u m_y, u m_x),
which tells psi and v out of V and u: the direction is the estimated one, of the leader's orientation nothing
is seen.
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


NO_LEVER = Lever(0.0, 0.0)


@kernel
def is_centred(lever: Lever) -> bool:
    """Whether the body sits above the middle of the wheel axis."""
    return lever.x == 0.0 and lever.y == 0.0


class Change(NamedTuple):
    """By how much something changes the robot's position and velocity."""

    x: float
    y: float
    vx: float
    vy: float


class Travel(NamedTuple):
    """Direction of travel by a body's velocity and turn rate, and the robot's speed [m/s], with derivatives.

    ``ex``, ``ey``: a unit vector, shorter where the body is slower than ``v_eps``. Their derivatives and the
    speed's are by V_x, V_y and u, in this order.
    """

    ex: float
    ey: float
    v: float
    ex_by: tuple[float, float, float]
    ey_by: tuple[float, float, float]
    v_by: tuple[float, float, float]


@kernel
def travel(vx: float, vy: float, u: float, lever: Lever, v_eps: float) -> Travel:
    """How the robot travels under a body of velocity V that turns at u.

    A body that is slower than ``v_eps`` [m/s], or hardly faster than it turns about its robot, says little of
    a direction: what is divided by does not fall below that, so that the derivatives stay within bounds.
    """
    g = u * lever.x
    square = max(vx * vx + vy * vy, v_eps * v_eps)
    ahead, least = square - g * g, 0.25 * v_eps * v_eps
    free = 1.0 if ahead > least else 0.0
    moving = free if square > v_eps * v_eps else 0.0
    f = math.sqrt(max(ahead, least))
    # By V_x, V_y and u: of f, the speed along the heading, and of |V|^2.
    fx, fy, fu = moving * vx / f, moving * vy / f, -free * g * lever.x / f
    whole = f * f + g * g
    sx, sy, su = 2.0 * f * fx, 2.0 * f * fy, 2.0 * (f * fu + g * lever.x)
    ex, ey = (f * vx + g * vy) / whole, (f * vy - g * vx) / whole
    return Travel(
        ex,
        ey,
        f + u * lever.y,
        (
            (f + fx * vx - ex * sx) / whole,
            (g + fy * vx - ex * sy) / whole,
            (fu * vx + lever.x * vy - ex * su) / whole,
        ),
        (
            (fx * vy - g - ey * sx) / whole,
            (f + fy * vy - ey * sy) / whole,
            (fu * vy - lever.x * vx - ey * su) / whole,
        ),
        (fx, fy, fu + lever.y),
    )


@kernel
def _change(t: Travel, k: int, lever: Lever) -> Change:
    """Change of the robot's position and velocity by V_x, V_y or u, the body's position being the same."""
    ex, ey = t.ex_by[k], t.ey_by[k]
    return Change(
        -(ex * lever.x - ey * lever.y),
        -(ey * lever.x + ex * lever.y),
        t.v_by[k] * t.ex + t.v * ex,
        t.v_by[k] * t.ey + t.v * ey,
    )


@kernel
def _mixed(a: Change, b: Change, c: Change, x: float, y: float, u: float) -> Change:
    """What changes by V_x, V_y and u make together, each times its number."""
    return Change(
        a.x * x + b.x * y + c.x * u,
        a.y * x + b.y * y + c.y * u,
        a.vx * x + b.vx * y + c.vx * u,
        a.vy * x + b.vy * y + c.vy * u,
    )


@kernel(inline=False)
def robot_under(b: Gaussian, lever: Lever, v_eps: float) -> Gaussian:
    """Belief about the leader out of one about its body, by the derivative of the way between them."""
    t = travel(b.vx, b.vy, b.u, lever, v_eps)
    p, q, r = _change(t, 0, lever), _change(t, 1, lever), _change(t, 2, lever)
    # Covariances of the robot's position and velocity with the body's V and u, and with its position.
    on_vx = _mixed(p, q, r, b.vx_vx, b.vx_vy, b.vx_u)
    on_vy = _mixed(p, q, r, b.vx_vy, b.vy_vy, b.vy_u)
    on_u = _mixed(p, q, r, b.vx_u, b.vy_u, b.u_u)
    on_x = _mixed(p, q, r, b.x_vx, b.x_vy, b.x_u)
    on_y = _mixed(p, q, r, b.y_vx, b.y_vy, b.y_u)
    own_x = Change(on_vx.x + b.x_vx, on_vx.y + b.y_vx, on_vx.vx, on_vx.vy)
    own_y = Change(on_vy.x + b.x_vy, on_vy.y + b.y_vy, on_vy.vx, on_vy.vy)
    own_u = Change(on_u.x + b.x_u, on_u.y + b.y_u, on_u.vx, on_u.vy)
    return b._replace(
        x=b.x - (t.ex * lever.x - t.ey * lever.y),
        y=b.y - (t.ey * lever.x + t.ex * lever.y),
        vx=t.v * t.ex,
        vy=t.v * t.ey,
        x_x=b.x_x + on_x.x + (p.x * own_x.x + q.x * own_y.x + r.x * own_u.x),
        x_y=b.x_y + on_x.y + (p.x * own_x.y + q.x * own_y.y + r.x * own_u.y),
        x_vx=on_x.vx + (p.x * own_x.vx + q.x * own_y.vx + r.x * own_u.vx),
        x_vy=on_x.vy + (p.x * own_x.vy + q.x * own_y.vy + r.x * own_u.vy),
        x_u=own_u.x,
        y_y=b.y_y + on_y.y + (p.y * own_x.y + q.y * own_y.y + r.y * own_u.y),
        y_vx=on_y.vx + (p.y * own_x.vx + q.y * own_y.vx + r.y * own_u.vx),
        y_vy=on_y.vy + (p.y * own_x.vy + q.y * own_y.vy + r.y * own_u.vy),
        y_u=own_u.y,
        vx_vx=p.vx * own_x.vx + q.vx * own_y.vx + r.vx * own_u.vx,
        vx_vy=p.vx * own_x.vy + q.vx * own_y.vy + r.vx * own_u.vy,
        vx_u=own_u.vx,
        vy_vy=p.vy * own_x.vy + q.vy * own_y.vy + r.vy * own_u.vy,
        vy_u=own_u.vy,
    )


@kernel(inline=False)
def swung(b: Gaussian, before: Gaussian, lever: Lever, v_eps: float, q_u: float, dt: float) -> Gaussian:
    """Belief about the body after dt [s] in which the turn rate was driven by q_u, beside what u itself gets.

    A change of u changes V by J R(psi) m. As far as psi is not known, it does so in any direction.
    """
    t = travel(before.vx, before.vy, before.u, lever, v_eps)
    cx, cy = -(t.ey * lever.x + t.ex * lever.y), t.ex * lever.x - t.ey * lever.y
    unknown = max(0.0, 1.0 - (t.ex * t.ex + t.ey * t.ey))
    rest = 0.5 * unknown * (lever.x * lever.x + lever.y * lever.y)
    xx, xy, yy = q_u * (cx * cx + rest), q_u * cx * cy, q_u * (cy * cy + rest)
    twice, thrice = 0.5 * dt * dt, dt * dt * dt * (1.0 / 3.0)
    return b._replace(
        x_x=b.x_x + thrice * xx,
        x_y=b.x_y + thrice * xy,
        x_vx=b.x_vx + twice * xx,
        x_vy=b.x_vy + twice * xy,
        x_u=b.x_u + twice * q_u * cx,
        y_y=b.y_y + thrice * yy,
        y_vx=b.y_vx + twice * xy,
        y_vy=b.y_vy + twice * yy,
        y_u=b.y_u + twice * q_u * cy,
        vx_vx=b.vx_vx + dt * xx,
        vx_vy=b.vx_vy + dt * xy,
        vx_u=b.vx_u + dt * q_u * cx,
        vy_vy=b.vy_vy + dt * yy,
        vy_u=b.vy_u + dt * q_u * cy,
    )
