"""From no knowledge at all to a leader that is known."""

from __future__ import annotations

import math

import pytest

from benchmarks.acquisition import SENSORS, Sensor, start, tracker_for
from benchmarks.estimation import LIMITS


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda sensor: str(sensor.name))
def test_a_leader_anywhere_around_is_soon_known_and_the_filter_does_not_diverge(sensor: Sensor) -> None:
    tracker = tracker_for(sensor)
    starts = [start(tracker, sensor, seed) for seed in range(2000, 2008)]
    assert not any(each.diverged for each in starts)
    fast = [each.settled for each in starts if each.speed > 0.8 * LIMITS.k_v or sensor.rate > 100.0]
    assert len(fast) >= 2
    assert not any(math.isnan(settled) for settled in fast)
    assert sorted(fast)[len(fast) // 2] <= sensor.within
