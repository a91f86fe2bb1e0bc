"""The extended bounds of one moment: what estimates go out with, and what arrays of moments are made of.

:mod:`estimation.bounds.error_bounds` tells what is bounded and why.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.kernel import kernel
from formation.spacing import Spacing, restoring
from formation.station import ABREAST, Station
from formation.wrapping import wrapped


class Moment(NamedTuple):
    """What the follower believes and the bounds need, as in ``Perceived``."""

    rho: float
    alpha2: float
    alpha2_dot: float
    v1: float
    alpha1: float
    v2: float
    u2: float


class ErrorBounds(NamedTuple):
    """Bounds of all errors that go into an estimate, as in ``RateErrors`` and ``InputErrors``."""

    M_rho: float
    M_alpha2: float
    E_rho: float
    E_alpha2: float
    E_v2: float
    E_u2: float


class LawConstants(NamedTuple):
    """What the bounds need of the leader's limits and the law.

    v_eps [m/s], mu1 [rad/s]; rho_0 [m] and mu_rho [1/m] of the spacing; ``to_abreast`` [rad] of the station.
    """

    v_eps: float
    mu1: float
    rho_0: float
    mu_rho: float
    to_abreast: float

    @staticmethod
    def of(v_eps: float, mu1: float, spacing: Spacing, station: Station = ABREAST) -> LawConstants:
        """Record of these."""
        return LawConstants(v_eps, mu1, spacing.rho_0, spacing.mu_rho, station.to_abreast)


class MomentBounds(NamedTuple):
    """Extended bounds of the errors of v1 [m/s], alpha1 [rad] and h [rad/s]."""

    v1: float
    alpha1: float
    h: float


@kernel
def cosine_change(angle: float, span: float) -> float:
    """Largest |cos(x) - cos(angle)| over |x - angle| <= span; span in [0, pi].

    Fold the angle to [0, pi / 2]: what lies beyond is its mirror, with the same changes. There the cosine
    falls, and away from zero by more than towards it, until it is cut off at pi. The product form keeps its
    digits when the span is tiny.
    """
    folded = abs(wrapped(angle))
    near = min(folded, math.pi - folded)
    far = min(near + span, math.pi)
    return 2.0 * math.sin(0.5 * (far + near)) * math.sin(0.5 * (far - near))


@kernel
def _length(x: float, y: float) -> float:
    return math.sqrt(x * x + y * y)


@kernel
def subtended(radius: float, v1: float, v_eps: float) -> float:
    """Half angle under which a disc of this radius is seen over max(v1, v_eps); pi from within."""
    longest = max(v1, v_eps)
    return math.asin(radius / longest) if radius < longest else math.pi


@kernel
def motion_error(seen: Moment, errors: ErrorBounds) -> float:
    """Largest error of v2 (cos(alpha2), sin(alpha2)) [m/s]; exact.

    The square of the chord, (v2 - v2_hat)^2 + 4 v2 v2_hat sin^2((alpha2 - alpha2_hat)/2), is convex in v2 and
    so is largest at |v2| = |v2_hat| + E_v2.
    """
    speed = abs(seen.v2)
    half = math.sin(0.5 * min(errors.E_alpha2, math.pi))
    return _length(errors.E_v2, 2.0 * half * math.sqrt(speed * (speed + errors.E_v2)))


@kernel
def bounds_at(seen: Moment, errors: ErrorBounds, law: LawConstants) -> MomentBounds:
    """Extended bounds of one moment; of h infinite for E_rho >= rho."""
    rho, motion = seen.rho, motion_error(seen, errors)
    turn, turn_error = abs(seen.alpha2_dot + seen.u2), errors.M_alpha2 + errors.E_u2
    m_y = errors.E_rho * (turn + turn_error) + rho * turn_error
    v1 = _length(errors.M_rho, m_y) + motion
    alpha1 = subtended(v1, seen.v1, law.v_eps)
    lo = rho - errors.E_rho
    if not lo > 0.0:
        return MomentBounds(v1, alpha1, math.inf)
    stretch = errors.E_rho / lo
    # Near pi/2 the error of v2 sin(alpha2) alone is much less than that of the whole vector.
    aside = cosine_change(seen.alpha2 - 0.5 * math.pi, min(errors.E_alpha2, math.pi))
    sideways = min(errors.E_v2 + abs(seen.v2) * aside, motion)
    line = turn_error + stretch * turn + sideways / lo
    off = seen.alpha1 + law.to_abreast
    bearing = law.mu1 * (cosine_change(off, alpha1) + stretch * abs(math.cos(off)))
    f_lo = restoring(lo, law.rho_0, law.mu_rho)
    f_hat = restoring(rho, law.rho_0, law.mu_rho)
    f_hi = restoring(rho + errors.E_rho, law.rho_0, law.mu_rho)
    f_change = max(f_hat - f_lo, f_hi - f_hat)
    distance = v1 * max(abs(f_lo), abs(f_hi)) + seen.v1 * (f_change + stretch * abs(f_hat))
    return MomentBounds(v1, alpha1, line + bearing + distance)
