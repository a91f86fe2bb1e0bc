"""What may be named on the command line, and what it is taken as."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from hil.compare.change import change_of
from hil.compare.comparison import compared
from hil.compare.conditions import failures_of, parsed_condition
from hil.compare.gathering import groups_of, labels_of
from hil.errors import UsageError


def summary(rmse: float, seed: int | None = 1, **others: Any) -> dict[str, Any]:
    told = {
        "scenario": "turtlebot3",
        "mode": "lockstep",
        "estimator": "ekf",
        "law": "independent",
        "duration_s": 30.0,
        "estimation": {"samples": 100, "untracked": 0, "rmse": {"v1": rmse}},
        "findings": [],
        **others,
    }
    return told if seed is None else {**told, "seed": seed}


def run(folder: Path, rmse: float, **others: Any) -> Path:
    folder.mkdir(parents=True)
    (folder / "summary.json").write_text(json.dumps(summary(rmse, **others)))
    return folder


def cell(position: float, estimator: str = "ekf", rmse: float = 0.1, diverged: int = 0) -> dict[str, Any]:
    return {
        "sigma_position": position,
        "sigma_heading": 0.01,
        "latency_s": 0.03,
        "loss": 0.0,
        "estimator": estimator,
        "runs": 4,
        "samples": 100,
        "diverged": diverged,
        "rmse": {"v1": rmse},
    }


def sweep(folder: Path, *cells: dict[str, Any], **spec: Any) -> Path:
    folder.mkdir(parents=True)
    (folder / "results.json").write_text(json.dumps({"spec": spec, "cells": cells}))
    return folder


def test_a_folder_of_runs_is_a_group_of_their_metrics(tmp_path: Path) -> None:
    for seed in (1, 2, 10):
        run(tmp_path / "many" / f"run{seed}", 0.1 * seed, seed=seed)
    alone, many = groups_of([run(tmp_path / "alone", 0.5), tmp_path / "many"])
    assert [sample.name for sample in many.samples] == ["run1", "run2", "run10"]
    assert many.values("estimation.rmse.v1") == pytest.approx([0.1, 0.2, 1.0])
    assert alone.values("findings") == [0.0]
    assert many.facts()["run.seed"] == ("1", "2", "10")
    assert "seed" not in many.metrics


def test_a_chain_has_its_metrics_by_follower(tmp_path: Path) -> None:
    pairs = [{"follower": "robot2", "estimation": {"rmse": {"v1": 0.2}}, "findings": [{"name": "noise"}]}]
    (group,) = groups_of([run(tmp_path / "chain", 0.0, pairs=pairs)])
    assert group.values("pairs.robot2.estimation.rmse.v1") == [0.2]
    assert group.values("pairs.robot2.findings") == [1.0]


def test_cells_of_sweeps_are_matched_by_their_place(tmp_path: Path) -> None:
    a = sweep(tmp_path / "a", cell(0.001, rmse=1.0), cell(0.002, rmse=2.0), cell(0.003, rmse=3.0))
    b = sweep(
        tmp_path / "b",
        cell(0.002, "ukf", rmse=4.0),
        cell(0.001, "ukf", rmse=0.0, diverged=4),
        cell(0.009, "ukf"),
    )
    first, second = groups_of([a, b])
    assert first.values("rmse.v1") == [2.0], "of a cell in which all diverged there is no error to speak of"
    assert second.values("rmse.v1") == [4.0]
    assert second.values("diverged") == [4.0]


def test_judged_logs_that_broke_down_are_runs_without_metrics(tmp_path: Path) -> None:
    logs: list[dict[str, Any]] = [
        {"log": "a.mcap", "summary": summary(0.3)},
        {"log": "b.mcap", "error": "cut off"},
    ]
    logs[0]["failed"] = True
    (tmp_path / "runs").mkdir()
    result = {"folder": str(tmp_path), "logs": logs, "interrupted": True}
    (tmp_path / "runs" / "results.json").write_text(json.dumps(result))
    (group,) = groups_of([tmp_path / "runs"])
    assert [sample.name for sample in group.samples] == ["a.mcap", "b.mcap"]
    assert group.values("estimation.rmse.v1") == [0.3]
    notes = compared([group, group]).notes
    assert "of runs 1 of 2 runs know no estimation.rmse.v1" in notes
    assert "of runs 1 of 2 runs failed a check" in notes
    assert "runs was interrupted, so that it lacks runs" in notes


def test_what_cannot_be_compared_is_said_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    runs, cells = run(tmp_path / "runs", 0.1), sweep(tmp_path / "sweep", cell(0.001))
    other = sweep(tmp_path / "other", cell(0.5))
    for paths, said in (
        ([tmp_path / "nowhere"], "no such file"),
        ([tmp_path / "empty"], "nothing to compare"),
        ([runs, cells], "runs are compared with runs"),
        ([cells, other], "no cell in common"),
    ):
        with pytest.raises(UsageError, match=said):
            groups_of(paths)


def test_labels_are_as_short_as_they_can_be() -> None:
    assert labels_of([Path("a/before"), Path("a/after")]) == ["before", "after"]
    assert labels_of([Path("x/run"), Path("y/run")]) == ["x/run", "y/run"]
    assert labels_of([Path("x"), Path("./x")]) == ["x (1)", "x (2)"]


def test_a_sweep_whose_cells_broke_down_fails(tmp_path: Path) -> None:
    a = sweep(tmp_path / "a", cell(0.001), cell(0.002))
    some = sweep(tmp_path / "some", cell(0.001), cell(0.002, diverged=4))
    every = sweep(tmp_path / "every", cell(0.001, diverged=4), cell(0.002, diverged=4))
    condition = parsed_condition("rmse.v1 > 1.1")
    for other, count in ((some, 1), (every, 2)):
        (failure,) = failures_of([condition], groups_of([a, other]))
        assert f"not known in {count} of 2 cells" in failure.text
    assert not failures_of([condition], groups_of([some, a]))
    with pytest.raises(UsageError, match="does not know"):
        failures_of([condition], groups_of([every, a]))


def test_counts_of_sweeps_are_compared_by_their_runs(tmp_path: Path) -> None:
    a = sweep(tmp_path / "a", cell(0.001, diverged=1), cell(0.002))
    b = sweep(tmp_path / "b", *({**cell(p, diverged=n), "runs": 8} for p, n in ((0.001, 2), (0.002, 0))))
    first, other = groups_of([a, b])
    change = change_of("diverged", first, other)
    assert change is not None
    assert change.ratio == 1.0
    comparison = compared([first, other])
    assert comparison.verdict.best is None
    assert any("as many runs of each cell" in note for note in comparison.notes)


def test_cells_of_a_sweep_share_their_seeds_and_tell_nothing_of_chance(tmp_path: Path) -> None:
    groups = groups_of(
        [
            sweep(tmp_path / name, *(cell(0.001 * n, rmse=e) for n in range(1, 9)))
            for name, e in (("a", 2.0), ("b", 1.0))
        ]
    )
    change = change_of("rmse.v1", *groups)
    assert change is not None
    assert (change.pairs, change.better_in, change.chance) == (8, 8, None)
    assert "chance" not in compared(groups).verdict.text
