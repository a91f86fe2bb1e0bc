"""The outermost motion under a wrong belief of the leader's velocity, and the proof along its path, compiled.

:mod:`formation.error_set` tells what they are for.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.kernel import entry, kernel
from formation.records import Vector
from formation.spacing import restoring, restoring_slope

LONGEST = 400_000
"""Points that a curve handed to :func:`outermost_half` must have room for."""
ESCAPED = -1
FIRST = 1e-3
"""psi [rad] up to which the boundary begins upright."""

_COARSE, _FINE = 40, 12
_PIECE = 3e-4


class ErrorModel(NamedTuple):
    """The reduced system (5) under law (8): mu1 [rad/s], rho_0 [m], mu_rho [1/m], and what disturbs it.

    v1 [m/s] of the leader, its limit k_u [rad/s], and W [m/s] < v1: how wrong the believed velocity can be.
    """

    mu1: float
    rho_0: float
    mu_rho: float
    v1: float
    k_u: float
    W: float


class Half(NamedTuple):
    """A half of the plane: side +1 where rho falls, -1 where it grows; state (rho, psi = side theta)."""

    side: float
    rho: float
    psi: float


class Seen(NamedTuple):
    """A state as its disc is looked at: side, true velocity along and across the line, rho, f(rho)."""

    side: float
    x: float
    y: float
    rho: float
    f: float


@kernel
def seen_at(model: ErrorModel, at: Half) -> Seen:
    """What does not change along the rim."""
    x, y = at.side * model.v1 * math.sin(at.psi), -model.v1 * math.cos(at.psi)
    return Seen(at.side, x, y, at.rho, restoring(at.rho, model.rho_0, model.mu_rho))


@kernel
def rim_value(model: ErrorModel, seen: Seen, cos: float, sin: float) -> float:
    """Side * theta_dot [rad/s] without steering, the error pointing along (cos, sin) with length W."""
    e_y = model.W * sin
    x, y = seen.x + model.W * cos, seen.y + e_y
    v = math.sqrt(x * x + y * y)
    return seen.side * (-e_y / seen.rho - model.mu1 * x / v + v * seen.f)


@kernel
def bend_of(model: ErrorModel, rho: float) -> float:
    """Bound of the second derivative of :func:`rim_value` by the place, for any psi."""
    slow, f = model.v1 - model.W, abs(restoring(rho, model.rho_0, model.mu_rho))
    turned = model.W / slow
    by_length = f * model.W * (model.v1 + model.W) / slow
    return model.W / rho + model.mu1 * (turned + 3.0 * turned * turned) + by_length


@kernel
def largest_push(model: ErrorModel, at: Half) -> float:
    """Upper bound of side * theta_dot [rad/s] over disc and steering.

    Between two places of a grid the curve rises above the higher by at most an eighth of the squared step
    times its largest second derivative; where that matters, the grid is refined.
    """
    bend, seen = bend_of(model, at.rho), seen_at(model, at)
    step = 2.0 * math.pi / _COARSE
    turn_c, turn_s = math.cos(step), math.sin(step)
    small_c, small_s = math.cos(step / _FINE), math.sin(step / _FINE)
    best, c, s = -math.inf, 1.0, 0.0
    for _ in range(_COARSE):
        best = max(best, rim_value(model, seen, c, s))
        c, s = c * turn_c - s * turn_s, s * turn_c + c * turn_s
    slack, fine = 0.125 * step * step * bend, step / _FINE
    bound, before = best, rim_value(model, seen, 1.0, 0.0)
    c, s = 1.0, 0.0
    for _ in range(_COARSE):
        ahead_c, ahead_s = c * turn_c - s * turn_s, s * turn_c + c * turn_s
        after = rim_value(model, seen, ahead_c, ahead_s)
        if max(before, after) + slack > bound:
            for _ in range(1, _FINE):
                c, s = c * small_c - s * small_s, s * small_c + c * small_s
                bound = max(bound, rim_value(model, seen, c, s))
        before, c, s = after, ahead_c, ahead_s
    return model.k_u + bound + 0.125 * fine * fine * bend


@kernel
def _changes(model: ErrorModel, lo: float, hi: float) -> tuple[float, float]:
    """Lipschitz constants of the push by rho [rad/s/m] and psi [1/s] between two distances."""
    f = max(abs(restoring(lo, model.rho_0, model.mu_rho)), abs(restoring(hi, model.rho_0, model.mu_rho)))
    by_rho = model.W / (lo * lo) + restoring_slope(lo, model.rho_0, model.mu_rho) * (model.v1 + model.W)
    by_psi = model.mu1 * model.v1 / (model.v1 - model.W) + f * model.v1
    return by_rho, by_psi


@kernel
def _slopes(model: ErrorModel, at: Half, spare: float) -> tuple[float, float]:
    """d(rho) and d(psi) per second, a little outwards of what is possible."""
    push = largest_push(model, at) + spare
    # Slower while psi rises and faster while it falls, by what psi changes within a piece.
    late = _PIECE if push > 0.0 else -_PIECE
    return -at.side * model.v1 * (math.sin(at.psi) - late), push


@kernel
def _step(model: ErrorModel, rho: float, rate: float, push: float) -> float:
    """Time [s] in which psi changes by at most one piece, and the push by a fraction of that."""
    by_rho, by_psi = _changes(model, rho, rho)
    along = abs(rate) / model.rho_0
    arc = math.sqrt(along * along + push * push + 1e-12)
    return min(_PIECE / arc, _PIECE / (by_rho * abs(rate) + by_psi * abs(push) + 1e-12))


@entry
def outermost_half(
    rhos: Vector, psis: Vector, rho: float, side: float, spare: float, model: ErrorModel
) -> int:
    """Outermost motion from (rho, 0) until psi is back at 0, disturbed by ``spare`` [rad/s] too much.

    It begins upright, as far as psi = 1e-3, and ends along its last direction, both a little outside of the
    motion. Returns the number of points, or ``ESCAPED``.
    """
    psi = FIRST
    rhos[0], psis[0] = rho, 0.0
    rhos[1], psis[1] = rho, psi
    for n in range(2, LONGEST):
        r1, p1 = _slopes(model, Half(side, rho, psi), spare)
        h = _step(model, rho, r1, p1)
        r2, p2 = _slopes(model, Half(side, rho + 0.5 * h * r1, psi + 0.5 * h * p1), spare)
        before, was = rho, psi
        rho, psi = rho + h * r2, psi + h * p2
        if not (psi < math.pi and 0.01 * model.rho_0 < rho < 100.0 * model.rho_0):
            return ESCAPED
        if p2 < 0.0 and psi <= min(FIRST, -0.01 * p2):
            # Straight on along the steepest direction: the motion bends away from it inwards.
            slope = model.v1 * math.sin(was) / -p1 if p1 < 0.0 else 0.0
            rhos[n], psis[n] = before - side * 1.05 * was * slope, 0.0
            return n + 1
        rhos[n], psis[n] = rho, psi
    return ESCAPED


@kernel
def _outward(model: ErrorModel, side: float, a: Half, b: Half) -> float:
    """Upper bound of the field's outward speed on the piece from a to b, in rho / rho_0 and alpha1 a second.

    -inf for a piece that is upright: there rho_dot alone matters, whose sign is that of the half.
    """
    ahead, up = side * (a.rho - b.rho), b.psi - a.psi
    if ahead < 0.0 or min(a.psi, b.psi) < 0.0 or max(a.psi, b.psi) >= math.pi:
        return math.inf
    if ahead == 0.0:
        return -math.inf
    lo, hi = min(a.rho, b.rho), max(a.rho, b.rho)
    by_rho, by_psi = _changes(model, lo, hi)
    middle = Half(side, 0.5 * (lo + hi), 0.5 * (a.psi + b.psi))
    push = largest_push(model, middle) + 0.5 * (by_rho * (hi - lo) + by_psi * abs(up))
    low, high = math.sin(a.psi), math.sin(b.psi)
    sine = min(low, high) if up > 0.0 else max(low, high)
    half_turn = 0.5 * math.pi
    if up < 0.0 and b.psi <= half_turn <= a.psi:
        sine = 1.0
    along = ahead / model.rho_0
    return (ahead * push - up * model.v1 * sine) / (model.rho_0 * math.sqrt(along * along + up * up))


@entry
def worst_outward(rhos: Vector, psis: Vector, count: int, side: float, model: ErrorModel) -> float:
    """Upper bound of the outward speed of the field anywhere on a half of a boundary of ``count`` points.

    Negative: every motion that the model admits crosses it inwards.
    """
    worst = -math.inf
    for k in range(count - 1):
        a, b = Half(side, rhos[k], psis[k]), Half(side, rhos[k + 1], psis[k + 1])
        worst = max(worst, _outward(model, side, a, b))
    return worst


@entry
def push_at(rho: float, psi: float, side: float, model: ErrorModel) -> float:
    """:func:`largest_push` at a state."""
    return largest_push(model, Half(side, rho, psi))
