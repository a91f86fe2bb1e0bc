"""The law and the estimator of the guide: flown in lockstep, simulated, swept, replayed, and driven live."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from mcap.reader import make_reader

from hil.command_line import main
from hil.scenario.schema import ESTIMATOR_NAMES, LAW_NAMES

GUIDE = Path(__file__).parents[1] / "docs" / "extend.md"
SHORT = ("--duration", 4, "--set", "run.evaluate_from_s=2")
K = ("--set", "controller.parameters.k=0.5")
SWEEP = """
scenario = "turtlebot3"
runs = 2
duration_s = 4.0
[grid]
sigma_position = [0.0003]
sigma_heading = [0.0035]
"""
PROP_2 = """
def prop2(shape, leader, gains):
    f = gains.mu_rho * ((shape.rho - gains.rho_0) / shape.rho) * ((shape.rho + gains.rho_0) / shape.rho)
    v2 = -leader.v1 * shape.sin1 + shape.rho * (leader.v1 * f - gains.mu1 * shape.cos1)
    driven = max(-gains.v_max, min(gains.v_max, v2))
    line_rate = (leader.v1 * shape.sin1 + driven * shape.sin2) / shape.rho
    return v2, line_rate - gains.mu2 * shape.cos2

def interpreted(shape, leader, gains):
    import cmath
    return prop2(shape, leader, gains)

def hopeless(shape, leader, gains):
    raise ValueError("no idea")
"""


class Said(NamedTuple):
    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


Call = Callable[..., Said]


def blocks() -> dict[str, str]:
    """Python of the guide by the file that its first line names."""
    found = re.findall(r"```python\n# (\S+\.py)\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)
    return dict(found)


@pytest.fixture
def abreast(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Call:
    """The console script in a folder that holds the files of the guide."""
    monkeypatch.chdir(tmp_path)
    for name, text in blocks().items():
        (tmp_path / name).write_text(text)
    (tmp_path / "laws_to_test.py").write_text(PROP_2)
    (tmp_path / "small.toml").write_text(SWEEP)

    def call(*arguments: object) -> Said:
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main([str(argument) for argument in arguments])
        caught = capsys.readouterr()
        assert isinstance(left.value.code, int)
        return Said(left.value.code, caught.out, caught.err)

    return call


def commands(log: Path) -> list[tuple[int, bytes]]:
    with log.open("rb") as stream:
        return [
            (message.log_time, message.data)
            for _, channel, message in make_reader(stream).iter_messages()
            if channel.topic.endswith(("/command", "/cmd_vel"))
        ]


def test_the_guide_keeps_its_word() -> None:
    law, estimator = blocks()["my_law.py"], blocks()["my_filter.py"]
    assert len(law.strip().splitlines()) <= 10
    assert len(estimator.strip().splitlines()) <= 40


def test_the_law_of_the_guide_is_simulated_flown_and_replayed(abreast: Call) -> None:
    law = ("--law", "my_law.py:eager", *K)
    said = abreast("simulate", *law, "--json")
    assert said.code == 0
    assert said.json["final"]["rho"] > 0.0
    assert "in_region_of_attraction" not in said.json
    flown = abreast("run", "--lockstep", *SHORT, *law, "--out", "flown", "--json")
    assert flown.code == 0
    assert "interpreted" not in flown.err
    assert flown.json["law"]["name"] == "my_law.py:eager"
    assert "why" in flown.json["certificate"]["formation"]
    again = abreast("replay", "flown/run.mcap", "--verify", "--json")
    assert again.code == 0
    assert again.json["parity"]["commands"]["mismatched"] == 0
    assert again.json["law"] == flown.json["law"]


def test_the_law_and_the_estimator_of_the_guide_are_swept(abreast: Call, tmp_path: Path) -> None:
    with (tmp_path / "small.toml").open("a") as file:
        file.write("[grid.parameters]\nk = [0.0, 0.5]\n")
    estimators = ("--estimators", "ekf,my_filter.py:robust")
    given = ("small.toml", "--law", "my_law.py:eager", *estimators, "--workers", 1)
    said = abreast("sweep", *given, "--out", "swept", "--json")
    assert said.code == 0
    assert "estimator my_filter.py:robust runs interpreted" in said.err
    cells = said.json["cells"]
    assert [cell["parameters"]["k"] for cell in cells] == [0.0, 0.0, 0.5, 0.5]
    assert {cell["estimator"] for cell in cells} == {"ekf", "my_filter.py:robust"}
    assert all(cell["diverged"] == 0 and cell["samples"] > 0 for cell in cells)
    assert cells[0]["formation"] != cells[2]["formation"]
    assert "k 0.5" in (tmp_path / "swept" / "report.html").read_text()
    # Another law under the same name is another sweep.
    with (tmp_path / "my_law.py").open("a") as file:
        file.write("\n")
    other = abreast("sweep", *given, "--out", "swept")
    assert other.code == 2
    assert "holds another sweep" in other.err


def test_the_estimator_of_the_guide_is_flown_and_replayed(abreast: Call) -> None:
    given = ("--estimator", "my_filter.py:robust")
    flown = abreast("run", "--lockstep", *SHORT, *given, "--out", "flown", "--json")
    assert flown.code == 0
    assert flown.json["estimator"] == "my_filter.py:robust"
    assert flown.json["estimation"]["rmse"]["v1"] < 0.01
    again = abreast("replay", "flown/run.mcap", "--verify", "--json")
    assert again.json["parity"]["estimates"]["mismatched"] == 0
    ekf = abreast("replay", "flown/run.mcap", "--estimator", "ekf", "--json")
    assert ekf.json["estimator"] == "ekf"
    assert abreast("replay", "flown/run.mcap", *given, "--verify").code == 0


@pytest.mark.slow
@pytest.mark.parametrize("given", [("--law", "my_law.py:eager", *K), ("--estimator", "my_filter.py:robust")])
def test_what_the_guide_has_is_driven_live(abreast: Call, given: tuple[str, ...]) -> None:
    driven = abreast("run", *SHORT, *given, "--out", "driven", "--json")
    assert driven.code == 0, driven.err
    assert driven.json["commands"]["sent"] > 100
    assert abreast("replay", "driven/run.mcap", "--verify").code == 0


@pytest.mark.parametrize("law", ["prop2", "interpreted"])
def test_prop_2_of_ones_own_drives_with_the_bits_of_the_shipped_one(abreast: Call, law: str) -> None:
    orders = ("--set", "formation.change_sides_at_s=[2.0]", "--set", "leader.k_u=0.2")
    shipped = abreast("run", "--lockstep", *SHORT, *orders, "--out", "shipped")
    own = abreast("run", "--lockstep", *SHORT, *orders, "--out", "own", "--law", f"laws_to_test.py:{law}")
    assert (shipped.code, own.code) == (0, 0)
    assert ("runs interpreted" in own.err) == (law == "interpreted")
    assert commands(Path("own/run.mcap")) == commands(Path("shipped/run.mcap"))


def test_a_law_that_fails_stops_the_robot_by_name(abreast: Call) -> None:
    said = abreast(
        "run", "--lockstep", *SHORT, "--law", "laws_to_test.py:hopeless", "--out", "failed", "--json"
    )
    assert said.code == 1
    why = "law laws_to_test.py:hopeless failed in"
    assert (
        f"{why} {said.json['law']['failed']} commands, the robot stood still: ValueError: no idea" in said.err
    )
    simulated = abreast("simulate", "--law", "laws_to_test.py:hopeless")
    assert simulated.code == 1
    assert "law laws_to_test.py:hopeless failed: ValueError: no idea" in simulated.err
    chain = abreast("simulate", "chain5", "--law", "laws_to_test.py:hopeless")
    assert chain.code == 1
    assert "failed: ValueError: no idea" in chain.err
    swept = abreast("sweep", "small.toml", "--law", "laws_to_test.py:hopeless", "--workers", 1, "--out", "s")
    assert swept.code == 1
    assert "failed in 2 runs, the robot stood still; first in cell 0: ValueError: no idea" in swept.err


def test_a_replay_holds_a_law_to_its_digest_before_it_is_imported(abreast: Call, tmp_path: Path) -> None:
    law = tmp_path / "laws_to_test.py"
    assert abreast("run", "--lockstep", *SHORT, "--law", f"{law}:prop2", "--out", "flown").code == 0
    original = law.read_text()
    law.write_text("raise SystemExit('imported')\n" + original)
    other = abreast("replay", "flown/run.mcap", "--verify")
    assert other.code == 2
    assert "its law laws_to_test.py:prop2" in other.err
    assert "is another one by now" in other.err
    assert "give it with --law FILE.py:prop2" in other.err
    law.rename(tmp_path / "gone.py")
    assert "is not at" in abreast("replay", "flown/run.mcap", "--verify").err
    moved = tmp_path / "moved.py"
    moved.write_text(original)
    assert abreast("replay", "flown/run.mcap", "--verify", "--law", "moved.py:prop2").code == 0
    judged = abreast("replay", "flown/run.mcap", "--law", "independent", "--json")
    assert judged.code == 0
    assert "law" not in judged.json or judged.json["law"] == "independent"
    assert abreast("replay", "flown/run.mcap", "--law", "independent", "--verify").code == 2


@pytest.mark.parametrize(("option", "known"), [("--law", LAW_NAMES), ("--estimator", ESTIMATOR_NAMES)])
def test_an_unknown_name_is_answered_by_the_known_ones(
    abreast: Call, option: str, known: tuple[str, ...]
) -> None:
    said = abreast("run", "--lockstep", option, "best")
    assert said.code == 2
    assert all(repr(name) in said.err for name in known)
    assert "file.py:" in said.err


def test_parameters_are_for_a_law_of_ones_own(abreast: Call) -> None:
    said = abreast("simulate", *K)
    assert said.code == 2
    assert "controller.parameters are of a law of one's own" in said.err
    clash = abreast("simulate", "--law", "my_law.py:eager", "--set", "controller.parameters.mu1=1.0")
    assert clash.code == 2
    assert "parameter 'mu1' of law my_law.py:eager: expected a name of its own" in clash.err


def test_paths_in_a_scenario_count_from_its_folder(abreast: Call, tmp_path: Path) -> None:
    folder = tmp_path / "scenarios"
    folder.mkdir()
    (tmp_path / "my_law.py").rename(folder / "my_law.py")
    shipped = (Path(__file__).parents[1] / "data/scenarios/turtlebot3.toml").read_text()
    text = shipped.replace("[controller]", '[controller]\nlaw = "my_law.py:eager"\nparameters = {k = 0.5}')
    (folder / "mine.toml").write_text(re.sub(r'\nlaw = "independent"', "", text))
    assert abreast("simulate", "scenarios/mine.toml").code == 0
