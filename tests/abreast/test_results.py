"""Results from Python against the JSON of the commands, and arrays against what they stand for."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import abreast
from abreast import Run, Scenario
from abreast.__main__ import main
from formation.angles import wrap
from hil.scenario.schema import TableProgram

Json = Callable[..., dict[str, Any]]
SHORT = {"run.duration_s": 4.0, "run.evaluate_from_s": 2.0}
SET = [part for key, value in SHORT.items() for part in ("--set", f"{key}={value}")]


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Json:
    """The JSON of a command."""

    def call(*arguments: object) -> dict[str, Any]:
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main([*map(str, arguments), "--json"])
        assert left.value.code == 0
        result: dict[str, Any] = json.loads(capsys.readouterr().out)
        return result

    return call


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return abreast.load_scenario("turtlebot3", SHORT)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def run(scenario: Scenario, folder: Path) -> Run:
    return abreast.run_lockstep(scenario, seed=5, log=folder / "run.mcap")


def test_the_summary_of_a_run_is_the_json_of_the_command(run: Run, said: Json, tmp_path: Path) -> None:
    theirs = said("run", "turtlebot3", "--lockstep", "--seed", 5, *SET, "--out", tmp_path / "run")
    ours = run.as_dict()
    for each in (ours, theirs):
        assert each.pop("lockstep").keys() == {"wall_s", "times_real_time"}
        assert each["log"].pop("path").endswith("run.mcap")
    assert ours == theirs


def test_without_a_log_none_is_left_and_nothing_else_differs(
    run: Run, scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    other = abreast.run_lockstep(scenario, seed=5)
    assert not list(tmp_path.iterdir())
    assert "log" not in other.summary
    assert {**other.summary, "log": 0, "lockstep": 0} == {**run.summary, "log": 0, "lockstep": 0}
    assert np.array_equal(other.estimates.v1, run.estimates.v1, equal_nan=True)


def test_a_log_that_exists_is_not_written_over(run: Run, scenario: Scenario, folder: Path) -> None:
    with pytest.raises(abreast.UsageError, match=r"run\.mcap exists already; give another log"):
        abreast.run_lockstep(scenario, log=folder / "run.mcap")


def test_arrays_of_a_run_fit_its_summary(run: Run) -> None:
    estimates, truth, commands = run.estimates, run.truth, run.commands
    assert len(estimates) == len(truth.t) == len(truth.leader) == len(truth.follower)
    assert np.array_equal(estimates.t, truth.t)
    judged = (estimates.status == "tracking") & (estimates.t >= 2.0) & (estimates.t <= 4.0 + 1e-9)
    squares = (estimates.v1 - truth.v1)[judged] ** 2
    rmse = run.summary["estimation"]["rmse"]["v1"]
    assert float(np.sqrt(squares.mean())) == pytest.approx(rmse, rel=1e-9)
    during = (commands.t >= 0.0) & (commands.t < 4.0)
    assert np.count_nonzero(during) == run.summary["commands"]["sent"]
    assert np.count_nonzero(commands.saturated & during) == run.summary["commands"]["saturated"]
    assert commands.reason[-1] == "stopped"
    shape = np.hypot(*(truth.leader - truth.follower)[:, :2].T)
    assert np.allclose(truth.rho, shape, atol=1e-12)
    assert np.all(np.abs(wrap(estimates.alpha2 - truth.alpha2)) < 0.2)


def test_the_summary_of_a_replay_is_the_json_of_the_command(run: Run, said: Json, folder: Path) -> None:
    log = folder / "run.mcap"
    again = abreast.replay(log, verify=True)
    assert again.as_dict() == said("replay", log, "--verify")
    assert again.summary["parity"]["commands"]["mismatched"] == 0
    assert np.array_equal(again.estimates.alpha1, run.estimates.alpha1, equal_nan=True)
    assert np.array_equal(again.commands.u2, run.commands.u2, equal_nan=True)
    options: dict[str, Any] = {"estimator": "ukf", "from_s": 1.0, "to_s": 3.0}
    other = abreast.replay(abreast.read_log(log), **options, overrides={"estimator.window_s": 0.1})
    asked = ["--estimator", "ukf", "--from", 1.0, "--to", 3.0, "--set", "estimator.window_s=0.1"]
    assert other.as_dict() == said("replay", log, *asked)
    assert len(other.commands.t) == 0


def test_what_speaks_against_a_replay_is_raised(run: Run, folder: Path) -> None:
    with pytest.raises(abreast.UsageError, match="--verify compares with what was recorded"):
        abreast.replay(folder / "run.mcap", estimator="ukf", verify=True)
    with pytest.raises(abreast.UsageError, match="--to 1: expected more than --from 2"):
        abreast.replay(folder / "run.mcap", from_s=2.0, to_s=1.0)


def test_a_chain_has_a_run_for_each_follower(said: Json, tmp_path: Path) -> None:
    short = {"run.duration_s": 2.0, "run.evaluate_from_s": 1.0, "chain.agents": 3}
    chain = abreast.load_scenario("chain5-turtlebot3", short)
    run = abreast.run_lockstep(chain, log=tmp_path / "chain.mcap")
    assert [pair.summary["follower"] for pair in run.pairs] == ["follower", "agent3"]
    assert run.estimates is run.pairs[0].estimates
    assert not np.array_equal(run.pairs[0].truth.leader, run.pairs[1].truth.leader)
    again = abreast.replay(tmp_path / "chain.mcap", verify=True)
    assert again.as_dict() == said("replay", tmp_path / "chain.mcap", "--verify")
    one = abreast.replay(tmp_path / "chain.mcap", follower="agent3")
    assert np.array_equal(one.estimates.v1, run.pairs[1].estimates.v1, equal_nan=True)


def test_what_is_told_of_a_scenario_is_the_json_of_the_command(said: Json) -> None:
    for given in ("turtlebot3", abreast.load_scenario("turtlebot3")):
        assert abreast.bounds(given).as_dict() == said("bounds", "turtlebot3")
        assert abreast.gains(given).as_dict() == said("gains", "turtlebot3")
    none = abreast.load_scenario("turtlebot3", {"mocap.latency_s": 3})
    assert abreast.gains(none).as_dict() == said("gains", "turtlebot3", "--set", "mocap.latency_s=3")


@pytest.mark.parametrize(
    ("name", "options", "arguments"),
    [
        ("fig2-independent", {"law": "ideal"}, ["--law", "ideal"]),
        ("turtlebot3", {"stability": True, "duration_s": 20.0}, ["--stability", "--duration", 20.0]),
        ("chain5", {"duration_s": 3.0}, ["--duration", 3.0]),
        ("flock", {"duration_s": 3.0}, ["--duration", 3.0]),
    ],
)
def test_a_simulation_is_the_json_of_the_command(
    name: str, options: dict[str, Any], arguments: list[object], said: Json
) -> None:
    found = abreast.simulate(name, **options)
    assert found.as_dict() == said("simulate", name, *arguments)
    n, agents = found.v.shape
    assert found.poses.shape == (n, agents, 3)
    assert found.u.shape == (n, agents)
    assert len(found.t) == n
    if found.rho is not None:
        apart = np.hypot(*np.diff(found.poses[:, :, :2], axis=1).transpose(2, 0, 1))
        assert np.allclose(found.rho, apart.squeeze(), atol=1e-9)


def test_a_calibration_is_the_json_of_the_command(said: Json, tmp_path: Path) -> None:
    lab = abreast.load_scenario("turtlebot3", {"run.duration_s": 10.0})
    abreast.run_lockstep(lab, log=tmp_path / "lab.mcap")
    found = abreast.calibrate(tmp_path / "lab.mcap", from_s=0.5)
    assert found.as_dict() == said("calibrate", tmp_path / "lab.mcap", "--from", 0.5)
    assert found.timing["lag_s"].value == found.as_dict()["lag_s"]


def test_a_sweep_is_the_json_of_the_command(said: Json, tmp_path: Path) -> None:
    spec = tmp_path / "small.toml"
    spec.write_text("[grid]\nsigma_position = [0.0003, 0.003]\nsigma_heading = [0.0035]\n", encoding="utf-8")
    grid = {"sigma_position": [0.0003, 0.003], "sigma_heading": [0.0035]}
    options: dict[str, Any] = {"runs": 2, "duration_s": 3.0, "overrides": {"mocap": {"loss": 0.1}}}
    with_python = abreast.sweep({"grid": grid}, **options, law="feedforward", out=tmp_path / "there")
    asked = ["--runs", 2, "--duration", 3, "--workers", 1, "--set", "mocap.loss=0.1"]
    asked += ["--set", "controller.law=feedforward"]
    theirs = said("sweep", spec, *asked, "--out", tmp_path / "here")
    assert with_python.as_dict()["cells"] == theirs["cells"]
    assert with_python.run_seconds == theirs["run_seconds"] == 12.0
    assert (tmp_path / "there" / "report.html").exists()
    assert with_python.column("rmse.v1").tolist() == [cell["rmse"]["v1"] for cell in theirs["cells"]]
    assert np.isnan(with_python.column("no.such")).all()


def test_overrides_are_values_tables_or_texts() -> None:
    by_value = abreast.load_scenario(
        "turtlebot3", {"mocap.loss": np.float64(0.1), "run": {"seed": np.int64(3)}}
    )
    assert by_value == abreast.load_scenario("turtlebot3", ["mocap.loss=0.1", "run.seed=3"])
    assert by_value.run.duration_s == abreast.load_scenario("turtlebot3").run.duration_s
    program = {"kind": "table", "t": np.array([0.0, 1.0]), "v": (0.1, 0.1), "u": [0.0, 0.5]}
    driven = abreast.load_scenario("turtlebot3", {"leader.program": program}).leader.program
    assert isinstance(driven, TableProgram)
    assert driven.u == [0.0, 0.5]
    with pytest.raises(abreast.UsageError, match="did you mean 'loss'"):
        abreast.load_scenario("turtlebot3", {"mocap.los": 0.1})
    with pytest.raises(abreast.UsageError, match=r"override 'formation\.rho_0\.x': 'rho_0' is a value"):
        abreast.load_scenario("turtlebot3", {"formation.rho_0.x": 1})
