"""Prop. 1, 2 and 3 in numbers, as `abreast simulate --stability` reports them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controllers.laws import Gains, independent
from formation.closed_loop import simulate_pair
from formation.leader import Constant
from formation.pose import Pose
from formation.shape import ABREAST_ALPHA1, ABREAST_ALPHA2, Shape, follower_pose
from formation.spacing import Spacing
from hil.errors import UsageError
from hil.figures.stability_figures import draw_stability
from hil.judge import stability
from hil.log.report_json import as_json
from hil.scenario.files import load_scenario
from hil.scenario.noise_free_runs import noise_free_run
from hil.simulate.pair_simulation import simulate


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stability, "_ROWS", 5)
    monkeypatch.setattr(stability, "_COLUMNS", 5)


def checked(name: str, *overrides: str) -> dict[str, Any]:
    report = json.loads(as_json(simulate(load_scenario(name, overrides), None, stability=True).report))
    found: dict[str, Any] = report["stability"]
    return found


@pytest.mark.usefixtures("coarse")
def test_under_prop_1_the_lyapunov_function_never_rises(tmp_path: Path) -> None:
    scenario = load_scenario("fig2-ideal")
    found = stability.stability_of(scenario, noise_free_run(scenario, np.linspace(0.0, 12.0, 601)))
    report: dict[str, Any] = stability.stability_json(found)
    assert report["V1_largest_rise"] == pytest.approx(0.0, abs=1e-10)
    assert 0.3 < report["V1_below_2_from_s"] < 0.5
    assert report["settled_share"]["free"] == 1.0
    draw_stability(scenario, found, tmp_path / "stability.png")
    assert (tmp_path / "stability.png").stat().st_size > 20_000


@pytest.mark.usefixtures("coarse")
def test_of_the_robots_the_gain_ends_and_the_margin_lies_below(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stability, "_GAIN_STEPS", 8)
    found = checked("turtlebot3", "run.duration_s=15.0")
    assert found["gain"]["ends_at"] == pytest.approx(1.6)
    assert found["V1_largest_rise"] > 0.0
    margin = found["k_u_star"]
    assert 0.7 < margin["lower"] < margin["upper"] < found["gain"]["ends_at"]
    assert np.all(np.diff(found["gain"]["rho_max"]) > 0.0)


def test_the_gain_bounds_what_a_constant_turn_does() -> None:
    spacing = Spacing(0.2, 20.0)
    gain = stability.gain_of(1.5, spacing, 0.08)
    held = np.isfinite(gain.rho_max)
    assert np.all(gain.rho_outward[held] <= gain.rho_max[held] + 1e-6)
    assert np.all(gain.rho_inward[held] >= gain.rho_min[held] - 1e-6)
    # The distance that a turn leads to in the end, followed in time.
    gains, start = Gains(1.5, 2.0, spacing), Pose(0.0, 0.0, 0.0)
    for row, side in ((6, 1.0), (12, -1.0)):
        run = simulate_pair(
            start,
            follower_pose(Shape(0.25, ABREAST_ALPHA1, ABREAST_ALPHA2), start),
            Constant(0.08, side * float(gain.k_u[row])),
            lambda shape, v1, u1: independent(shape, v1, u1, gains),
            np.array([0.0, 200.0]),
        )
        expected = gain.rho_outward[row] if side > 0.0 else gain.rho_inward[row]
        assert run.rho[-1] == pytest.approx(expected, abs=1e-6)
        assert run.alpha1[-1] == pytest.approx(ABREAST_ALPHA1, abs=1e-6)


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize("override", ['formation.side="left"', "formation.bearing=1.0"])
def test_other_stations_are_refused(override: str) -> None:
    with pytest.raises(UsageError, match="leave out --stability"):
        checked("turtlebot3", override, "run.duration_s=1.0")
