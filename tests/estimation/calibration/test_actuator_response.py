from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from estimation.calibration.actuator_response import ActuatorResponse, fit_response
from estimation.own_motion.input_alignment import Known
from formation.angles import FloatArray

FINE = 1e-4
NOISE = np.array([0.002, 0.01])


def answered(times: FloatArray, commands: FloatArray, lag: float, delay: float, end: float) -> FloatArray:
    """Motion on a fine grid of time by an independent filter: commands held, sampled, low-passed, shifted."""
    fine = np.arange(0.0, end, FINE)
    held = commands[np.maximum(np.searchsorted(times, fine - delay, side="right") - 1, 0)]
    keep = np.exp(-FINE / lag)
    return np.asarray(lfilter([0.0, 1.0 - keep], [1.0, -keep], held, axis=0))


def commanded(generator: np.random.Generator, end: float) -> tuple[FloatArray, FloatArray]:
    """Commands at an uneven rate, in steps, to a robot that stands for two seconds first."""
    times = np.sort(generator.uniform(0.0, end, round(50 * end)))
    wave = 2.0 * np.pi * generator.uniform(0.2, 0.6, 2) * times[:, np.newaxis]
    commands = np.round(np.array([0.08, 0.2]) + np.array([0.05, 0.6]) * np.sin(wave), 2)
    commands[times < 2.0] = 0.0
    return times, commands


def measured(
    times: FloatArray, commands: FloatArray, lag: float, delay: float, generator: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Times and noisy measurements at some 30 per second."""
    motion = answered(times, commands, lag, delay, times[-1])
    at = np.arange(0.013, times[-1] - 0.1, 0.033)
    places = np.round(at / FINE).astype(int)
    return places * FINE, motion[places] + NOISE * generator.normal(size=(len(at), 2))


def near(known: Known, true: float, slack: float = 5e-4) -> bool:
    return abs(known.value - true) < 4.0 * known.sd + slack


@given(
    lag=st.floats(0.02, 0.4),
    delay=st.floats(0.0, 0.3),
    gain=st.floats(0.8, 1.2),
    seed=st.integers(0, 50),
)
@settings(max_examples=4)
def test_lag_and_delay_are_found_within_what_is_said_of_them(
    lag: float, delay: float, gain: float, seed: int
) -> None:
    generator = np.random.default_rng(seed)
    times, commands = commanded(generator, 15.0)
    at, seen = measured(times, commands * [gain, 1.0], lag, delay, generator)
    found = fit_response(times, commands, at, seen)
    assert found is not None
    assert near(found.lag, lag)
    assert near(found.transport, delay)
    assert near(found.delay, lag + delay)
    assert near(found.gain_v, gain, 2e-3)
    assert found.delay.sd < 0.01
    assert found.delay.value == pytest.approx(found.lag.value + found.transport.value, abs=1e-9)


@pytest.mark.slow
def test_standard_deviations_are_those_of_the_errors() -> None:
    errors = []
    for seed in range(6):
        generator = np.random.default_rng(seed)
        times, commands = commanded(generator, 20.0)
        found = fit_response(times, commands, *measured(times, commands, 0.1, 0.03, generator))
        assert found is not None
        for known, true in ((found.lag, 0.1), (found.transport, 0.03), (found.delay, 0.13)):
            errors.append((known.value - true) / known.sd)
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 1.6


def test_glitches_coarse_odometry_and_a_robot_with_a_lower_limit_hardly_matter() -> None:
    generator = np.random.default_rng(3)
    times, commands = commanded(generator, 20.0)
    done = np.column_stack([commands[:, 0], np.minimum(commands[:, 1], 0.6)])
    at, seen = measured(times, done, 0.12, 0.04, generator)
    seen = np.round(seen / [0.005, 0.02]) * [0.005, 0.02]
    broken = generator.choice(len(at), len(at) // 25, replace=False)
    seen[broken] = generator.uniform(-3.0, 3.0, (len(broken), 2))
    found = fit_response(times, commands, at, seen)
    assert found is not None
    assert found.delay.value == pytest.approx(0.16, abs=0.005)
    assert found.lag.value == pytest.approx(0.12, abs=0.015)
    assert found.outliers >= 0.8 * len(broken)


def test_slow_commands_tell_the_sum_far_better_than_how_it_is_shared() -> None:
    generator = np.random.default_rng(5)
    times = np.arange(0.0, 20.0, 0.02)
    wave = np.sin(np.outer(times, [0.8, 0.5]))
    commands = np.array([0.08, 0.2]) + np.array([0.05, 0.5]) * wave
    at, seen = measured(times, commands, 0.1, 0.05, generator)
    found = fit_response(times, commands, at, seen)
    assert found is not None
    assert near(found.delay, 0.15)
    assert found.delay.sd < 0.3 * min(found.lag.sd, found.transport.sd)


def test_a_robot_without_lag_does_not_answer_before_it_is_told_to() -> None:
    # Sampled always as long after a command, it looks the same for any delay that is shorter than that.
    generator = np.random.default_rng(7)
    times, commands = commanded(generator, 15.0)
    times = np.linspace(0.0, 15.0, len(times), endpoint=False)
    seen = commands + NOISE * generator.normal(size=commands.shape)
    found = fit_response(times, commands, times + 0.004, seen)
    assert found is not None
    assert 0.0 <= found.transport.value < 0.005
    assert found.delay.value < 0.008


def test_odometry_that_is_stamped_early_is_found_out() -> None:
    generator = np.random.default_rng(8)
    times, commands = commanded(generator, 15.0)
    at, seen = measured(times, commands, 0.1, 0.0, generator)
    found = fit_response(times, commands, at - 0.04, seen)
    assert found is not None
    assert near(found.transport, -0.04)
    assert near(found.lag, 0.1)


def fitted(commands: FloatArray, seen: FloatArray) -> ActuatorResponse | None:
    times = np.linspace(0.0, 0.02 * len(commands), len(commands), endpoint=False)
    return fit_response(times, commands, times, seen)


def test_of_a_robot_that_stands_or_drives_evenly_nothing_is_known() -> None:
    shake = NOISE * np.random.default_rng(1).normal(size=(1000, 2))
    still = np.zeros((1000, 2))
    assert fitted(still, still) is None
    assert fitted(still, shake) is None
    even = np.tile([0.1, 0.3], (1000, 1))
    assert fitted(even, even + shake) is None


@pytest.mark.parametrize("count", [0, 1, 2, 50])
def test_of_a_short_span_nothing_is_known(count: int) -> None:
    commands = np.random.default_rng(2).normal(size=(count, 2))
    assert fitted(commands, commands) is None


def test_a_delay_beyond_those_that_are_tried_is_not_made_up() -> None:
    generator = np.random.default_rng(6)
    times, commands = commanded(generator, 15.0)
    at, seen = measured(times, commands, 0.1, 1.5, generator)
    assert fit_response(times, commands, at, seen) is None
