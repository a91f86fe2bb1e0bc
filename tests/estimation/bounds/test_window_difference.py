from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from estimation.bounds.guarantees import guaranteed_rate, guaranteed_window
from estimation.bounds.window_difference import best_difference, best_line

noises, accelerations = st.floats(1e-4, 0.1), st.floats(0.01, 5.0)


def test_dense_samples_attain_the_guaranteed_rate() -> None:
    dense = best_difference(1.5e-3, 0.07, 0.001)
    assert dense.error == pytest.approx(float(guaranteed_rate(1.5e-3, 0.07)), rel=1e-5)


@given(eps=noises, acceleration=accelerations, step=st.floats(1e-3, 0.5))
def test_what_looks_like_rest_may_move_that_fast(eps: float, acceleration: float, step: float) -> None:
    """The worst motion, built: no estimator that sees these samples can tell it from rest."""
    speed = best_difference(eps, acceleration, step).error
    t = -step * np.arange(0.0, 2.0 * speed / acceleration / step + 1.0)
    t = t[t >= -2.0 * speed / acceleration]
    seen = eps + speed * t + 0.5 * acceleration * t * t
    assert np.abs(seen).max() <= eps * (1.0 + 1e-9)


@given(eps=noises, acceleration=accelerations, step=st.floats(1e-3, 0.5), seed=st.integers(0, 99))
def test_no_noise_and_no_acceleration_break_the_bound(
    eps: float, acceleration: float, step: float, seed: int
) -> None:
    samples, error = best_difference(eps, acceleration, step)
    random, fine = np.random.default_rng(seed), 50
    dt = samples * step / fine
    push = random.uniform(-acceleration, acceleration, fine)
    speed, travelled = random.normal(), 0.0
    for each in push:
        travelled += speed * dt + 0.5 * each * dt * dt
        speed += each * dt
    noise = random.uniform(-eps, eps, 2)
    measured = (travelled + noise[1] - noise[0]) / (samples * step)
    assert abs(measured - speed) <= error * (1.0 + 1e-9) + 1e-12


@settings(max_examples=20, deadline=None)
@given(eps=noises, acceleration=accelerations, samples=st.floats(0.4, 60.0))
def test_no_weights_of_a_longer_window_do_better(eps: float, acceleration: float, samples: float) -> None:
    window = float(guaranteed_window(eps, acceleration))
    step = window / samples
    count = int(np.ceil(1.25 * samples)) + 2
    found = best_difference(eps, acceleration, step)
    assert found.error == pytest.approx(least_error(eps, acceleration, step, count), rel=1e-6)


def least_error(eps: float, acceleration: float, step: float, count: int) -> float:
    """Least guaranteed error of all weighted sums of so many positions, as a linear program.

    Weights w with sum(w) = 0 and sum(w t) = 1 err by eps sum|w| + A integral|K|, K(s) being the sum of
    w (s - t) over the t before s. |K| is taken by its chords, in units of the window.
    """
    unit = np.linspace(-1.0, 0.0, count)
    window, width = (count - 1) * step, unit[1] - unit[0]
    chords = np.full(count - 1, width)
    chords[-1] = 0.5 * width
    cost = np.concatenate([np.ones(2 * count), acceleration * window * window / eps * chords])
    kernel = np.maximum(unit[1:, np.newaxis] - unit[np.newaxis, :], 0.0)
    one, none = np.eye(count - 1), np.zeros(count - 1)
    solution = linprog(
        cost,
        A_ub=np.vstack([np.hstack([kernel, -kernel, -one]), np.hstack([-kernel, kernel, -one])]),
        b_ub=np.zeros(2 * (count - 1)),
        A_eq=np.vstack(
            [np.concatenate([np.ones(count), -np.ones(count), none]), np.concatenate([unit, -unit, none])]
        ),
        b_eq=[0.0, 1.0],
        method="highs",
    )
    assert solution.success
    return float(solution.fun or 0.0) * eps / window


def line_error(eps: float, acceleration: float, step: float, samples: int) -> float:
    """What noise and the worst acceleration make of a fitted slope, by its own weights."""
    t = step * np.arange(-samples, 1.0)
    weights = np.linalg.pinv(np.column_stack([np.ones_like(t), t]))[1]
    fine = np.linspace(t[0], 0.0, 40 * samples + 1)
    since = 0.5 * (fine[1:] + fine[:-1])
    # A push for a moment at s moves all that is measured later, which is told of as of the last sample.
    kernel = np.maximum(t[np.newaxis, :] - since[:, np.newaxis], 0.0) @ weights - 1.0
    return float(eps * np.linalg.norm(weights) + acceleration * np.abs(kernel).sum() * (fine[1] - fine[0]))


@settings(deadline=None)
@given(eps=noises, acceleration=accelerations, samples=st.floats(0.4, 40.0))
def test_a_line_errs_by_what_its_weights_make_of_noise_and_acceleration(
    eps: float, acceleration: float, samples: float
) -> None:
    step = float(guaranteed_window(eps, acceleration)) / samples
    found = best_line(eps, acceleration, step)
    assert found.error == pytest.approx(line_error(eps, acceleration, step, found.samples), rel=1e-3)
    for other in {max(1, found.samples - 1), found.samples + 1, 2 * found.samples}:
        assert line_error(eps, acceleration, step, other) > found.error * (1.0 - 1e-3)


def test_independent_noise_averages_out_the_more_often_one_looks() -> None:
    seldom, often = best_line(1.5e-3, 0.07, 1.0 / 120.0), best_line(1.5e-3, 0.07, 1.0 / 480.0)
    assert often.error == pytest.approx(seldom.error * 4.0**-0.2, rel=0.02)
    assert best_difference(1.5e-3, 0.07, 1.0 / 480.0).error > 1.7 * seldom.error


def test_sparse_samples_cost_what_a_difference_of_two_costs() -> None:
    """With samples so far apart that older ones say nothing, the last two are all there is."""
    assert best_difference(1e-4, 1.0, 0.5) == (1, 2e-4 / 0.5 + 0.25)


@pytest.mark.parametrize(
    "wrong", [(0.0, 1.0, 0.1), (1.0, -1.0, 0.1), (1.0, 1.0, 0.0), (float("nan"), 1.0, 0.1)]
)
def test_nothing_can_be_guaranteed_without_bounds(wrong: tuple[float, float, float]) -> None:
    for velocity in (best_difference, best_line):
        with pytest.raises(ValueError, match="expected positive numbers"):
            velocity(*wrong)
