from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import linprog, minimize_scalar

from estimation.bounds.guarantees import (
    alpha2_ultimate,
    guaranteed_rate,
    guaranteed_window,
    leader_acceleration,
)
from formation.angles import FloatArray

EPS, ACCELERATION = 3e-4, 0.07


def test_leader_acceleration_is_the_largest_that_a_unicycle_within_its_limits_has() -> None:
    generator = np.random.default_rng(1)
    v1, u1 = generator.uniform(0.0, 0.1, 5000), generator.uniform(-0.7, 0.7, 5000)
    v1_dot = generator.uniform(-0.05, 0.05, 5000)
    theta = generator.uniform(-math.pi, math.pi, 5000)
    x = v1_dot * np.cos(theta) - v1 * u1 * np.sin(theta)
    y = v1_dot * np.sin(theta) + v1 * u1 * np.cos(theta)
    largest = float(np.max(np.hypot(x, y)))
    bound = float(leader_acceleration(0.1, 0.7, 0.05))
    assert 0.95 * bound < largest <= bound
    assert leader_acceleration(0.1, 0.7) == pytest.approx(0.07)


def test_the_window_is_where_a_plain_difference_errs_least() -> None:
    least = minimize_scalar(
        lambda window: 2.0 * EPS / window + 0.5 * ACCELERATION * window,
        bounds=(1e-3, 1.0),
        options={"xatol": 1e-12},
    )
    assert guaranteed_window(EPS, ACCELERATION) == pytest.approx(least.x, rel=1e-5)
    assert guaranteed_rate(EPS, ACCELERATION) == pytest.approx(least.fun, rel=1e-9)


def largest_hidden_rate(window: float, steps: int = 400) -> float:
    """Largest present rate of a motion that noise can hide: |x| <= eps at all samples, |x''| <= A between."""
    dt = window / steps
    # Unknowns: present rate, present position, accelerations held over the steps into the past.
    position = np.zeros((steps + 1, steps + 2))
    position[:, 1] = 1.0
    age = dt * np.arange(steps + 1)
    position[:, 0] = -age
    for step in range(steps):
        position[step + 1 :, step + 2] = dt * (age[step + 1 :] - (step + 0.5) * dt)
    limits = [(None, None), (None, None)] + [(-ACCELERATION, ACCELERATION)] * steps
    worst = linprog(
        np.r_[-1.0, np.zeros(steps + 1)],
        A_ub=np.vstack([position, -position]),
        b_ub=np.full(2 * (steps + 1), EPS),
        bounds=limits,
    )
    assert worst.fun is not None, worst.message
    return -float(worst.fun)


def test_no_estimator_can_guarantee_a_smaller_rate_error() -> None:
    window = float(guaranteed_window(EPS, ACCELERATION))
    hidden = [largest_hidden_rate(factor * window) for factor in (0.5, 1.0, 3.0)]
    bound = float(guaranteed_rate(EPS, ACCELERATION))
    assert hidden[0] > 1.2 * bound
    assert hidden[1:] == pytest.approx([bound, bound], rel=1e-3)


@pytest.mark.parametrize("start", [-2.5, -0.5, 0.0, 1.0, 2.5])
def test_alpha2_ends_within_its_ultimate_bound_and_reaches_it(start: float) -> None:
    M_alpha2, mu2 = 0.6, 2.0
    bound = float(alpha2_ultimate(M_alpha2, mu2))

    def constant(_t: float, alpha2: FloatArray) -> FloatArray:
        rate: FloatArray = mu2 * np.cos(alpha2) + M_alpha2
        return rate

    def switching(t: float, alpha2: FloatArray) -> FloatArray:
        rate: FloatArray = mu2 * np.cos(alpha2) + M_alpha2 * math.copysign(1.0, math.sin(1.7 * t))
        return rate

    settled = solve_ivp(constant, (0.0, 20.0), [math.pi / 2 + start], rtol=1e-10, atol=1e-12)
    assert settled.y[0, -1] - math.pi / 2 == pytest.approx(bound, abs=1e-8)
    moving = solve_ivp(switching, (0.0, 40.0), [math.pi / 2 + start], rtol=1e-8, max_step=0.05)
    late = np.abs(moving.y[0, moving.t > 20.0] - math.pi / 2)
    assert 0.5 * bound < np.max(late) <= bound


def test_a_disturbance_that_outweighs_the_gain_leaves_no_bound() -> None:
    bounds = alpha2_ultimate(np.array([0.0, 1.0, 2.0, 3.0]), 2.0)
    assert bounds == pytest.approx([0.0, math.pi / 6, math.inf, math.inf])
