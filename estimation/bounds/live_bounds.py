"""The extended bounds for one moment in plain floats, for live use.

The formulas are those of :mod:`estimation.bounds.error_bounds`.
An estimator bounds every estimate as it is made; arrays of one element would cost it ten times as much.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from formation.angles import wrap
from formation.spacing import Spacing
from formation.station import ABREAST, Station


@dataclass(frozen=True, slots=True)
class ErrorBounds:
    """Bounds of all errors that go into an estimate, as in ``RateErrors`` and ``InputErrors``."""

    M_rho: float
    M_alpha2: float
    E_rho: float
    E_alpha2: float
    E_v2: float
    E_u2: float


@dataclass(frozen=True, slots=True)
class LawConstants:
    """What the bounds need of the leader's limits and the law: v_eps [m/s], mu1 [rad/s], spacing, station."""

    v_eps: float
    mu1: float
    spacing: Spacing
    station: Station = ABREAST


def live_bounds(
    shape: tuple[float, float],
    leader: tuple[float, float],
    follower: tuple[float, float],
    alpha2_dot: float,
    errors: ErrorBounds,
    law: LawConstants,
) -> tuple[float, float, float]:
    """Extended bounds of v1 [m/s], alpha1 [rad] and h [rad/s]; see ``extended_v1``, ``_alpha1`` and ``_h``.

    ``shape``: (rho, alpha2). ``leader``: (v1, alpha1). ``follower``: (v2, u2), as measured. All as believed.
    """
    (rho, alpha2), (v1, alpha1), (v2, u2) = shape, leader, follower
    turn, turn_error = abs(alpha2_dot + u2), errors.M_alpha2 + errors.E_u2
    m_y = errors.E_rho * (turn + turn_error) + rho * turn_error
    half = math.sin(0.5 * min(errors.E_alpha2, math.pi))
    motion = math.hypot(errors.E_v2, 2.0 * half * math.sqrt(abs(v2) * (abs(v2) + errors.E_v2)))
    v1_error = math.hypot(errors.M_rho, m_y) + motion
    longest = max(v1, law.v_eps)
    alpha1_error = math.asin(v1_error / longest) if v1_error < longest else math.pi
    if rho <= errors.E_rho:
        return v1_error, alpha1_error, math.inf
    lo = rho - errors.E_rho
    stretch = errors.E_rho / lo
    f_lo, f_hat, f_hi = (law.spacing.f(r) for r in (lo, rho, rho + errors.E_rho))
    sideways = errors.E_v2 + abs(v2) * _cosine_change(alpha2 - 0.5 * math.pi, min(errors.E_alpha2, math.pi))
    line = turn_error + stretch * turn + min(sideways, motion) / lo
    off = alpha1 + law.station.to_abreast
    bearing = law.mu1 * (_cosine_change(off, alpha1_error) + stretch * abs(math.cos(off)))
    distance = v1_error * max(abs(f_lo), abs(f_hi))
    distance += v1 * (max(f_hat - f_lo, f_hi - f_hat) + stretch * abs(f_hat))
    return v1_error, alpha1_error, line + bearing + distance


def _cosine_change(angle: float, span: float) -> float:
    """Largest change of the cosine within ``span`` of ``angle``, as ``error_bounds.cosine_change``."""
    folded = abs(wrap(angle))
    near, far = max(folded - span, 0.0), min(folded + span, math.pi)
    rise = 2.0 * math.sin(0.5 * (folded + near)) * math.sin(0.5 * (folded - near))
    fall = 2.0 * math.sin(0.5 * (far + folded)) * math.sin(0.5 * (far - folded))
    return max(rise, fall)
