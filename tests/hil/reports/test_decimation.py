from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hil.reports.decimation import decimated_rows, spread_rows

VALUES = st.lists(st.floats(-1e6, 1e6) | st.just(math.nan), max_size=400)


@given(values=VALUES, most=st.integers(4, 60))
def test_no_peak_no_end_and_no_gap_is_lost(values: list[float], most: int) -> None:
    given_values = np.array(values, dtype=np.float64)
    rows = decimated_rows(given_values, most)
    kept = given_values[rows]
    assert np.all(np.diff(rows) > 0)
    known = given_values[np.isfinite(given_values)]
    if len(known):
        assert np.nanmin(kept) == known.min()
        assert np.nanmax(kept) == known.max()
    if values:
        assert rows[0] == 0
        assert rows[-1] == len(values) - 1
    gaps = np.flatnonzero(np.isnan(given_values))
    first_of_gap = [gap for gap in gaps if gap == 0 or not np.isnan(given_values[gap - 1])]
    assert set(first_of_gap) <= set(rows.tolist())
    assert len(rows) <= max(most, 4) + len(first_of_gap)


def test_every_short_spike_stays_where_it_was() -> None:
    values = np.sin(np.arange(100_000) * 1e-3)
    spikes = [17, 5_003, 5_500, 99_990]
    values[spikes] = [9.0, -9.0, 9.0, -9.0]
    rows = decimated_rows(values)
    assert set(spikes) <= set(rows.tolist())
    assert len(rows) <= 2000


@given(n=st.integers(1, 500), most=st.integers(2, 50))
def test_spread_rows_reach_from_the_first_to_the_last(n: int, most: int) -> None:
    rows = spread_rows(n, most)
    assert rows[0] == 0
    assert rows[-1] == n - 1
    assert len(rows) <= max(most, min(n, most))
    assert np.all(np.diff(rows) > 0)
