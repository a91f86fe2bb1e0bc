"""Arcs without trigonometry: a direction is kept as its cosine and sine, and turned by small angles."""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.kernel import kernel

_SMALL = 0.125


class Course(NamedTuple):
    """Position (x, y) [m] and direction, this by its cosine and sine."""

    x: float
    y: float
    cos: float
    sin: float


class Turn(NamedTuple):
    """sin(x)/x and cos(x) of an angle x."""

    sinc: float
    cos: float


class Swing(NamedTuple):
    """Of a turn by u dt: its cosine and sine, the integrals of both over dt [s], these differentiated by u.

    ``s``, ``c``: integrals of cos(u t) and sin(u t) over t from 0 to dt.
    """

    cos: float
    sin: float
    s: float
    c: float
    s_by_u: float
    c_by_u: float


@kernel
def small_turn(x: float) -> Turn:
    """sin(x)/x and cos(x): up to an eighth of a radian by series that are exact to rounding there."""
    if abs(x) > _SMALL:
        return Turn(math.sin(x) / x, math.cos(x))
    return _turn_by_series(x)


@kernel
def _turn_by_series(x: float) -> Turn:
    q = x * x
    sinc = 1.0 - q * (1 / 6) * (1.0 - q * (1 / 20) * (1.0 - q * (1 / 42) * (1.0 - q * (1 / 72))))
    versed = q * 0.5 * (1.0 - q * (1 / 12) * (1.0 - q * (1 / 30) * (1.0 - q * (1 / 56))))
    return Turn(sinc, 1.0 - versed)


@kernel
def along(at: Course, v: float, u: float, dt: float) -> Course:
    """Course after dt [s] at speed v [m/s] and turn rate u [rad/s]: ``formation.pose.advance`` in pairs."""
    half = 0.5 * u * dt
    turn = small_turn(half)
    s, chord = half * turn.sinc, v * dt * turn.sinc
    cos, sin = at.cos * turn.cos - at.sin * s, at.sin * turn.cos + at.cos * s
    return Course(
        at.x + chord * cos,
        at.y + chord * sin,
        cos * turn.cos - sin * s,
        sin * turn.cos + cos * s,
    )


@kernel
def swing(u: float, dt: float) -> Swing:
    """Turn by u dt and its integrals."""
    a = u * dt
    if not abs(a) > _SMALL:
        return small_swing(u, dt)
    whole, half = small_turn(a), small_turn(0.5 * a)
    s, c = dt * whole.sinc, 0.5 * dt * a * half.sinc * half.sinc
    return Swing(whole.cos, a * whole.sinc, s, c, (dt * whole.cos - s) / u, (dt * a * whole.sinc - c) / u)


@kernel
def is_small_swing(u: float, dt: float) -> bool:
    """Whether a turn is one that :func:`small_swing` is for."""
    return abs(u * dt) <= _SMALL


@kernel
def small_swing(u: float, dt: float) -> Swing:
    """The same of a turn by up to an eighth of a radian, by series alone: without a branch."""
    a = u * dt
    whole, half = _turn_by_series(a), _turn_by_series(0.5 * a)
    s, c = dt * whole.sinc, 0.5 * dt * a * half.sinc * half.sinc
    q = a * a
    s_by_u = -dt * dt * a * (1 / 3) * (1.0 - q * (1 / 10) * (1.0 - q * (1 / 28) * (1.0 - q * (1 / 54))))
    c_by_u = dt * dt * (0.5 - q * (1 / 8) * (1.0 - q * (1 / 18) * (1.0 - q * (1 / 40))))
    return Swing(whole.cos, a * whole.sinc, s, c, s_by_u, c_by_u)
