"""The published experiments, to the digits that were worked out for them beforehand."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from hil.errors import CheckFailedError, UsageError
from hil.scenario.files import load_scenario
from hil.scenario.noise_free_runs import noise_free_run
from hil.simulate.pair_simulation import simulate

DEGREE = math.pi / 180.0


def report_of(name: str, *overrides: str, out: Path | None = None) -> dict[str, Any]:
    return simulate(load_scenario(name, overrides), out).report


@pytest.fixture(scope="module")
def fig2() -> dict[str, Any]:
    return report_of("fig2-independent")


@pytest.fixture(scope="module")
def robots() -> dict[str, Any]:
    return report_of("turtlebot3")


def test_ideal_law_of_fig2() -> None:
    report = report_of("fig2-ideal")
    assert report["final"]["rho"] == pytest.approx(0.495754, abs=5e-7)
    assert report["final"]["alpha1"] == pytest.approx(-1.577217, abs=5e-7)
    assert report["final"]["alpha2"] == pytest.approx(math.pi / 2, abs=1e-12)


def test_without_an_estimator_feed_forward_is_the_ideal_law() -> None:
    assert report_of("fig2-ideal", "controller.law=feedforward") == report_of("fig2-ideal")


def test_ideal_law_brings_the_robots_to_the_equilibrium() -> None:
    final = report_of("turtlebot3", "controller.law=ideal")["final"]
    assert final["rho"] == pytest.approx(0.2, abs=1e-9)
    assert final["alpha1"] == pytest.approx(-math.pi / 2, abs=1e-8)


def test_independent_law_at_the_end(fig2: dict[str, Any], robots: dict[str, Any]) -> None:
    assert fig2["final"]["rho"] == pytest.approx(0.688788, abs=5e-7)
    assert fig2["final"]["alpha1"] == pytest.approx(-1.272145, abs=5e-7)
    assert robots["final"]["rho"] == pytest.approx(0.226804, abs=5e-7)
    assert robots["final"]["alpha1"] == pytest.approx(-1.719326, abs=5e-7)


def test_orbit_of_fig2(fig2: dict[str, Any]) -> None:
    orbit = fig2["orbit"]
    assert orbit["period_s"] == pytest.approx(2.0)
    assert (orbit["rho_min"], orbit["rho_max"]) == pytest.approx((0.658774, 0.760835), abs=1e-6)
    assert (orbit["alpha1_min"], orbit["alpha1_max"]) == pytest.approx((-1.895090, -1.246305), abs=1e-6)
    assert (orbit["v2_min"], orbit["v2_max"]) == pytest.approx((0.598, 1.080), abs=5e-4)
    assert orbit["floquet"] == pytest.approx(0.3776, abs=5e-5)


def test_orbit_of_the_robots(robots: dict[str, Any]) -> None:
    orbit = robots["orbit"]
    assert orbit["period_s"] == pytest.approx(4.0)
    assert (orbit["rho_min"], orbit["rho_max"]) == pytest.approx((0.19999, 0.22895), abs=5e-6)
    swing = 0.5 * (orbit["alpha1_max"] - orbit["alpha1_min"])
    assert swing == pytest.approx(16.4 * DEGREE, abs=0.05 * DEGREE)
    assert orbit["alpha1_max"] - swing == pytest.approx(-90.0 * DEGREE, abs=0.1 * DEGREE)
    assert (orbit["v2_min"], orbit["v2_max"]) == pytest.approx((0.0223, 0.2248), abs=5e-5)
    assert orbit["floquet"] == pytest.approx(0.0529, abs=5e-5)


def test_transients_of_the_follower(fig2: dict[str, Any], robots: dict[str, Any]) -> None:
    assert fig2["extremes"]["v2"] == pytest.approx([-0.418, 1.320], abs=5e-4)
    assert fig2["extremes"]["u2"] == pytest.approx([-1.505, 1.230], abs=5e-4)
    assert robots["extremes"]["v2"] == pytest.approx([-0.023, 0.361], abs=5e-4)
    assert robots["extremes"]["u2"] == pytest.approx([-2.113, 0.673], abs=5e-4)


def test_both_start_outside_the_proved_region(fig2: dict[str, Any], robots: dict[str, Any]) -> None:
    assert fig2["V1_initial"] == pytest.approx(2.2071, abs=5e-5)
    assert robots["V1_initial"] == pytest.approx(10.05, abs=5e-3)
    assert fig2["in_region_of_attraction"] is False
    assert robots["in_region_of_attraction"] is False
    # One step to the right of the leader, it starts inside.
    near = report_of("fig2-independent", "follower.pose=[0.4, -0.3, 0.7]", "run.duration_s=0.1")
    assert near["in_region_of_attraction"] is True


@pytest.mark.parametrize("name", ["fig2-ideal", "fig2-independent"])
def test_fig2_says_nothing_of_alpha2(name: str) -> None:
    """Both runs start with alpha2 where it is wanted, and there it stays."""
    run = noise_free_run(load_scenario(name), np.linspace(0.0, 3.0, 31))
    np.testing.assert_allclose(run.alpha2, math.pi / 2, atol=1e-12)


def test_no_orbit_is_reported_where_there_is_none() -> None:
    constant = 'leader.program={kind = "constant", v = 0.08, u = 0.1}'
    assert "orbit" not in report_of("turtlebot3", constant, "run.duration_s=1.0")


@pytest.mark.slow
def test_the_shortest_duration_still_has_a_start_and_an_end(tmp_path: Path) -> None:
    report_of("turtlebot3", "run.duration_s=1e-6", out=tmp_path)
    assert len((tmp_path / "trajectory.csv").read_text().splitlines()) == 3


def test_files_hold_what_was_reported(tmp_path: Path) -> None:
    report = report_of("turtlebot3", "run.duration_s=5.0", out=tmp_path / "new" / "folder")
    json.dumps(report, allow_nan=False)
    with (tmp_path / "new" / "folder" / "trajectory.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {key: float(rows[-1][key]) for key in ("rho", "alpha1", "alpha2")} == report["final"]
    assert float(rows[-1]["t"]) == 5.0
    assert [min(float(row["v2"]) for row in rows), max(float(row["v2"]) for row in rows)] == (
        report["extremes"]["v2"]
    )
    for picture in ("simulation.png", "experiment.png"):
        assert (tmp_path / "new" / "folder" / picture).read_bytes().startswith(b"\x89PNG")


def test_a_folder_that_cannot_be_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="--out"):
        report_of("turtlebot3", "run.duration_s=0.1", out=tmp_path / "file" / "below")


def test_a_motion_that_breaks_down_is_a_failed_check() -> None:
    given = load_scenario("turtlebot3", ["run.duration_s=1.0"])
    with pytest.raises(CheckFailedError, match="breaks down"):
        simulate(replace(given, controller=replace(given.controller, mu_rho=1e300)), None)


def test_told_to_change_sides_the_follower_ends_on_the_other() -> None:
    scenario = load_scenario("changing-sides")
    report: dict[str, Any] = simulate(scenario, None).report
    # Three changes: it ends on the left, where it began on the right.
    assert report["final"]["alpha1"] == pytest.approx(math.pi / 2, abs=0.5)
    assert report["final"]["alpha2"] == pytest.approx(-math.pi / 2, abs=0.1)
    assert "orbit" not in report
    assert max(map(abs, report["extremes"]["v2"])) <= scenario.controller.v_max
    with pytest.raises(UsageError, match="--stability"):
        simulate(scenario, None, stability=True)


def test_orders_that_a_controller_would_refuse_are_refused_here_and_it_is_said() -> None:
    report = report_of("turtlebot3", "run.duration_s=8.0", "formation.change_sides_at_s=[2.0]")
    assert math.sin(report["final"]["alpha1"]) < -0.8
    assert "unsafe_side_change" in report["orders_refused"]
