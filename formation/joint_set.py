"""Where a pair stays, alpha2 within its ball, though its follower believes a wrong velocity of the leader.

As :mod:`formation.error_set`, but alpha2 = pi/2 + e moves under law (4) on the same wrong belief, off by
(e_x, e_y); the speed driven may be off by dv from the one asked for, and e_dot by du from law (4):

    rho_dot = -X + v2 sin(e),  theta_dot = -u1 + (Y + v2 cos(e)) / rho,  e_dot = -mu2 sin(e) - e_y / rho,
    v2 = -Y_hat + rho (-mu1 X_hat / v_hat + v_hat f(rho)).

The appendix of the paper: e ends within arcsin(M / mu2), M = W / rho. This is largest at the set's least
distance: the ball. Further out less will do: the radius r(rho) falls with the distance as fast as e does
while the pair drives apart at its fastest. So |e| <= r(rho) keeps itself, as r_dot >= e_dot on its edge; that
is checked between each two places of a table. Over rho and theta the worst that e within r(rho), errors and
steering can do closes to an outline, on which the field points inwards: proved piece by piece as there, with
Lipschitz constants. No motion leaves the three together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray, wrap
from formation.error_set_kernels import ErrorModel, push_at
from formation.joint_set_kernels import (
    APART,
    HELD,
    LONGEST_OUTLINE,
    Outline,
    Tube,
    outermost_turn,
    worst_across,
)
from formation.shape import ABREAST_ALPHA1
from formation.spacing import restoring

_PLACES = 4000
_REACH = 6.0
_FIRST_GUESS = 0.75
_ROUNDS = 12
_TURNS = 100
_BEYOND = 2e-4
_WIDER = 1.004
_TOUCH = 1e-6
_LEAST = 1e-8
_SPARE = (1e-3, 2.5e-3, 6e-3)
_PIECE = 3e-4
_COARSE = Outline(2.5e-3, 2e-3)


@dataclass(frozen=True, slots=True)
class Aside:
    """What moves alpha2, and how badly commands are driven: mu2 [rad/s], dv [m/s] of v2, du [rad/s] of u2."""

    mu2: float
    dv: float = 0.0
    du: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class JointSet:
    """A proved set: extremes of rho [m], alpha1 and |alpha2 - pi/2| [rad], its outline and radii.

    ``low``, ``high``: the outline below and above, curves (rho, alpha1 + pi/2), rho increasing; ``radii``:
    how far alpha2 may be off, as a curve over rho. ``inward``: least speed across the outline [1/s].
    """

    rho_min: float
    rho_max: float
    alpha1_min: float
    alpha1_max: float
    alpha2_within: float
    inward: float
    low: tuple[FloatArray, FloatArray] = field(repr=False)
    high: tuple[FloatArray, FloatArray] = field(repr=False)
    radii: tuple[FloatArray, FloatArray] = field(repr=False)

    def span(self, rho: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest alpha1 [rad] in the set at distances within it."""
        low, high = (np.interp(rho, *curve) + ABREAST_ALPHA1 for curve in (self.low, self.high))
        return low, high

    def radius(self, rho: FloatArray) -> FloatArray:
        """How far alpha2 may be off at distances within the set [rad]."""
        found: FloatArray = np.interp(rho, *self.radii)
        return found

    def contains(self, rho: FloatArray, alpha1: FloatArray, slack: float = 0.0) -> NDArray[np.bool_]:
        """Which points of the plane lie inside; ``slack`` widens the set in rho [m] and alpha1 [rad]."""
        theta = wrap(np.asarray(alpha1) - ABREAST_ALPHA1)
        inside = (rho >= self.rho_min - slack) & (rho <= self.rho_max + slack)
        beside = [np.clip(rho + way, self.rho_min, self.rho_max) for way in (-slack, 0.0, slack)]
        inside &= theta <= np.max([np.interp(near, *self.high) for near in beside], axis=0) + slack
        inside &= theta >= np.min([np.interp(near, *self.low) for near in beside], axis=0) - slack
        return np.asarray(inside, dtype=np.bool_)


@lru_cache(maxsize=64)
def joint_set(model: ErrorModel, aside: Aside) -> JointSet | None:
    """The smallest set that is proved, or None if the outermost motion never closes."""
    found = _closed(model, aside, _COARSE)
    if found is None:
        return None
    for spare in _SPARE:
        outline = _closed(model, aside, Outline(spare, _PIECE), found)
        if outline is None:
            return None
        proved = _proved(model, outline)
        if proved is not None:
            return proved
    return None


@lru_cache(maxsize=64)
def largest_error(model: ErrorModel, aside: Aside) -> float:
    """Largest error W [m/s], below that of the model, whose set closes; to a hundredth, and no proof."""
    low, high = 0.0, 1.0
    while high - low > 0.01:
        share = 0.5 * (low + high)
        held = _closed(model._replace(W=share * model.W), aside, _COARSE) is not None
        low, high = (share, high) if held else (low, share)
    return low * model.W


_Found = tuple[FloatArray, FloatArray, FloatArray, Tube]


def _closed(model: ErrorModel, aside: Aside, shape: Outline, near: _Found | None = None) -> _Found | None:
    """Outline (rho, theta) of a turn that comes back within its beginning, and the radii it holds for."""
    if not model.v1 > model.W:
        return None
    nearest = _FIRST_GUESS * model.rho_0 if near is None else float(near[0].min()) * 0.999
    for _ in range(_ROUNDS):
        table = tube_radii(model, aside, nearest)
        outline = None if table is None else _turned(model, shape, *table)
        if table is None or outline is None:
            return None
        least = float(outline[0].min())
        if least > nearest:
            return (*outline, *table)
        nearest = 0.998 * least
    return None


def _turned(
    model: ErrorModel, shape: Outline, radii: FloatArray, tube: Tube
) -> tuple[FloatArray, FloatArray] | None:
    start = _beyond_rest(model, tube.dv)
    if not math.isfinite(start):
        return None
    rhos, thetas = np.empty(LONGEST_OUTLINE), np.empty(LONGEST_OUTLINE)
    for _ in range(_TURNS):
        count = outermost_turn(rhos, thetas, start, radii, tube, shape, model)
        if count == APART or start > 0.5 * _REACH * model.rho_0:
            return None
        if count == HELD:
            start *= _WIDER
        elif rhos[count - 1] > start:
            start = float(rhos[count - 1]) * (1.0 + _TOUCH)
        else:
            return rhos[:count].copy(), thetas[:count].copy()
    return None


def _beyond_rest(model: ErrorModel, dv: float) -> float:
    """Distance beyond which no constant disturbance holds the pair abreast, alpha2 at rest; inf for none."""
    inner, outer = model.rho_0, 0.5 * _REACH * model.rho_0
    if push_at(outer, 0.0, -1.0, model) + dv / outer >= 0.0:
        return math.inf
    for _ in range(60):
        middle = 0.5 * (inner + outer)
        held = push_at(middle, 0.0, -1.0, model) + dv / middle > 0.0
        inner, outer = (middle, outer) if held else (inner, middle)
    return outer * (1.0 + _BEYOND)


def tube_radii(model: ErrorModel, aside: Aside, nearest: float) -> tuple[FloatArray, Tube] | None:
    """Radii of alpha2 from a distance outwards that keep themselves; None if errors outweigh mu2."""
    rho = np.linspace(nearest, _REACH * model.rho_0, _PLACES)
    step = float(rho[1] - rho[0])
    moved = model.W / rho + aside.du
    if not moved[0] < aside.mu2:
        return None
    fastest = fastest_ask(model, rho) + aside.dv
    radii = np.empty(_PLACES)
    radii[0] = math.asin(moved[0] / aside.mu2) * (1.0 + _TOUCH) + 2.0 * _LEAST
    for k in range(_PLACES - 1):
        spare = max(aside.mu2 * (math.sin(radii[k]) - _LEAST) - moved[k], 0.0)
        apart = model.v1 + max(fastest[k], fastest[k + 1]) * math.sin(radii[k])
        radii[k + 1] = radii[k] - (1.0 - _TOUCH) * step * spare / (apart + step * aside.mu2)
    tube = Tube(nearest, step, aside.dv)
    return (radii, tube) if tube_holds(model, aside, radii, tube) else None


def tube_holds(model: ErrorModel, aside: Aside, radii: FloatArray, tube: Tube) -> bool:
    """Whether alpha2 stays within the radii, between each two places of their table."""
    rho = _places(radii, tube)
    fastest = np.maximum(*(fastest_ask(model, part) for part in (rho[:-1], rho[1:]))) + aside.dv
    fall = (radii[:-1] - radii[1:]) / tube.step
    apart = model.v1 + fastest * np.sin(radii[:-1])
    outward = -aside.mu2 * np.sin(radii[1:]) + model.W / rho[:-1] + aside.du + fall * apart
    return bool(
        np.all(fall >= 0.0) and radii[0] < 0.5 * math.pi and radii[-1] > 0.0 and np.all(outward < 0.0)
    )


def _places(radii: FloatArray, tube: Tube) -> FloatArray:
    return np.asarray(tube.first + tube.step * np.arange(len(radii)), dtype=np.float64)


def fastest_ask(model: ErrorModel, rho: FloatArray) -> FloatArray:
    """Upper bound of the speed [m/s] that law (8) asks for at distances, wherever the leader heads."""
    pull = np.abs(restoring(rho, model.rho_0, model.mu_rho))
    fastest: FloatArray = (model.v1 + model.W) * (1.0 + rho * pull) + rho * model.mu1
    return fastest


def _proved(model: ErrorModel, found: _Found) -> JointSet | None:
    rhos, thetas, radii, tube = found
    outward = worst_across(rhos, thetas, len(rhos), radii, tube, model)
    if not outward < 0.0:
        return None
    far, near = int(rhos.argmax()), int(rhos.argmin())
    if not far < near:
        return None
    high = rhos[far : near + 1][::-1], thetas[far : near + 1][::-1]
    low = (np.concatenate([part[near:], part[: far + 1]]) for part in (rhos, thetas))
    below = (next(low), next(low))
    if np.any(np.diff(high[0]) < 0.0) or np.any(np.diff(below[0]) < 0.0):
        return None
    return JointSet(
        rho_min=float(rhos[near]),
        rho_max=float(rhos[far]),
        alpha1_min=ABREAST_ALPHA1 + float(thetas.min()),
        alpha1_max=ABREAST_ALPHA1 + float(thetas.max()),
        alpha2_within=float(radii[0]),
        inward=-outward,
        low=below,
        high=high,
        radii=(_places(radii, tube), radii),
    )
