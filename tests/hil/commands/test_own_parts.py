"""What is said of a law of one's own, once for everything there is to say."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from controllers.laws import Gains, ideal
from controllers.own_law import OwnLaw
from formation.kernel import compiles
from formation.shape import Shape
from formation.spacing import Spacing
from hil.command_line import main
from hil.commands.own_parts import load_own_parts, remarks_on
from hil.errors import UsageError
from hil.scenario.files import load_scenario


def touchy(shape: Any, leader: Any, gains: Any) -> tuple[float, float]:
    if shape.rho < 0.3:
        raise ValueError("too near")
    if shape.rho > 3.0:
        raise ValueError("too far")
    return 0.1, 0.0


def test_a_failing_law_is_remarked_on_once_for_every_error(capsys: pytest.CaptureFixture[str]) -> None:
    law = OwnLaw(touchy, "touchy")
    gains, remark = Gains(1.0, 2.0, Spacing(0.5, 3.0), own=law), remarks_on([law, None])
    for rho in (0.5, 0.2, 0.2, 4.0, 4.0, 0.5):
        ideal(Shape(rho, -1.0, 1.0), 0.1, 0.0, gains)
        remark()
    assert capsys.readouterr().err.splitlines() == [
        "law touchy failed, the robot is told to stand still: ValueError: too near",
        "law touchy failed, the robot is told to stand still: ValueError: too far",
    ]


@pytest.mark.skipif(not compiles(), reason="numba is not in use")
def test_what_runs_interpreted_is_said_before_anything_drives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "parts_of_ones_own.py"
    file.write_text(
        "from estimation.filters.kalman import ExtendedFilter\n"
        "def plain(shape, leader, gains): return 0.1, 0.0\n"
        "def fancy(shape, leader, gains):\n    import cmath\n    return 0.1, 0.0\n"
    )
    load_own_parts(load_scenario("turtlebot3", [f"controller.law={file}:plain"]))
    assert capsys.readouterr().err == ""
    both = [f"controller.law={file}:fancy", f"estimator.kind={file}:ExtendedFilter"]
    load_own_parts(load_scenario("turtlebot3", both))
    law, estimator = capsys.readouterr().err.splitlines()
    assert law.startswith("law parts_of_ones_own.py:fancy runs interpreted: ")
    assert estimator == "estimator parts_of_ones_own.py:ExtendedFilter runs interpreted"
    with pytest.raises(UsageError, match="none is nothing there"):
        load_own_parts(load_scenario("turtlebot3", [f"controller.law={file}:none"]))


def test_what_a_law_prints_is_no_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "loud_law.py"
    file.write_text(
        "print('loud at import')\n"
        "def law(shape, leader, gains):\n    print('asked', {})\n    return 0.1, 0.0\n"
    )
    with pytest.raises(SystemExit) as ended:
        main(["simulate", "--law", f"{file}:law", "--duration", "0.1", "--json"])
    said = capsys.readouterr()
    assert ended.value.code == 0
    assert json.loads(said.out)["final"]["rho"] > 0.0
    assert "loud at import" in said.err
    assert "asked {}" in said.err
