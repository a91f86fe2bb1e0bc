"""The flock scenario: what its report says, what it writes, and how mistakes are answered."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from click.testing import CliRunner

from hil.commands.simulate import command
from hil.errors import UsageError
from hil.scenario.files import load_scenario, refuse_unrunnable
from hil.simulate.flock_simulation import simulate_flock_of


def report_of(*overrides: str, out: Path | None = None) -> dict[str, Any]:
    scenario = load_scenario("flock", overrides)
    assert not isinstance(scenario.flock, msgspec.UnsetType)
    return simulate_flock_of(scenario, scenario.flock, out).report


def test_the_shipped_flock_gathers_turns_and_gathers_again() -> None:
    report = report_of()
    assert report["agents"] == 109
    assert report["gathered_s"] < 20.0
    assert 60.0 < report["settle_s"] < 110.0
    assert report["displacement_final"] < 1e-3 < report["displacement_max"]
    assert report["clearance_min"] > 0.1
    assert report["changes"] > 0
    assert report["last_change_s"] < report["settle_s"]
    displaced = [file["displacement_max"] for file in report["files"]]
    assert len(displaced) == 9
    assert displaced == sorted(displaced)


def test_files_hold_every_agent(tmp_path: Path) -> None:
    report = report_of("flock.agents=15", "run.duration_s=3.0", "leader.pose=[1.0, 2.0, 0.7]", out=tmp_path)
    with (tmp_path / "trajectory.csv").open(encoding="utf-8") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    assert [row["t"] for row in rows] == pytest.approx(np.linspace(0.0, 3.0, 31))
    assert (rows[0]["x_1"], rows[0]["y_1"], rows[0]["theta_1"]) == (1.0, 2.0, 0.7)
    assert max(rows[-1][f"off_{k}"] for k in range(2, 16)) == pytest.approx(report["displacement_final"])
    assert (tmp_path / "flock.png").read_bytes().startswith(b"\x89PNG")


def test_the_seed_decides_the_scatter() -> None:
    few = ("flock.agents=10", "run.duration_s=1.0")
    assert report_of(*few) == report_of(*few)
    assert report_of(*few)["displacement_max"] != report_of(*few, "run.seed=2")["displacement_max"]
    assert report_of(*few, "flock.scatter=0.0", "flock.scatter_heading=0.0")["displacement_max"] < 1e-6


def test_the_command_runs_it() -> None:
    few = ["--set", "flock.agents=4", "--duration", "1", "--json"]
    done = CliRunner().invoke(command, ["flock", *few], catch_exceptions=False)
    assert msgspec.json.decode(done.stdout)["agents"] == 4


def test_mistakes_are_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"flock\.agents.*1"):
        load_scenario("flock", ["flock.agents=1"])
    with pytest.raises(UsageError, match=r"sees nobody.*correct \[flock\]"):
        report_of("flock.least_bearing=1.0")
    with pytest.raises(UsageError, match="duration"):
        report_of("run.duration_s=0.001")
    with pytest.raises(UsageError, match="abreast simulate flock"):
        refuse_unrunnable(load_scenario("flock"))
    run = CliRunner().invoke
    both = run(command, ["flock", "--set", "chain.agents=3"])
    assert isinstance(both.exception, UsageError)
    assert "leave one of them out" in str(both.exception)
    for pair_only in ("--stability", "--set=formation.change_sides_at_s=[1.0]"):
        assert "is for a pair, and flock has a [flock]" in str(run(command, ["flock", pair_only]).exception)
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="--out"):
        report_of("flock.agents=4", "run.duration_s=0.1", out=tmp_path / "file" / "below")
