"""Half a turn of the pair about its equilibrium under the worst disturbance, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.kernel import entry, kernel
from formation.records import Vector
from formation.spacing import restoring

LONGEST = 40_000
"""Points that a curve handed to :func:`half_turn` must have room for."""
ESCAPED = -1
UNFINISHED = -2

_FINE = 0.004
_NEAR_NODE = 1e-3
"""Of rho_0. So close to an equilibrium the motion is linear, and the rest of its way a straight line."""


class WorstCase(NamedTuple):
    """The reduced system (5) under law (8), its leader's speeds [m/s], and the bound ``worst`` [rad/s].

    ``side``: +1 towards shorter distances, -1 towards longer ones.
    """

    side: float
    v_min: float
    v_max: float
    mu1: float
    rho_0: float
    mu_rho: float
    worst: float


class Slopes(NamedTuple):
    """d(rho) and d(psi) per metre that the leader drives."""

    rho: float
    psi: float


@kernel
def _slopes(system: WorstCase, rho: float, psi: float) -> Slopes:
    sine = math.sin(psi)
    push = system.worst - system.mu1 * sine
    speed = system.v_min if push > 0.0 else system.v_max
    pull = restoring(rho, system.rho_0, system.mu_rho)
    return Slopes(-system.side * sine, system.side * pull + push / speed)


@entry
def half_turn(rhos: Vector, psis: Vector, rho: float, psi: float, system: WorstCase) -> int:
    """Follow the outermost motion from (rho, psi) until psi is back at 0; fill the curve, return its length.

    psi = side (alpha1 + pi/2) is in [0, pi). Reduced system (5) under law (8), with the path
    of the leader in the place of time and a disturbance of alpha1_dot within ``worst`` that pushes outwards
    all the time; the leader's speed is whichever of [v_min, v_max] pushes most. RK4 with steps that are short
    against the distance and both time constants. A motion that creeps into the equilibrium of a constant
    disturbance ends in it. Returns ``ESCAPED`` if psi reaches pi, where the follower would be on the leader's
    other side, or the robots drift apart, and ``UNFINISHED`` if the curve has no room left.
    """
    side, rho_0, mu_rho, v_min = system.side, system.rho_0, system.mu_rho, system.v_min
    stiffness = 1.0 + side * system.worst / (v_min * mu_rho)
    node = rho_0 / math.sqrt(stiffness) if stiffness > 0.0 else math.inf
    damping, slope = system.mu1 / v_min, 2.0 * mu_rho * (rho_0 / node) * (rho_0 / node) / node
    creeps = damping * damping >= 4.0 * slope
    rhos[0], psis[0] = rho, psi
    for n in range(1, LONGEST):
        oscillation = rho * math.sqrt(0.5 * rho / mu_rho) / rho_0
        h = _FINE * min(rho, 2.0 * oscillation, 25.0 / damping)
        r1, p1 = _slopes(system, rho, psi)
        r, p = rho + 0.5 * h * r1, psi + 0.5 * h * p1
        r2, p2 = _slopes(system, r, p)
        r, p = rho + 0.5 * h * r2, psi + 0.5 * h * p2
        r3, p3 = _slopes(system, r, p)
        r, p = rho + h * r3, psi + h * p3
        r4, p4 = _slopes(system, r, p)
        before, was = rho, psi
        rho += h * (r1 + 2.0 * r2 + 2.0 * r3 + r4) / 6.0
        psi += h * (p1 + 2.0 * p2 + 2.0 * p3 + p4) / 6.0
        if not (psi < math.pi and 0.01 * rho_0 < rho < 100.0 * rho_0):
            return ESCAPED
        if psi <= 0.0:
            rhos[n], psis[n] = before + was / (was - psi) * (rho - before), 0.0
            return n + 1
        gap = side * (rho - node)
        # Slower than half the damping allows it cannot overshoot: the fast direction is steeper.
        if creeps and 0.0 < gap < _NEAR_NODE * rho_0 and psi < 0.5 * damping * gap:
            rhos[n], psis[n] = node, 0.0
            return n + 1
        rhos[n], psis[n] = rho, psi
    return UNFINISHED
