"""A metric in which all motions of the reduced system approach each other, by semidefinite programming.

Along the leader's path in units of rho_0, with y = rho_0 / rho and theta = alpha1 + pi/2, the reduced system
(5) under law (8) is rho' / rho_0 = -sin(theta), theta' = lam (1 - y^2) - mu sin(theta) + d, |d| <= D. Two
motions a little apart, by x = (w rho / rho_0, theta), draw together in the metric M(y, theta) where

    M' + M J + J^T M < 0,  J = [[0, -w cos(theta)], [(2 lam / w) y^3, -mu cos(theta)]],

M' being the change of M along the motion. That is linear in d: it holds for all d if it does for -D and D.
It is linear in M as well: with the entries of M polynomials, the best coefficients at a grid of places are
found by Newton's method under a logarithmic barrier. Nothing is proved here; that is the part of
:mod:`formation.contraction_proof`, between the places too.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, LinAlgWarning, solve

from formation.angles import FloatArray
from formation.invariant_set import InvariantSet
from formation.shape import ABREAST_ALPHA1

DEGREE = 6
_PLACES = 16
_NEWTON = 150
_SHARPER = 4.0
_CENTRED = 0.1
_PREFERS_SMALL = 1e-3
_INSIDE = 0.7


class PathUnits(NamedTuple):
    """The system in units of rho_0 along the leader's path: mu_rho rho_0, mu1 rho_0 / v1, k_u rho_0 / v1."""

    lam: float
    mu: float
    D: float


@dataclass(frozen=True, slots=True, eq=False)
class Metric:
    """Entries M11, M12, M22 as polynomials in a = (y - y_0) per_y and b = (theta - theta_0) per_theta.

    ``entries`` of shape (3, n, n): coefficient of a^i b^j, zero for i + j >= n. ``w``: the scale of x.
    """

    entries: FloatArray
    y_0: float
    per_y: float
    theta_0: float
    per_theta: float
    w: float


def find_metric(units: PathUnits, inside: InvariantSet, rho_0: float) -> Metric | None:
    """The metric that shrinks distances fastest over a set, or None if no polynomial does at all places."""
    y, theta = _places(inside, rho_0)
    entries, w = np.zeros((3, DEGREE + 1, DEGREE + 1)), max(math.sqrt(2.0 * units.lam), 0.5 * units.mu)
    metric = Metric(entries, *_scaled(y), *_scaled(theta), w)
    powers = [(i, j) for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    found = _most_negative(_conditions(units, metric, powers, y, theta), len(powers), len(y))
    if found is None:
        return None
    rows, columns = np.array(powers).T
    entries[:, rows, columns] = found.reshape(3, -1)
    return metric


def _places(inside: InvariantSet, rho_0: float) -> tuple[FloatArray, FloatArray]:
    """Grid over the set, closer towards its edge, edge included; arrays of one shape (n,)."""
    share = 0.5 + 0.5 * np.sin(np.linspace(-0.5 * math.pi, 0.5 * math.pi, _PLACES))
    nearest, farthest = rho_0 / inside.rho_max, rho_0 / inside.rho_min
    y = (1.0 - share) * nearest + share * farthest
    lowest, highest = inside.span(rho_0 / y)
    theta = lowest[:, np.newaxis] + (highest - lowest)[:, np.newaxis] * share - ABREAST_ALPHA1
    return np.repeat(y, _PLACES), theta.ravel()


def _scaled(values: FloatArray) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    return 0.5 * (low + high), 2.0 / (high - low)


def _conditions(
    units: PathUnits, metric: Metric, powers: list[tuple[int, int]], y: FloatArray, theta: FloatArray
) -> FloatArray:
    """Linear maps from (coefficients, t) to matrices (11, 12, 22) that must be positive; (3 n, 3, 3 k + 1).

    -(M' + M J + J^T M) - t for both d at all places, then M.
    """
    a, b = (y - metric.y_0) * metric.per_y, (theta - metric.theta_0) * metric.per_theta
    basis = np.stack([a**i * b**j for i, j in powers], axis=1)
    by_y = metric.per_y * np.stack([i * a ** max(i - 1, 0) * b**j for i, j in powers], axis=1)
    by_theta = metric.per_theta * np.stack([j * a**i * b ** max(j - 1, 0) for i, j in powers], axis=1)
    sine, cosine, w = np.sin(theta), np.cos(theta), metric.w
    j12, j21, j22 = -w * cosine, 2.0 * units.lam / w * y * y * y, -units.mu * cosine
    n, k = basis.shape
    maps = np.zeros((3, n, 3, 3 * k + 1))
    first, second, third = slice(0, k), slice(k, 2 * k), slice(2 * k, 3 * k)

    def times(factor: FloatArray) -> FloatArray:
        product: FloatArray = factor[:, np.newaxis] * basis
        return product

    for q, d in zip(maps, (-units.D, units.D), strict=False):
        turned = units.lam * (1.0 - y * y) - units.mu * sine + d
        moved = by_y * (y * y * sine)[:, np.newaxis] + by_theta * turned[:, np.newaxis]
        q[:, 0, first], q[:, 0, second] = -moved, -times(2.0 * j21)
        q[:, 1, first], q[:, 1, second], q[:, 1, third] = -times(j12), -moved - times(j22), -times(j21)
        q[:, 2, second], q[:, 2, third] = -times(2.0 * j12), -moved - times(2.0 * j22)
        q[:, 0, -1] = q[:, 2, -1] = -1.0
    for entry, part in enumerate((first, second, third)):
        maps[2, :, entry, part] = basis
    return maps.reshape(3 * n, 3, 3 * k + 1)


def _most_negative(maps: FloatArray, k: int, n: int) -> FloatArray | None:
    """Coefficients (3 k,) with the largest t, the mean of M's trace being 2; None if t is not positive."""
    size = 3 * k + 1
    trace = np.zeros(size)
    trace[:k] = trace[2 * k : 3 * k] = maps[2 * n :, 0, :k].mean(axis=0)
    x = np.zeros(size)
    x[0] = x[2 * k] = 1.0
    x[-1] = float(_least(maps[: 2 * n] @ x).min()) - 1.0
    weight = 1.0
    for _ in range(_NEWTON):
        step, left = _newton_step(maps, trace, x, weight)
        if step is None:
            return None
        length, along = 1.0, maps @ step
        now = maps @ x
        while not _positive(now + length * along):
            length *= _INSIDE
        x = x + (length if length == 1.0 else _INSIDE * length) * step
        gap = 6.0 * n / weight
        if left < _CENTRED:
            if x[-1] + gap < 0.0:
                return None
            if gap < max(0.1 * abs(float(x[-1])), 1e-4):
                break
            weight *= _SHARPER
    return x[:-1] if x[-1] > 0.0 else None


def _newton_step(
    maps: FloatArray, trace: FloatArray, x: FloatArray, weight: float
) -> tuple[FloatArray | None, float]:
    """Step of -weight t - sum of log det under the fixed trace, and how much it promises."""
    s11, s12, s22 = np.moveaxis(maps @ x, 1, 0)
    det = s11 * s22 - s12 * s12
    inverse = np.stack([s22 / det, -s12 / det, s11 / det])
    gradient = -np.einsum("en,nek->k", inverse * np.array([[1.0], [2.0], [1.0]]), maps)
    gradient[-1] -= weight
    gradient += _PREFERS_SMALL * x
    # Congruence by a root of the inverse makes the second derivative a sum of squares.
    l11 = np.sqrt(inverse[0])
    l21 = inverse[1] / l11
    l22 = np.sqrt(np.maximum(inverse[2] - l21 * l21, 0.0))
    e11, e12, e22 = np.moveaxis(maps, 1, 0)

    def by(factor: FloatArray, entry: FloatArray) -> FloatArray:
        product: FloatArray = factor[:, np.newaxis] * entry
        return product

    turned = np.concatenate(
        [
            by(l11 * l11, e11) + by(2.0 * l11 * l21, e12) + by(l21 * l21, e22),
            math.sqrt(2.0) * (by(l11 * l22, e12) + by(l21 * l22, e22)),
            by(l22 * l22, e22),
        ]
    )
    size = len(x)
    system = np.zeros((size + 1, size + 1))
    system[:size, :size] = turned.T @ turned + _PREFERS_SMALL * np.eye(size)
    system[size, :size] = system[:size, size] = trace
    try:
        with warnings.catch_warnings():
            # A step that is off costs a metric at worst: what is proved by one is proved afterwards.
            warnings.simplefilter("ignore", LinAlgWarning)
            step: FloatArray = solve(system, np.append(-gradient, 0.0), assume_a="sym")[:size]
    except LinAlgError:
        return None, 0.0
    return step, float(-gradient @ step)


def _least(entries: FloatArray) -> FloatArray:
    """Lesser eigenvalues of symmetric matrices given as (11, 12, 22) along the last axis."""
    half = 0.5 * (entries[:, 0] - entries[:, 2])
    least: FloatArray = 0.5 * (entries[:, 0] + entries[:, 2]) - np.hypot(half, entries[:, 1])
    return least


def _positive(entries: FloatArray) -> bool:
    return bool(np.all((entries[:, 0] > 0.0) & (entries[:, 0] * entries[:, 2] > entries[:, 1] ** 2)))
