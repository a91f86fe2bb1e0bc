from __future__ import annotations

import math

import numpy as np
import pytest

from hil.live_page.orbit import orbit_of
from hil.scenario.files import load_scenario
from hil.scenario.noise_free_runs import noise_free_run


def test_the_orbit_is_the_run_without_noise_at_any_moment_and_none_outside_it() -> None:
    scenario = load_scenario("turtlebot3", ["run.duration_s=4"])
    orbit = orbit_of(scenario)
    assert orbit is not None
    times = np.array([0.0, 1.234, 3.7])
    run = noise_free_run(scenario, times)
    for row, t in enumerate(times):
        shape = orbit.at(float(t))
        assert shape is not None
        assert shape[0] == pytest.approx(run.rho[row], abs=1e-3)
        for found, wanted in zip(shape[1:], (run.alpha1[row], run.alpha2[row]), strict=True):
            assert math.remainder(found - wanted, math.tau) == pytest.approx(0.0, abs=1e-3)
    assert orbit.at(-0.1) is None
    assert orbit.at(5.0) is None


def test_a_chain_and_a_law_that_is_not_at_hand_have_none() -> None:
    assert orbit_of(load_scenario("chain5-turtlebot3")) is None
    assert orbit_of(load_scenario("turtlebot3", ["controller.law=mine.py:law"])) is None
