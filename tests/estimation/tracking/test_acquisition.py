"""From no knowledge at all to a leader that is known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.acquisition import NOISE, SENSORS, Sensor, start, tracker_for
from benchmarks.estimation import LIMITS
from estimation.filters.belief import Model
from estimation.filters.estimators import ESTIMATORS, make_estimator, settling
from estimation.filters.gaussian import Gaussian
from estimation.models.measurement import FrontEnd
from estimation.tracking.track import Tracker
from estimation.tracking.track_settings import TrackSettings


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda sensor: str(sensor.name))
def test_a_leader_anywhere_around_is_soon_known_and_the_filter_does_not_diverge(sensor: Sensor) -> None:
    tracker, brief = tracker_for(sensor), replace(sensor, duration=1.5 * sensor.within)
    starts = [start(tracker, brief, seed) for seed in range(2000, 2008)]
    assert not any(each.diverged for each in starts)
    assert not any(math.isnan(each.settled) for each in starts)
    assert max(each.settled for each in starts) <= sensor.within


@pytest.mark.parametrize("kind", [kind for kind in ESTIMATORS if kind not in ("shape-ekf", "difference")])
def test_a_speed_that_no_leader_has_does_not_make_its_direction_known(kind: str) -> None:
    settings = TrackSettings(**settling(kind)._asdict())
    settled, unsettled = settings.settled_heading, settings.unsettled_heading
    of = Tracker(make_estimator(kind, Model(FrontEnd.WORLD, LIMITS, NOISE)), settings)

    def known(speed: float, sd: float, *, before: bool) -> bool:
        mean = np.array([0.0, 0.0, 0.6 * speed, 0.8 * speed, 0.0])
        return of.settled(Gaussian.of(mean, np.diag([1e-6, 1e-6, sd**2, sd**2, 0.1])), before)

    enough = 0.99 * settled * LIMITS.k_v
    assert known(LIMITS.k_v, enough, before=False)
    assert not known(LIMITS.k_v, 1.02 * enough, before=False)
    assert known(3.0 * LIMITS.k_v, enough, before=False)
    assert not known(3.0 * LIMITS.k_v, 1.02 * enough, before=False)
    # One that is known already stays so, however fast it is.
    assert known(3.0 * LIMITS.k_v, 2.5 * unsettled * LIMITS.k_v, before=True)
