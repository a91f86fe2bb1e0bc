"""NEES and its limits against theory: chi-square, errors of known correlation, sound and unsound ones."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal, stats

from estimation.consistency.nees import (
    CONFIDENCE,
    Floats,
    effective_samples,
    nees_limits,
    normalised,
    samples_of_runs,
    squared_sum,
)

TAIL = 0.5 * (1.0 - CONFIDENCE)


def sequences(runs: int, samples: int, decay: float, seed: int = 1) -> Floats:
    """Gaussian sequences (runs, samples) of variance 1 whose correlation falls by ``decay`` a sample."""
    noise = np.random.default_rng(seed).normal(size=(runs, samples))
    noise[:, 1:] *= math.sqrt(1.0 - decay * decay)
    found: Floats = signal.lfilter([1.0], [1.0, -decay], noise, axis=1)
    return found


@pytest.mark.parametrize("samples", [1, 3, 10, 40, 300, 5000])
def test_limits_are_quantiles_of_chi_square(samples: int) -> None:
    limits = nees_limits(samples)
    assert limits is not None
    assert limits[0] == pytest.approx(stats.chi2.ppf(TAIL, samples) / samples, abs=0.015)
    assert limits[1] == pytest.approx(stats.chi2.ppf(1.0 - TAIL, samples) / samples, rel=0.05)


def test_less_than_one_sample_has_no_limits() -> None:
    assert nees_limits(0.9) is None
    assert nees_limits(0.0) is None


@pytest.mark.parametrize("decay", [0.0, 0.8, 0.95])
def test_correlated_errors_count_for_as_many_as_theory_says(decay: float) -> None:
    # Of correlation decay^k the squares have decay^2k; over all k that adds up to (1 + d) / (1 - d).
    share = (1.0 - decay**2) / (1.0 + decay**2)
    found = [effective_samples(each) for each in sequences(60, 4000, decay)]
    assert np.median(found) == pytest.approx(4000 * share, rel=0.06)


def test_a_long_sequence_counts_for_the_sum_of_its_pieces() -> None:
    (long,) = sequences(1, 60_000, 0.9)
    d = 0.9**2
    assert effective_samples(long) == pytest.approx(60_000 * (1.0 - d) / (1.0 + d), rel=0.1)


@pytest.mark.parametrize("decay", [0.0, 0.9, 0.98])
def test_sound_estimators_stay_within_their_limits_and_others_do_not(decay: float) -> None:
    sound = sequences(300, 3600, decay)

    def outside(errors: Floats) -> int:
        count = 0
        for each in errors:
            limits = nees_limits(effective_samples(each))
            assert limits is not None
            count += not limits[0] <= float(np.mean(each * each)) <= limits[1]
        return count

    assert outside(sound) <= 3  # 0.3 expected; more than 3 once in a thousand tries
    assert outside(0.5 * sound) > 290
    assert outside(2.0 * sound) > 290


def test_an_error_that_never_changes_is_one_error() -> None:
    assert effective_samples(np.full(1000, 0.3)) <= 2.0
    assert effective_samples(np.full(50_000, -2.0)) <= 2.0
    assert effective_samples(np.zeros(10)) == 0.0
    assert effective_samples(np.empty(0)) == 0.0
    assert effective_samples(np.array([1.0])) == 1.0


@pytest.mark.parametrize("decay", [0.0, 0.95])
def test_independent_runs_tell_the_same_from_how_they_scatter(decay: float) -> None:
    d = decay**2
    errors = sequences(400, 1000, decay)
    expected = 400 * 1000 * (1.0 - d) / (1.0 + d)
    found = samples_of_runs(np.mean(errors * errors, axis=1))
    assert found == pytest.approx(expected, rel=0.3)  # the variance of 400 runs is known to 7 %, one sigma


def test_few_runs_leave_wide_limits() -> None:
    # Student's t of one degree of freedom at 99.95 % is 637, where the normal distribution has 3.3.
    few, many = samples_of_runs(np.array([0.9, 1.1])), samples_of_runs(np.array([0.9, 1.1] * 50))
    assert few == pytest.approx(2.0 / 0.01 * (3.29 / 636.6) ** 2, rel=0.01)
    assert many > 10_000 * few
    assert samples_of_runs(np.array([1.0])) == 0.0
    assert samples_of_runs(np.array([1.0, 1.0])) == 0.0


def test_errors_without_deviations_or_truth_are_left_out() -> None:
    error = np.array([1.0, math.nan, 3.0, -4.0, 5.0])
    sd = np.array([2.0, 1.0, 0.0, math.nan, 10.0])
    np.testing.assert_array_equal(normalised(error, sd), [0.5, 0.5])
    np.testing.assert_array_equal(normalised(error[:1], sd[:1]), [0.5])
    assert squared_sum(error, sd) == (0.5, 2)
    assert squared_sum(error[:1], sd[:1]) == (0.25, 1)
    assert squared_sum(error[1:2], sd[1:2]) == (0.0, 0)
