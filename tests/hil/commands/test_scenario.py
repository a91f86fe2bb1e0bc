"""``abreast scenario``: listed, shown as they are resolved, begun."""

from __future__ import annotations

import json
import re
from pathlib import Path

import msgspec
import pytest

from hil.command_line import main
from hil.scenario.files import load_scenario, scenario_names


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    capsys.readouterr()
    with pytest.raises(SystemExit) as left:
        main(["scenario", *arguments])
    said = capsys.readouterr()
    assert (left.value.code, said.err) == (0, "")
    return said.out


def test_all_are_listed_with_what_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    lines = dict(line.split(maxsplit=1) for line in printed(capsys, "list").splitlines())
    assert lines == {name: load_scenario(name).description for name in scenario_names()}
    found = json.loads(printed(capsys, "list", "--json"))["scenarios"]
    assert {each["name"]: each["description"] for each in found} == lines


@pytest.mark.parametrize("name", scenario_names())
def test_what_is_shown_is_read_back_as_it_is(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--set", "mocap.loss=0.05"]
    path = tmp_path / "shown.toml"
    path.write_text(printed(capsys, "show", name, *options))
    chosen = load_scenario(name, ["mocap.loss=0.05"])
    assert load_scenario(str(path)) == chosen
    assert json.loads(printed(capsys, "show", name, *options, "--json")) == json.loads(
        msgspec.json.encode(chosen)
    )


@pytest.mark.parametrize("name", scenario_names())
def test_a_new_one_is_what_it_began_as_until_it_says_otherwise(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    printed(capsys, "new", "mine.toml", "--from", name)
    text = Path("mine.toml").read_text()
    begun, was = load_scenario("mine.toml"), load_scenario(name)
    assert msgspec.structs.replace(begun, name=was.name, description=was.description) == was
    # With all that is behind a # it is a scenario too, and differs in names and places of a lab only.
    Path("set.toml").write_text(re.sub(r"^# (\w+ = )", r"\1", text, flags=re.MULTILINE))
    set_ = load_scenario("set.toml")
    for section in ("run", "formation", "controller", "mocap", "estimator", "robot"):
        assert getattr(set_, section) == getattr(was, section)


def test_nothing_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("mine")
    with pytest.raises(SystemExit) as left:
        main(["scenario", "new", str(path)])
    assert left.value.code == 2
    assert "is there already" in capsys.readouterr().err
    assert path.read_text() == "mine"


def test_a_new_one_of_a_file_lies_where_it_may(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("base.toml").write_text('base = "turtlebot3"\nmocap = { loss = 0.25 }\n')
    Path("below").mkdir()
    printed(capsys, "new", "below/mine.toml", "--from", "base.toml")
    assert load_scenario("below/mine.toml").mocap.loss == 0.25
