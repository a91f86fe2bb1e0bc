"""How hard a leader may steer: a bracket of the k_u* that Prop. 3 of the paper says to exist.

Prop. 3: for |u1| <= k_u < k_u* a continuous periodic steering gives one exponentially stable periodic orbit
near the abreast formation. Its proof names no number; here are two, for a leader of constant speed v1.

Below ``lower`` this is proved. No motion leaves a set around the equilibrium, and in it a metric, which may
change from place to place, shrinks the length of every curve. So the map over one period has one fixed point
in the set, and all its motions approach that exponentially. The metric is searched by
:mod:`formation.contraction_metric`; :mod:`formation.contraction_proof` then proves set and metric in interval
arithmetic, along the whole boundary and over the whole set.

A quicker test, :func:`settles`, knows a constant metric only. In the set of
:func:`formation.invariant_set.invariant_set` for D = k_u the Jacobian of (5) under (8) is
J = [[0, -v c], [v f', -mu1 c]] with c = cos(theta), theta = alpha1 + pi/2. In P = [[a, b], [b, 1]] with
b = -mu1 / (2 v), the matrix P J + J^T P is negative definite if and only if (q - kappa)^2 < (mu1 / v)^2 q,
with q = f' / c and kappa = a - (mu1 / v)^2 / 2 free to choose; other b serve no better. In s = sqrt(q):
s^2 - s mu1 / v < kappa < s^2 + s mu1 / v, and one kappa serves a whole range of s if and only if
max(s) - min(s) < mu1 / v. Set and range are computed there, not enclosed. Where nothing is proved, ``lower``
is the edge of this test, and ``proved`` is false.

Above ``upper`` a counterexample is at hand. A leader that turns at -k_u for long brings the pair to the
equilibrium of that turn, or none exists (k_u >= mu_rho v1). If it then turns at +k_u and alpha1 passes the
saddle at +pi/2, the formation is lost; long holds joined by short ramps are a continuous periodic steering
that does so in every period, and no stable orbit near the formation can answer to it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from formation.contraction_metric import PathUnits, find_metric
from formation.contraction_proof import keeps, shrinks
from formation.error_set import error_set
from formation.error_set_kernels import ErrorModel
from formation.invariant_set import Disturbed, InvariantSet, invariant_set
from formation.spacing import Spacing
from formation.speed_range import SpeedRange

_RESOLUTION = 1e-4
_PARTS = 16
# A metric that only just is one is costly to prove, mostly in vain.
_BACK = 2


@dataclass(frozen=True, slots=True)
class SteeringMargin:
    """Bracket [rad/s] of k_u*: holds below ``lower``, refuted above ``upper``.

    ``proved``: whether ``lower`` is proved in intervals, rather than computed.
    """

    lower: float
    upper: float
    proved: bool


@lru_cache(maxsize=64)
def steering_margin(mu1: float, spacing: Spacing, v1: float) -> SteeringMargin:
    """Bracket of k_u* for gain mu1 [rad/s] and constant leader speed v1 [m/s]; takes some seconds.

    ``upper`` is good to 1e-4 of itself; ``lower`` is searched in sixteenths of what a constant
    metric leaves.
    """
    cap = spacing.mu_rho * v1
    settled, _ = _edge(lambda k_u: settles(_system(mu1, spacing, v1, k_u)), 0.0, cap)
    _, upper = _edge(lambda k_u: not can_be_thrown_off(_system(mu1, spacing, v1, k_u)), settled, cap)
    part = (upper - settled) / _PARTS
    low, high = 0, _PARTS
    while high - low > 1:
        middle = (low + high) // 2
        shrunk = _has_metric(_system(mu1, spacing, v1, settled + middle * part))
        low, high = (middle, high) if shrunk else (low, middle)
    for parts in range(low - 1, -1 - _BACK, -_BACK):
        k_u = settled + parts * part
        if k_u > 0.0 and settles_in_proof(mu1, spacing, v1, k_u):
            return SteeringMargin(k_u, upper, proved=True)
    return SteeringMargin(settled, upper, proved=False)


def settles_in_proof(mu1: float, spacing: Spacing, v1: float, k_u: float) -> bool:
    """Whether it is proved in intervals that a set keeps its motions, and that they approach each other."""
    model = ErrorModel(mu1, spacing.rho_0, spacing.mu_rho, v1, k_u, 0.0)
    found = error_set(model)
    if found is None or not keeps(model, found.inside):
        return False
    metric = find_metric(_units(mu1, spacing, v1, k_u), found.inside, spacing.rho_0)
    return metric is not None and shrinks(model, metric, found.inside)


def _has_metric(system: Disturbed) -> bool:
    """Whether a metric is found for the set as it is computed."""
    found, spacing = invariant_set(system), system.spacing
    units = _units(system.mu1, spacing, system.speeds.lowest, system.D)
    return found is not None and find_metric(units, found, spacing.rho_0) is not None


def _units(mu1: float, spacing: Spacing, v1: float, k_u: float) -> PathUnits:
    per_path = spacing.rho_0 / v1
    return PathUnits(spacing.mu_rho * spacing.rho_0, mu1 * per_path, k_u * per_path)


def settles(system: Disturbed) -> bool:
    """Whether a constant metric shrinks all distances in the invariant set as computed (constant speed)."""
    found = invariant_set(system)
    return found is not None and contracts(system, found)


def contracts(system: Disturbed, found: InvariantSet) -> bool:
    """Whether max(s) - min(s) < mu1 / v1 over a set, s = sqrt(f' / cos(theta)), |theta| < pi/2.

    s is largest on the boundary (for any rho it grows with |theta|) and smallest at rho_max, theta = 0.
    """
    largest = 0.0
    for rho, psi in (found.inward, found.outward):
        cosine = np.cos(psi)
        if psi.max() >= 0.5 * math.pi:
            return False
        largest = max(largest, math.sqrt(float(np.max(system.spacing.f_prime(rho) / cosine))))
    smallest = math.sqrt(system.spacing.f_prime(found.rho_max))
    return largest - smallest < system.mu1 / system.speeds.lowest


def can_be_thrown_off(system: Disturbed) -> bool:
    """Whether a swing from one constant turn at the limit to the other carries alpha1 over the saddle."""
    spacing, held = system.spacing, system.D / (system.spacing.mu_rho * system.speeds.lowest)
    if held >= 1.0:
        return True
    far, near = spacing.rho_0 / math.sqrt(1.0 - held), spacing.rho_0 / math.sqrt(1.0 + held)
    return system.escapes(far, 0.0, 1.0) or system.escapes(near, 0.0, -1.0)


def _system(mu1: float, spacing: Spacing, v1: float, k_u: float) -> Disturbed:
    return Disturbed(mu1, spacing, SpeedRange(v1, v1), k_u)


def _edge(holds: Callable[[float], bool], low: float, high: float) -> tuple[float, float]:
    """Two numbers next to each other in [low, high], of which the first still holds."""
    while high - low > _RESOLUTION * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high
