"""A first-order lag of a signal, against an independent filter on a fine grid of time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from estimation.own_motion.lagged_signal import LaggedSignal, columns_of
from formation.angles import FloatArray

FINE = 1e-4


def signal(seed: int, *, held: bool) -> LaggedSignal:
    """Twists at an uneven rate, on whole steps of the fine grid, with a gap."""
    generator = np.random.default_rng(seed)
    steps = np.unique(generator.integers(0, 20_000, 60))
    steps = steps[(steps < 8_000) | (steps > 11_000)]
    told = generator.normal(size=len(steps)) + 1j * generator.normal(size=len(steps))
    times = np.asarray(steps * FINE, dtype=np.float64)
    return LaggedSignal(times, told, held)


def fine_answer(given: LaggedSignal, lag: float) -> tuple[FloatArray, FloatArray]:
    """Times and the answer (n, 2) by a filter that holds its input over each fine step, half a step early."""
    times = np.arange(round(given.times[0] / FINE), round(given.times[-1] / FINE) + 2_000) * FINE
    middle = times[:-1] + 0.5 * FINE
    told = columns_of(given.told)
    place = np.searchsorted(given.times, middle, side="right") - 1
    held = told[place]
    linear = np.column_stack([np.interp(middle, given.times, column) for column in told.T])
    keep = np.exp(-FINE / lag)
    begin = keep * told[:1]
    answers, _ = lfilter([1.0 - keep], [1.0, -keep], held if given.held else linear, axis=0, zi=begin)
    return times, np.vstack([told[:1], answers])


@given(st.integers(0, 1000), st.floats(0.02, 1.0), st.booleans())
@settings(max_examples=10, deadline=None)
def test_answers_are_those_of_the_filter_wherever_they_are_asked_for(
    seed: int, lag: float, held: bool
) -> None:
    given_signal = signal(seed, held=held)
    times, answer = fine_answer(given_signal, lag)
    found = given_signal.answers(times, lag, given_signal.states(lag))
    assert columns_of(found) == pytest.approx(answer, abs=1e-4)
    at_samples = np.round((given_signal.times - times[0]) / FINE).astype(int)
    assert columns_of(given_signal.states(lag)) == pytest.approx(answer[at_samples], abs=1e-4)


@given(st.integers(0, 1000), st.floats(0.02, 1.0), st.booleans())
@settings(max_examples=10, deadline=None)
def test_ways_are_the_integrals_of_answers(seed: int, lag: float, held: bool) -> None:
    given_signal = signal(seed, held=held)
    times, answer = fine_answer(given_signal, lag)
    sums = np.cumsum(0.5 * (answer[1:] + answer[:-1]) * FINE, axis=0)
    ways = columns_of(given_signal.answered_ways(times, lag, given_signal.states(lag)))
    assert ways[1:] - ways[0] == pytest.approx(sums, abs=1e-4)


def test_without_a_lag_the_answer_is_the_signal() -> None:
    for held in (True, False):
        given_signal = signal(3, held=held)
        middle = 0.5 * (given_signal.times[1:] + given_signal.times[:-1])
        found = given_signal.answers(middle, 0.0, given_signal.states(0.0))
        told = given_signal.told
        assert found == pytest.approx(told[:-1] if held else 0.5 * (told[1:] + told[:-1]))
