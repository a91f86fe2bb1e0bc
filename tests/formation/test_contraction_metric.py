from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from formation.contraction_metric import Metric, PathUnits, find_metric
from formation.invariant_set import Disturbed, InvariantSet, invariant_set
from formation.shape import ABREAST_ALPHA1
from formation.spacing import Spacing
from formation.speed_range import SpeedRange

MU1, SPACING, V1 = 1.5, Spacing(0.2, 20.0), 0.08


def units(k_u: float) -> PathUnits:
    return PathUnits(SPACING.mu_rho * 0.2, MU1 * 0.2 / V1, k_u * 0.2 / V1)


@cache
def held(k_u: float) -> InvariantSet:
    found = invariant_set(Disturbed(MU1, SPACING, SpeedRange(V1, V1), k_u))
    assert found is not None
    return found


@cache
def metric(k_u: float) -> Metric:
    found = find_metric(units(k_u), held(k_u), 0.2)
    assert found is not None
    return found


def matrix(found: Metric, rho: float, alpha1: float) -> np.ndarray:
    """M at a place, written out."""
    a = (0.2 / rho - found.y_0) * found.per_y
    b = (alpha1 - ABREAST_ALPHA1 - found.theta_0) * found.per_theta
    n = found.entries.shape[1]
    m11, m12, m22 = (
        sum(entry[i, j] * a**i * b**j for i in range(n) for j in range(n)) for entry in found.entries
    )
    return np.array([[m11, m12], [m12, m22]])


@pytest.mark.parametrize("k_u", [0.7, 1.15])
def test_neighbours_under_the_same_steering_approach_each_other(k_u: float) -> None:
    """scipy on the paper's (5) under (8), two motions a hair apart, any start in the set, any steering."""
    inside, found, random = held(k_u), metric(k_u), np.random.default_rng(4)

    def rates(_t: float, state: np.ndarray, u1: float) -> list[float]:
        changes = []
        for rho, alpha1 in state.reshape(2, 2).tolist():
            v2 = -V1 * math.sin(alpha1) + rho * (-MU1 * math.cos(alpha1) + V1 * SPACING.f(rho))
            changes += [-V1 * math.cos(alpha1), -u1 + (V1 * math.sin(alpha1) + v2) / rho]
        return changes

    def length(state: np.ndarray) -> float:
        first, second = state.reshape(2, 2)
        x = (second - first) * [found.w / 0.2, 1.0]
        return float(x @ matrix(found, *(0.5 * (first + second)).tolist()) @ x)

    for _ in range(60):
        rho = random.uniform(inside.rho_min, inside.rho_max)
        low, high = (float(end[0]) for end in inside.span(np.array([rho])))
        start = np.array([rho, random.uniform(low, high)])
        angle = random.uniform(0.0, math.pi)
        beside = start + 1e-5 * np.array([0.2 * math.cos(angle), math.sin(angle)])
        state, u1 = np.concatenate([start, beside]), k_u * random.choice([-1.0, 1.0, random.uniform(-1, 1)])
        after = solve_ivp(rates, (0.0, 2e-3), state, args=(u1,), rtol=1e-10, atol=1e-14).y[:, -1]
        assert 0.0 < length(after) < length(state)


def test_no_metric_is_found_where_the_set_all_but_reaches_the_saddle() -> None:
    assert find_metric(units(1.2), held(1.196), 0.2) is None


def test_the_mean_of_the_trace_is_two() -> None:
    """What is handed back is scaled, so that its coefficients say something next to each other."""
    inside, found = held(0.7), metric(0.7)
    share = 0.5 + 0.5 * np.sin(np.linspace(-0.5 * math.pi, 0.5 * math.pi, 16))
    traces = []
    for y in 0.2 / inside.rho_max + share * (0.2 / inside.rho_min - 0.2 / inside.rho_max):
        low, high = (float(end[0]) for end in inside.span(np.array([0.2 / y])))
        traces += [np.trace(matrix(found, 0.2 / y, low + part * (high - low))) for part in share]
    assert np.mean(traces) == pytest.approx(2.0, rel=1e-9)
