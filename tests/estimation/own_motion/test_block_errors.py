from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.own_motion.block_errors import sandwich


def spread_of_means(alike: int, block: float) -> tuple[float, float, float]:
    """True spread of means of errors that come in runs of so many, and its two estimates."""
    generator = np.random.default_rng(5)
    times = np.linspace(0.0, 39.9, 400)
    means, found = [], []
    for _ in range(200):
        errors = np.repeat(generator.normal(size=400 // alike), alike)
        means.append(errors.mean())
        covariance = sandwich(np.array([[400.0]]), (errors - errors.mean())[:, np.newaxis], times, block)
        assert covariance is not None
        found.append(np.sqrt(covariance[:, 0, 0]))
    independent, blocks = np.mean(found, axis=0).tolist()
    return float(np.std(means)), independent, blocks


def test_errors_that_are_alike_for_a_while_widen_the_blocks_covariance_alone() -> None:
    true, independent, blocks = spread_of_means(alike=1, block=2.0)
    assert [independent, blocks] == [pytest.approx(true, rel=0.15), pytest.approx(true, rel=0.15)]
    true, independent, blocks = spread_of_means(alike=10, block=4.0)
    assert blocks == pytest.approx(true, rel=0.2)
    assert independent < 0.5 * true


def test_of_residuals_that_overlap_only_some_count() -> None:
    pulls = np.random.default_rng(1).normal(size=(50, 2))
    times = np.linspace(0.0, 4.9, 50)
    once, five = (sandwich(np.eye(2), pulls, times, 1.0, each) for each in (1, 5))
    assert once is not None
    assert five is not None
    assert five[0] == pytest.approx(5.0 * once[0])
    assert five[1] == pytest.approx(once[1])


def test_what_is_not_determined_has_no_covariance() -> None:
    assert sandwich(np.zeros((2, 2)), np.ones((20, 2)), np.arange(20.0), 1.0) is None


@given(st.integers(0, 10_000), st.lists(st.floats(-6.0, 6.0), min_size=4, max_size=4), st.floats(-5.0, 5.0))
def test_what_only_rounding_tells_apart_is_not_determined_in_whatever_units(
    seed: int, powers: list[float], by: float
) -> None:
    generator, times = np.random.default_rng(seed), np.linspace(0.0, 9.9, 100)
    units = 10.0 ** np.array(powers)
    x, y, offs = generator.normal(size=(3, 100))
    apart = np.column_stack([x, y, np.ones(100), x + 1e-4 * generator.normal(size=100)]) * units
    alike = np.column_stack([x, y, np.ones(100), by * x + 3.0]) * units
    known = sandwich(apart.T @ apart, apart * offs[:, np.newaxis], times, 1.0)
    assert known is not None
    assert np.all(np.diagonal(known, axis1=1, axis2=2) > 0.0)
    assert sandwich(alike.T @ alike, alike * offs[:, np.newaxis], times, 1.0) is None
