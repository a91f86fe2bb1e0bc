from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hil.judge.intervals import TimeInterval, intervals_of


def test_an_interval_lasts_until_the_next_sample_but_not_through_a_silence() -> None:
    t = np.array([0.0, 0.1, 0.2, 5.0, 5.1])
    states = ["lost", "lost", "tracking", "tracking", "lost"]
    assert intervals_of(t, states, longest_gap=0.5) == [
        TimeInterval("lost", 0.0, 0.2, 2),
        TimeInterval("tracking", 0.2, 5.1, 2),
        TimeInterval("lost", 5.1, 5.1, 1),
    ]
    assert intervals_of(np.array([0.0, 4.0]), ["lost", "tracking"], longest_gap=0.5)[0].to_s == 0.5


@given(states=st.lists(st.sampled_from("abc"), max_size=60))
def test_intervals_count_every_sample_once(states: list[str]) -> None:
    intervals = intervals_of(0.1 * np.arange(float(len(states))), states, longest_gap=1.0)
    assert [interval.what for interval in intervals for _ in range(interval.count)] == states
    assert all(before.what != after.what for before, after in itertools.pairwise(intervals))
    assert all(before.to_s == after.from_s for before, after in itertools.pairwise(intervals))
