from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.bounds.guarantees import guaranteed_rate
from estimation.bounds.window_estimator import guaranteed_error, window_estimator


def test_dense_samples_attain_the_guaranteed_rate() -> None:
    eps, acceleration = 1.5e-3, 0.07
    dense = window_estimator(eps, acceleration, 0.001)
    assert dense.bound == pytest.approx(float(guaranteed_rate(eps, acceleration)), rel=2e-3)


@settings(max_examples=30, deadline=None)
@given(
    eps=st.floats(1e-4, 0.1),
    acceleration=st.floats(0.01, 5.0),
    step=st.floats(0.001, 0.2),
    seed=st.integers(0, 99),
)
def test_no_noise_and_no_acceleration_break_the_bound_and_the_worst_reach_it(
    eps: float, acceleration: float, step: float, seed: int
) -> None:
    found = window_estimator(eps, acceleration, step)
    assert found.bound >= float(guaranteed_rate(eps, acceleration)) * (1.0 - 1e-9)
    # The worst case, built: noise and acceleration against each weight, integrated on a fine grid.
    fine = 40
    times = np.linspace(found.times[0], 0.0, (len(found.times) - 1) * fine + 1)
    middles, dt = 0.5 * (times[1:] + times[:-1]), times[1] - times[0]
    reach = np.maximum(middles[:, np.newaxis] - found.times[np.newaxis, :], 0.0) @ found.weights
    random = np.random.default_rng(seed)
    for push in (-acceleration * np.sign(reach), random.uniform(-acceleration, acceleration, len(middles))):
        positions = np.array([np.sum(push * np.maximum(middles - t, 0.0)) * dt for t in found.times])
        noise = eps * (
            np.sign(found.weights) if push[0] == push[-1] else random.uniform(-1.0, 1.0, len(positions))
        )
        assert abs(found.weights @ (positions + noise)) <= found.bound * (1.0 + 1e-6)
    worst = eps * np.abs(found.weights).sum() + acceleration * np.abs(reach).sum() * dt
    assert worst == pytest.approx(found.bound, rel=5e-3)


def test_sparse_samples_cost_what_a_difference_of_two_costs() -> None:
    """With samples so far apart that older ones say nothing, the last two are all there is."""
    eps, acceleration, step = 1e-4, 1.0, 0.5
    difference = 2.0 * eps / step + 0.5 * acceleration * step
    assert window_estimator(eps, acceleration, step).bound == pytest.approx(difference, rel=1e-6)


def test_no_plain_difference_is_better() -> None:
    eps, acceleration, step = 0.01, 0.3, 0.05
    best = window_estimator(eps, acceleration, step)
    for back in range(1, 20):
        times = np.array([-back * step, 0.0])
        weights = np.array([-1.0, 1.0]) / (back * step)
        assert guaranteed_error(eps, acceleration, times, weights) >= best.bound * (1.0 - 1e-9)


def test_nothing_can_be_guaranteed_without_bounds() -> None:
    with pytest.raises(ValueError, match="expected positive numbers"):
        window_estimator(0.0, 1.0, 0.1)
