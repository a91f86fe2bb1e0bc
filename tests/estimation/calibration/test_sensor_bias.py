from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.calibration.sensor_bias import FEWEST, TooFewSightingsError, find_sensor_bias
from estimation.models.motion import Matrix
from formation.angles import wrap


def sightings(
    generator: np.random.Generator, count: int, offset: tuple[float, float], wrong: float = 0.0
) -> tuple[Matrix, Matrix]:
    """Noisy sightings with offsets, a share of them of something else, and what they should have been."""
    true = np.column_stack([generator.uniform(0.2, 2.0, count), generator.uniform(-math.pi, math.pi, count)])
    seen = true + offset + generator.standard_normal((count, 2)) * [0.002, 0.01]
    strays = generator.permutation(count) < round(wrong * count)
    seen[strays] += generator.uniform(0.3, 1.5, (int(strays.sum()), 2))
    seen[:, 1] = wrap(seen[:, 1])
    return seen, true


@given(
    seed=st.integers(0, 10_000),
    range_offset=st.floats(-0.1, 0.1),
    bearing_offset=st.floats(-math.pi, math.pi),
    wrong=st.sampled_from([0.0, 0.1, 0.3]),
)
def test_offsets_are_found_through_strays_wherever_they_lie(
    seed: int, range_offset: float, bearing_offset: float, wrong: float
) -> None:
    seen, true = sightings(np.random.default_rng(seed), 100, (range_offset, bearing_offset), wrong)
    found = find_sensor_bias(seen, true)
    assert abs(found.range.value - range_offset) < 2e-3
    assert abs(wrap(found.bearing.value - bearing_offset)) < 1e-2
    assert found.samples == 100
    assert found.outliers >= round(0.5 * wrong * 100)


def test_the_standard_deviations_are_those_of_many_calibrations() -> None:
    generator = np.random.default_rng(5)
    errors, reported_sd = [], []
    for _ in range(300):
        found = find_sensor_bias(*sightings(generator, 80, (0.03, -0.06), 0.1))
        errors.append((found.range.value - 0.03, found.bearing.value + 0.06))
        reported_sd.append((found.range.sd, found.bearing.sd))
    ratio = np.std(errors, axis=0) / np.sqrt(np.mean(np.square(reported_sd), axis=0))
    assert ratio.min() > 0.75
    assert ratio.max() < 1.1


def test_an_error_that_wanders_is_not_taken_for_a_sure_offset() -> None:
    generator = np.random.default_rng(2)
    seen, true = sightings(generator, 400, (0.0, 0.0))
    slow = 0.05 * np.sin(2.0 * math.pi * np.arange(400) / 400)
    found = find_sensor_bias(seen + np.column_stack([slow, slow]), true)
    assert found.range.sd > 5.0 * 0.05 / math.sqrt(400)


def test_what_tells_too_little_is_refused() -> None:
    generator = np.random.default_rng(1)
    seen, true = sightings(generator, FEWEST, (0.0, 0.0))
    true[3] = math.nan
    with pytest.raises(TooFewSightingsError, match=f"{FEWEST - 1} sightings have a true pose"):
        find_sensor_bias(seen, true)
    seen, true = sightings(generator, 400, (0.0, 0.0))
    seen[:150, 0] += np.linspace(1.0, 30.0, 150)
    seen[150:300, 1] = wrap(seen[150:300, 1] + np.linspace(1.0, 5.0, 150))
    with pytest.raises(TooFewSightingsError, match="of 400 sightings agree"):
        find_sensor_bias(seen, true)


def test_a_sensor_without_any_noise_has_its_offset_exactly() -> None:
    true = np.column_stack([np.linspace(0.5, 1.0, 30), np.linspace(-1.0, 1.0, 30)])
    found = find_sensor_bias(true + np.array([0.25, -0.5]), true)
    assert found.range.value == pytest.approx(0.25)
    assert found.bearing.value == pytest.approx(-0.5)
    assert found.outliers == 0
