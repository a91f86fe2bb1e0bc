"""Where a pair stays, whatever its leader steers: the invariant set of the reduced system under law (8).

With theta = alpha1 + pi/2 the reduced system (5) under law (8) is rho_dot = -v1 sin(theta) and
theta_dot = -mu1 sin(theta) + v1 f(rho) + d, where d is the leader's -u1 and whatever else disturbs alpha1.
Per metre of the leader's path, rho' = -sin(theta) does not depend on d or v1, and
theta' = f(rho) + (d - mu1 sin(theta)) / v1 does. At every point the motion that turns outwards most is the
one with d = D sign(sin(theta)), that is d = D sign(cos(alpha1)), and with the lowest speed while this push
outweighs the damping, else the highest. No motion crosses the path of that outermost one from the inside.
Where it closes to a cycle, the inside of the cycle is forward-invariant.

A half of the cycle may end in the equilibrium that a constant d = -+D has: then this is a corner of the set.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray, wrap
from formation.shape import ABREAST_ALPHA1
from formation.spacing import Spacing
from formation.speed_range import SpeedRange
from formation.worst_case_kernels import ESCAPED, LONGEST, WorstCase, half_turn

_HALF_TURNS = 2000
_CLOSED = 1e-9
_RIGHT, _LEFT = 1.0, -1.0


@dataclass(frozen=True, slots=True)
class Disturbed:
    """The reduced system under law (8): gain mu1 [rad/s], spacing, speeds, and the bound D [rad/s] of |d|."""

    mu1: float
    spacing: Spacing
    speeds: SpeedRange
    D: float

    def half_turn(self, rho: float, psi: float, side: float) -> tuple[FloatArray, FloatArray] | None:
        """Curve (rho, psi) of the outermost motion from psi = side * theta >= 0 to psi = 0.

        Towards shorter distances for side +1, towards longer ones for -1. None if it escapes, or is too slow
        to be followed.
        """
        count, rhos, psis = self._follow(rho, psi, side)
        return (rhos[:count], psis[:count]) if count > 0 else None

    def escapes(self, rho: float, psi: float, side: float) -> bool:
        """Whether that motion passes alpha1 = +pi/2, or the robots drift apart."""
        return self._follow(rho, psi, side)[0] == ESCAPED

    def _follow(self, rho: float, psi: float, side: float) -> tuple[int, FloatArray, FloatArray]:
        rhos, psis = np.empty(LONGEST), np.empty(LONGEST)
        speeds, spacing = self.speeds, self.spacing
        system = WorstCase(
            side, speeds.lowest, speeds.highest, self.mu1, spacing.rho_0, spacing.mu_rho, self.D
        )
        count = half_turn(rhos, psis, rho, psi, system)
        return count, rhos, psis


@dataclass(frozen=True, slots=True, eq=False)
class InvariantSet:
    """What the worst-case cycle encloses: extremes of rho [m] and alpha1 [rad], and the boundary.

    ``inward`` and ``outward``: the halves of the boundary on which rho falls (alpha1 above -pi/2) and rises,
    each as curves (rho, |alpha1 + pi/2|) of shape (n,), rho increasing.
    """

    rho_min: float
    rho_max: float
    alpha1_min: float
    alpha1_max: float
    inward: tuple[FloatArray, FloatArray] = field(repr=False)
    outward: tuple[FloatArray, FloatArray] = field(repr=False)

    def contains(self, rho: FloatArray, alpha1: FloatArray, slack: float = 0.0) -> NDArray[np.bool_]:
        """Which points lie inside, as booleans; ``slack`` widens the set in rho [m] and alpha1 [rad]."""
        theta = wrap(np.asarray(alpha1) - ABREAST_ALPHA1)
        inside = (rho >= self.rho_min - slack) & (rho <= self.rho_max + slack)
        # The boundary is upright at its ends: there it is the slack in rho that matters.
        beside = (rho - slack, rho + slack)
        inside &= theta <= np.maximum(*(_width(self.inward, near) for near in beside)) + slack
        inside &= theta >= -np.maximum(*(_width(self.outward, near) for near in beside)) - slack
        return np.asarray(inside, dtype=np.bool_)

    def span(self, rho: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest alpha1 [rad] in the set at distances within it."""
        return ABREAST_ALPHA1 - _width(self.outward, rho), ABREAST_ALPHA1 + _width(self.inward, rho)


def invariant_set(system: Disturbed) -> InvariantSet | None:
    """Smallest invariant set around the abreast equilibrium, or None if the outermost motion never closes.

    The boundary is the limit of the outermost motion that begins at the equilibrium, found by following half
    turns until they repeat to 1e-9 of rho_0; its points are good to about 1e-6 rho_0.
    """
    rho_max = system.spacing.rho_0
    for _ in range(_HALF_TURNS):
        inward = system.half_turn(rho_max, 0.0, _RIGHT)
        outward = None if inward is None else system.half_turn(float(inward[0][-1]), 0.0, _LEFT)
        if inward is None or outward is None:
            return None
        before, rho_max = rho_max, float(outward[0][-1])
        if abs(rho_max - before) <= _CLOSED * system.spacing.rho_0:
            return InvariantSet(
                rho_min=float(inward[0][-1]),
                rho_max=rho_max,
                alpha1_min=ABREAST_ALPHA1 - _peak(outward[1]),
                alpha1_max=ABREAST_ALPHA1 + _peak(inward[1]),
                inward=(inward[0][::-1], inward[1][::-1]),
                outward=outward,
            )
    return None


def _width(curve: tuple[FloatArray, FloatArray], rho: FloatArray) -> FloatArray:
    """|alpha1 + pi/2| of a half of the boundary. Its square is smooth: the curve has round ends."""
    rhos, psis = curve
    width: FloatArray = np.sqrt(np.interp(rho, rhos, psis * psis))
    return width


def _peak(psis: FloatArray) -> float:
    """Height of the parabola through the highest point of a curve and its neighbours."""
    top = int(psis.argmax())
    if not 0 < top < len(psis) - 1:
        return float(psis[top])
    before, peak, after = psis[top - 1 : top + 2].tolist()
    bend = before - 2.0 * peak + after
    return float(peak - 0.125 * (after - before) ** 2 / bend) if bend < 0.0 else float(peak)
