"""What is told of a process's growth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.soak.memory import SETTLES_S, WATCHED_S, Sample, growth_mb_h

TIMES = np.arange(0.0, 3600.0, 5.0)


@given(st.floats(-50.0, 50.0), st.floats(20.0, 500.0), st.integers(0, 100))
def test_it_is_the_slope_of_a_line_through_what_came_after_the_first_minutes(
    slope: float, level: float, seed: int
) -> None:
    held = level + slope * TIMES / 3600.0 + np.random.default_rng(seed).normal(0.0, 0.1, TIMES.size)
    held[TIMES < SETTLES_S] = 0.5 * level  # comes up
    found = growth_mb_h([Sample(*each) for each in zip(TIMES, held, strict=True)])
    settled = TIMES >= SETTLES_S
    assert found == pytest.approx(3600.0 * np.polyfit(TIMES[settled], held[settled], 1)[0], abs=1e-5)


def test_too_short_a_time_tells_nothing() -> None:
    assert growth_mb_h([]) is None
    assert (
        growth_mb_h([Sample(float(t), 100.0 + t) for t in TIMES if t < SETTLES_S + 0.9 * WATCHED_S]) is None
    )
