"""Axes from a command line: they take the place of the grid's, and no key of theirs is lost in silence."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.errors import UsageError
from hil.sweep.spec import load_sweep


def test_an_axis_takes_the_place_of_the_grids() -> None:
    sweep = load_sweep("default", axes=["sigma_position=0.001,0.007", "loss=0.3"])
    assert {cell.sigma_position for cell in sweep.cells()} == {0.001, 0.007}
    assert {cell.loss for cell in sweep.cells()} == {0.3}
    assert sweep.spec.grid.latency_s == load_sweep("default").spec.grid.latency_s


def test_parameters_of_a_law_are_an_axis(tmp_path: Path) -> None:
    law = tmp_path / "turning.py"
    law.write_text("def turning(shape, leader, gains):\n    return leader.v1, gains.k\n")
    sweep = load_sweep("noise", [f"controller.law={law}:turning"], ["parameters.k=0,0.5"], runs=1)
    assert [dict(cell.parameters)["k"] for cell in sweep.cells()[:2]] == [0.0, 0.5]


def test_a_set_of_an_axis_is_its_only_value(tmp_path: Path) -> None:
    sweep = load_sweep("default", ["mocap.loss=0.1", "mocap.jitter_s=0.004"])
    assert {cell.loss for cell in sweep.cells()} == {0.1}
    assert sweep.scenario_of(sweep.cells()[0]).mocap.jitter_s == 0.004
    law = tmp_path / "swept.py"
    law.write_text("def swept(shape, leader, gains):\n    return leader.v1, gains.k\n")
    grid = {"sigma_position": [1e-3], "sigma_heading": [1e-2], "parameters": {"k": [0.0, 1.0]}}
    given = [f"controller.law={law}:swept", "controller.parameters.k=0.3"]
    assert [dict(cell.parameters) for cell in load_sweep({"grid": grid}, given).cells()] == [{"k": 0.3}]


@pytest.mark.parametrize(
    ("override", "instead"),
    [
        ("estimator.sigma_heading=0.01", "--grid sigma_heading=0.01"),
        ("estimator.kind=ukf", "--estimators A,B"),
        ("run.seed=3", "--seed N"),
        ("run.duration_s=5", "--duration S"),
    ],
)
def test_a_key_that_every_cell_sets_is_refused_with_what_to_give(override: str, instead: str) -> None:
    with pytest.raises(UsageError) as caught:
        load_sweep("default", [override])
    assert instead in str(caught.value)


@pytest.mark.parametrize("axis", ["sigma_position", "sigma_position=", "=0.1", "loss=few", "noise=0.1"])
def test_what_is_no_axis_is_refused(axis: str) -> None:
    with pytest.raises(UsageError, match=r"--grid|unknown key 'noise'"):
        load_sweep("default", axes=[axis])
