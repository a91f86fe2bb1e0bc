"""The best linear estimate of a velocity from a window of noisy positions, with its guaranteed error.

Positions x(t_i) are known within eps, the acceleration within A (balls in the plane, or intervals on a line).
A weighted sum of them with sum(w) = 0 and sum(w t) = 1 is free of the unknown position and velocity, and so
errs at t = 0 by no more than eps sum|w| + A integral|K|. Here K(s), the sum of w_i (s - t_i) over the t_i
before s, is what an acceleration at s adds to the sum; it is linear between samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from estimation.bounds.guarantees import guaranteed_window
from formation.angles import FloatArray

_LONGER = 1.25
_MOST_SAMPLES = 120
_FEWEST_SAMPLES = 3


@dataclass(frozen=True, slots=True, eq=False)
class WindowEstimator:
    """Weights [1/s] of the positions at ``times`` [s] (the last is 0, the present), both of shape (n,).

    ``bound``: the guaranteed error [m/s] of the weighted sum as an estimate of the velocity at time 0.
    """

    times: FloatArray
    weights: FloatArray
    bound: float


def window_estimator(eps: float, A: float, step: float) -> WindowEstimator:
    """Weights of least guaranteed error, for samples every ``step`` [s]; eps [m] and A [m/s^2] are > 0.

    Solves the linear program over a quarter more than the window that a plain difference needs, with the
    integral of |K| bounded by its chords: the result is a true bound, and exact where K keeps its sign within
    each interval. Where a window holds very many samples, only every second (third, ...) is looked at. With
    dense samples the bound comes down to 2 sqrt(eps A), which nothing that knows the past only can beat.
    """
    if not (eps > 0.0 and A > 0.0 and step > 0.0):
        raise ValueError(f"eps {eps}, A {A}, step {step}: expected positive numbers")
    span = _LONGER * float(guaranteed_window(eps, A))
    stride = max(1, math.ceil(span / step / _MOST_SAMPLES))
    n = max(_FEWEST_SAMPLES, math.ceil(span / (stride * step)) + 1)
    times = stride * step * np.arange(1.0 - n, 1.0)
    return _solve(eps, A, times)


def _solve(eps: float, A: float, times: FloatArray) -> WindowEstimator:
    """Variables: the positive parts of w, the negative parts, and |K| at the samples after the first.

    All in units of the window and of eps / window, so that the solver's tolerances fit.
    """
    from scipy.optimize import linprog  # a third of a second, for those only who solve

    n, window = len(times), -float(times[0])
    unit = times / window
    step = float(unit[1] - unit[0])
    curvature = A * window * window / eps
    kernel = np.maximum(unit[1:, np.newaxis] - unit[np.newaxis, :], 0.0)
    chords = np.full(n - 1, step)
    chords[-1] = 0.5 * step
    cost = np.concatenate([np.ones(2 * n), curvature * chords])
    above = np.hstack([kernel, -kernel, -np.eye(n - 1)])
    below = np.hstack([-kernel, kernel, -np.eye(n - 1)])
    nothing = np.zeros(n - 1)
    equations = np.vstack(
        [np.concatenate([np.ones(n), -np.ones(n), nothing]), np.concatenate([unit, -unit, nothing])]
    )
    solution = linprog(
        cost,
        A_ub=np.vstack([above, below]),
        b_ub=np.zeros(2 * (n - 1)),
        A_eq=equations,
        b_eq=[0.0, 1.0],
        method="highs",
    )
    if not solution.success:
        raise ArithmeticError(f"the linear program of the window has no solution: {solution.message}")
    found: FloatArray = np.asarray(solution.x)
    weights = (found[:n] - found[n : 2 * n]) / window
    return WindowEstimator(times, weights, guaranteed_error(eps, A, times, weights))


def guaranteed_error(eps: float, A: float, times: FloatArray, weights: FloatArray) -> float:
    """Error bound [m/s] of any weights with sum(w) = 0 and sum(w t) = 1, as in the module; times end at 0."""
    kernel = np.maximum(times[:, np.newaxis] - times[np.newaxis, :], 0.0) @ weights
    before, after, steps = kernel[:-1], kernel[1:], np.diff(times)
    size = np.abs(before) + np.abs(after)
    crossing = before * after < 0.0
    area = 0.5 * steps * size
    apart = np.where(crossing, size, 1.0)
    area = np.where(crossing, 0.5 * steps * (before * before + after * after) / apart, area)
    return float(eps * np.abs(weights).sum() + A * area.sum())
