"""The unit and the commands of docs/operations.md."""

from __future__ import annotations

import configparser
import re
import shutil
import subprocess
from pathlib import Path

import click
import pytest

from hil.command_line import abreast
from hil.guard.report import node_of
from hil.scenario.files import load_scenario
from hil.scenario.links import links_of, node_names

ROOT = Path(__file__).resolve().parent.parent
UNIT = ROOT / "packaging" / "systemd" / "abreast@.service"
GUIDE = (ROOT / "docs" / "operations.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r'^COMMAND="(.*)"$', GUIDE, re.MULTILINE)


class Unit(configparser.ConfigParser):
    """A unit of systemd, whose names are in upper and lower case."""

    def optionxform(self, optionstr: str) -> str:
        return optionstr


def read_unit() -> Unit:
    unit = Unit(interpolation=None, strict=False)
    unit.read_string(UNIT.read_text(encoding="utf-8"))
    return unit


def test_the_unit_starts_a_daemon_again_a_few_times_and_hears_whether_it_lives() -> None:
    unit = read_unit()
    service = unit["Service"]
    assert service["Type"] == "notify"
    assert float(service["WatchdogSec"]) >= 10.0
    assert (service["Restart"], service["RestartPreventExitStatus"]) == ("on-failure", "2")
    limits = unit["Unit"]
    burst, each_s = int(limits["StartLimitBurst"]), float(service["RestartSec"])
    # It tries for a while, and then no more.
    assert 60.0 <= burst * each_s < float(limits["StartLimitIntervalSec"])


def test_systemd_takes_the_unit(tmp_path: Path) -> None:
    analyze = shutil.which("systemd-analyze")
    copy = tmp_path / "abreast@follower.service"
    copy.write_text(UNIT.read_text(encoding="utf-8"), encoding="utf-8")
    if analyze is not None:
        done = subprocess.run([analyze, "verify", str(copy)], capture_output=True, text=True, check=False)
        assert "abreast@follower.service:" not in done.stderr, done.stderr
    words = read_unit()["Service"]["ExecStart"].removeprefix("/bin/sh -c ").strip("'")
    told = subprocess.run(
        ["/bin/sh", "-c", words.replace("exec abreast", "echo")],
        env={"COMMAND": "recorder my_lab.toml --out $(date +%Y).mcap", "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert re.fullmatch(r"recorder my_lab\.toml --out \d{4}\.mcap\n", told)


def parsed(words: list[str]) -> str:
    """The command that words belong to; raises :class:`click.UsageError` for options that it has not."""
    command: click.Command | None = abreast
    name = ""
    while isinstance(command, click.Group):
        name, *words = words
        command = command.get_command(click.Context(command), name)
    assert command is not None, name
    command.make_context(name, words)
    return name


@pytest.mark.parametrize("line", COMMANDS)
def test_each_service_is_a_command_that_there_is(
    line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert parsed(line.replace("$(date +%Y%m%d-%H%M%S)", "now").split()) in line


def test_what_is_needed_are_nodes_that_there_are() -> None:
    named = re.findall(r"--needs ([\w/,]+)", GUIDE)
    links = links_of(load_scenario("turtlebot3"))
    nodes = {name for daemon in ("recorder", "follower", "leader") for name in node_names(daemon, links)}
    guards = {node_of(robot) for robot in ("leader", "follower")}
    assert len(named) >= 2
    assert {node for each in named for node in each.split(",")} <= nodes | guards


def test_there_are_services_to_look_at() -> None:
    assert len(COMMANDS) >= 4
