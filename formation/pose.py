"""Poses and motions of a unicycle, and its exact step along an arc."""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.kernel import kernel
from formation.wrapping import wrapped


class Pose(NamedTuple):
    """Position (x, y) [m] and heading theta [rad] in the world frame, heading counter-clockwise from x."""

    x: float
    y: float
    theta: float


class Motion(NamedTuple):
    """Speed v [m/s] along the heading and turn rate u [rad/s], counter-clockwise positive.

    >>> import abreast
    >>> abreast.Motion(v=0.1, u=-0.5).u
    -0.5
    """

    v: float
    u: float


STANDSTILL = Motion(0.0, 0.0)


@kernel
def advance(pose: Pose, v: float, u: float, dt: float) -> Pose:
    """Pose after driving for ``dt`` seconds at constant speed v and turn rate u; heading wrapped.

    This is the exact solution of the unicycle (Eq. (1) of the paper), not a step of an integrator. It is
    written with the chord of the arc, v*dt * sin(h)/h with half the turned angle h = u*dt/2, whose direction
    is theta + h: the textbook form with the radius v/u subtracts nearly equal sines when u*dt is small, while
    this one keeps full precision for every u, zero included. ``dt`` may be negative.
    """
    half_turn = 0.5 * u * dt
    chord = v * dt
    if half_turn != 0.0:
        chord *= math.sin(half_turn) / half_turn
    direction = pose.theta + half_turn
    return Pose(
        pose.x + chord * math.cos(direction),
        pose.y + chord * math.sin(direction),
        wrapped(pose.theta + u * dt),
    )
