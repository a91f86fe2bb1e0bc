"""Where a pair stays though its follower believes the wrong velocity of its leader, and however that steers.

The reduced system (5) under law (8) with one error e of the believed velocity, |e| <= W, in all its terms at
once: with theta = alpha1 + pi/2, the true velocity (X, Y) = v1 (sin(theta), -cos(theta)) along and across the
line, and (X, Y) + e believed, of length v_hat,

    rho_dot = -X,  theta_dot = -u1 - e_y / rho - mu1 (X + e_x) / v_hat + v_hat f(rho).

rho_dot does not depend on e or u1. So the outermost motion is the one whose theta_dot is the largest that
the disc and k_u allow while theta > 0, and the least while theta < 0; where it closes, nothing gets out. For
one direction of the believed velocity theta_dot is linear in its length: the worst error lies on the rim.

What is returned is the outermost motion of a system that is disturbed a little more, as a polygon. On every
piece of it an upper bound of the true field's outward speed is negative: the largest over the rim, with its
curvature, at the middle of the piece, and Lipschitz constants times what is left to its ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from formation.angles import FloatArray
from formation.error_set_kernels import (
    ESCAPED,
    LONGEST,
    ErrorModel,
    outermost_half,
    push_at,
    worst_outward,
)
from formation.invariant_set import InvariantSet
from formation.shape import ABREAST_ALPHA1

_RIGHT, _LEFT = 1.0, -1.0
_TURNS = 40
_CLOSED = 1e-6
_BEYOND = 2e-4
_SPARE = (6e-4, 1.5e-3, 5e-3)

Curve = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class ErrorSet:
    """A proved set; ``inward``: least speed of the field across it, in rho / rho_0 and alpha1 a second."""

    inside: InvariantSet
    inward: float


def error_set(model: ErrorModel) -> ErrorSet | None:
    """The smallest set that is proved, or None if the outermost motion never closes.

    All motions of the model cross its boundary inwards, a million times faster than rounding moves.
    """
    if not model.v1 > model.W:
        return None
    for spare in _SPARE:
        found = _closed(model, spare)
        if found is None:
            return None
        sides = zip(found, (_RIGHT, _LEFT), strict=True)
        outward = max(worst_outward(*curve, len(curve[0]), side, model) for curve, side in sides)
        if outward < 0.0:
            return ErrorSet(_as_set(*found), -outward)
    return None


def _closed(model: ErrorModel, spare: float) -> tuple[Curve, Curve] | None:
    """Both halves of the cycle of the outermost motion, from outside it by a hair's breadth."""
    node = _node(model, spare)
    if math.isfinite(node):
        # Where a constant disturbance has an equilibrium far out, the cycle mostly ends there.
        found = _from(model, spare, node * (1.0 + _BEYOND))
        if found is not None:
            return found
    rho_max = model.rho_0
    for _ in range(_TURNS):
        turned = _turn(model, spare, rho_max)
        if turned is None:
            return None
        before, rho_max = rho_max, float(turned[1][0][-1])
        if abs(rho_max - before) <= _CLOSED * model.rho_0:
            break
    return _from(model, spare, rho_max * (1.0 + 10.0 * _CLOSED))


def _from(model: ErrorModel, spare: float, start: float) -> tuple[Curve, Curve] | None:
    """Both halves of a turn that begins at a distance, if it comes back within."""
    found = _turn(model, spare, start)
    if found is None or found[1][0][-1] > start:
        return None
    right, (rhos, psis) = found
    # Where it comes back a little inside its beginning, the gap is a piece of the boundary too.
    return right, (np.append(rhos, start), np.append(psis, 0.0))


def _turn(model: ErrorModel, spare: float, rho_max: float) -> tuple[Curve, Curve] | None:
    right = _half(model, spare, rho_max, _RIGHT)
    left = None if right is None else _half(model, spare, float(right[0][-1]), _LEFT)
    return None if right is None or left is None else (right, left)


def _half(model: ErrorModel, spare: float, rho: float, side: float) -> Curve | None:
    rhos, psis = np.empty(LONGEST), np.empty(LONGEST)
    count = outermost_half(rhos, psis, rho, side, spare, model)
    return None if count == ESCAPED else (rhos[:count].copy(), psis[:count].copy())


def _node(model: ErrorModel, spare: float) -> float:
    """Largest distance at which a constant disturbance has its equilibrium, inf for none."""
    inner, outer = model.rho_0, 100.0 * model.rho_0
    if push_at(outer, 0.0, _LEFT, model) + spare >= 0.0:
        return math.inf
    for _ in range(60):
        middle = math.sqrt(inner * outer)
        held = push_at(middle, 0.0, _LEFT, model) + spare > 0.0
        inner, outer = (middle, outer) if held else (inner, middle)
    return outer


def _as_set(right: Curve, left: Curve) -> InvariantSet:
    return InvariantSet(
        rho_min=float(right[0][-1]),
        rho_max=float(right[0][0]),
        alpha1_min=ABREAST_ALPHA1 - float(left[1].max()),
        alpha1_max=ABREAST_ALPHA1 + float(right[1].max()),
        inward=(right[0][::-1], right[1][::-1]),
        outward=left,
    )
