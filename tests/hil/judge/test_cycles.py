"""Which cycles are told to be late."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.judge.cycles import judge_cycles

PERIOD_NS, LEAST_NS = 8_333_333, 30_000_000


@given(st.sets(st.integers(0, 199), max_size=20), st.floats(1.05, 20.0))
def test_each_that_is_late_by_more_than_a_period_is_counted(late: set[int], periods: float) -> None:
    captured = np.arange(200, dtype=np.int64) * PERIOD_NS
    waits = np.full(200, LEAST_NS)
    waits[sorted(late)] += round(periods * PERIOD_NS)
    found = judge_cycles(captured, captured + waits)
    assert (found["count"], found["late"]) == (200, len(late))
    assert found["limit_ms"] == pytest.approx((LEAST_NS + PERIOD_NS) * 1e-6)
    assert found["longest_ms"] == pytest.approx(waits.max() * 1e-6)


def test_a_few_commands_tell_nothing() -> None:
    assert judge_cycles(np.arange(2), np.arange(2)) == {}
