"""What can be guaranteed from noise bounds and limits alone: rates, the leader's acceleration, alpha2."""

from __future__ import annotations

import math

import numpy as np

from estimation.bounds.error_bounds import Values
from formation.angles import FloatArray


def leader_acceleration(k_v: Values, k_u: Values, v1_dot: Values = 0.0) -> FloatArray:
    """Largest acceleration [m/s^2] of a leader with v1 <= k_v, |u1| <= k_u and |dv1/dt| <= v1_dot.

    Along its heading it accelerates by dv1/dt, across by v1 u1; the two are at right angles.
    """
    bound: FloatArray = np.hypot(np.asarray(k_v) * k_u, v1_dot)
    return bound


def guaranteed_rate(eps: Values, A: Values) -> FloatArray:
    """2 sqrt(eps A): the rate error, per axis, that noise within eps and acceleration within A force at most.

    A difference over the window T errs by 2 eps / T through noise and by A T / 2 through curvature; the sum
    is least at T = 2 sqrt(eps / A), where both are sqrt(eps A). No causal estimator does better in the worst
    case (the inequality of Landau for the half-line). Assumes samples dense enough to realise that window.
    """
    bound: FloatArray = 2.0 * np.sqrt(np.asarray(eps) * A)
    return bound


def guaranteed_window(eps: Values, A: Values) -> FloatArray:
    """Window T = 2 sqrt(eps / A) [s] over which a plain difference attains :func:`guaranteed_rate`; A > 0."""
    bound: FloatArray = 2.0 * np.sqrt(np.asarray(eps) / A)
    return bound


def alpha2_ultimate(M_alpha2: Values, mu2: Values) -> FloatArray:
    """Ultimate bound arcsin(M_alpha2 / mu2) [rad] of |alpha2 - pi/2|; infinite (none) for M_alpha2 >= mu2.

    With e = alpha2 - pi/2 the steering law leaves e_dot = -mu2 sin(e) + d, |d| <= M_alpha2: |e| falls as long
    as sin|e| > M_alpha2 / mu2. Holds for every start with |e| < pi - arcsin(M_alpha2 / mu2). A d that
    outweighs mu2 can turn alpha2 round and round.
    """
    disturbance, gain = np.broadcast_arrays(np.asarray(M_alpha2), np.asarray(mu2))
    held = disturbance < gain
    ratio = np.where(held, disturbance, 0.0) / np.where(held, gain, 1.0)
    return np.where(held, np.arcsin(ratio), math.inf)
