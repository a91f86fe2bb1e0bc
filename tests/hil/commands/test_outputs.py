"""What commands are given to read and to write: what cannot be is refused in one line, before any work."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hil.command_line import main
from hil.commands.outputs import new_folder
from hil.errors import UsageError
from hil.log.reader import Log

LONG = "n" * 300


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line by which arguments are refused."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    said = capsys.readouterr().err
    assert ended.value.code == 2, said
    assert said.count("\n") == 1, said
    return said


BAD = ("folder", "empty", "rubbish", "missing", LONG, "not\udcff", "folder/below", "empty/below")
"""Names in a folder of which none is anything that a command can read."""

READERS = [
    ("replay",),
    ("replay", "--verify"),
    ("replay", "--propose-map"),
    ("calibrate",),
    ("recover", "--out", "whole.mcap"),
    ("import", "csv"),
    ("import", "tum", "tum.txt"),
    ("import", "mrclam", "--leader", "1", "--follower", "2", "--out", "pair.mcap"),
    ("simulate",),
    ("bounds",),
    ("gains",),
    ("sweep",),
    ("run", "--lockstep"),
    ("run",),
    ("doctor",),
    ("status",),
    ("emulator",),
    ("estimator",),
    ("controller",),
    ("follower",),
    ("leader",),
    ("recorder", "--out", "log.mcap"),
    ("bridge", "ros2"),
    ("replay", "log.mcap", "--map"),
    ("import", "csv", "table.csv", "--map"),
    ("import", "csv", "table.csv", "--scenario"),
    ("stop", "enough", "--scenario"),
    ("run", "--zenoh-config"),
    ("status", "turtlebot3", "--zenoh-config"),
]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, short_log: Log) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "empty").touch()
    (tmp_path / "rubbish").write_bytes(bytes(range(256)) * 40)
    (tmp_path / os.fsdecode(b"not\xff")).write_bytes(b"\xff\xfe\x00\xd8")
    (tmp_path / "tum.txt").write_text("0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n")
    (tmp_path / "table.csv").write_text("t,x\n0,1\n")
    (tmp_path / "log.mcap").write_bytes(short_log.path.read_bytes())
    return tmp_path


@pytest.mark.parametrize("command", READERS, ids=" ".join)
def test_what_cannot_be_read_is_refused_in_one_line(
    command: tuple[str, ...], here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in BAD:
        refused(capsys, *command, name)


@pytest.mark.parametrize("command", READERS, ids=" ".join)
def test_a_nul_in_an_argument_is_refused_in_one_line(
    command: tuple[str, ...], here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "NUL" in refused(capsys, *command, "a\0b")


@pytest.mark.parametrize(
    "override",
    [
        r'name="a\u0000b"',
        r'leader.body="\u0007"',
        r'source.topic="a\u001bb"',
        r'wire.topics={"follower/odom" = "a\u0000"}',
        r'wire.topics={"a\u0000" = "odom"}',
        "name=\udcff",
        "name='not\udcff'",
        "estimator.kind=\udcff.py:make",
        r'controller.law="a\u0000.py:law"',
    ],
)
def test_a_control_character_in_a_setting_is_refused_in_one_line(
    override: str, capsys: pytest.CaptureFixture[str]
) -> None:
    refused(capsys, "run", "--lockstep", "--set", override)


WRITERS = [
    ("replay", "log.mcap", "--csv"),
    ("import", "csv", "table.csv", "--out"),
    ("import", "tum", "tum.txt", "tum.txt", "--out"),
    ("import", "mrclam", "folder", "--leader", "1", "--follower", "2", "--out"),
    ("recover", "log.mcap", "--out"),
    ("recorder", "turtlebot3", "--out"),
]


@pytest.mark.parametrize("command", WRITERS, ids=" ".join)
@pytest.mark.parametrize("name", ["nodir/x", "folder", "empty/x", LONG, f"folder/{LONG}"])
def test_a_file_that_cannot_be_written_is_refused_before_anything_is_read(
    command: tuple[str, ...], name: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for unread in ("log.mcap", "table.csv", "tum.txt"):
        (here / unread).unlink()
    assert f"{command[-1]} " in refused(capsys, *command, name)


@pytest.mark.parametrize("command", ["run", "simulate", "sweep", "replay"])
@pytest.mark.parametrize("name", ["empty", "empty/x", LONG, f"folder/{LONG}/x"])
def test_a_folder_that_cannot_be_made_is_refused_before_anything_is_read(
    command: str, name: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "--out " in refused(capsys, command, "no_such", "--out", name)


POWERLESS = ["setpriv", "--bounding-set=-all", "--inh-caps=-all"] if os.geteuid() == 0 else []
"""What begins a command that may no more than its files let it, even as root."""


@pytest.mark.parametrize(("options", "words"), [(["--csv", "folder/x.csv"], "--csv"), ([], "log.mcap")])
def test_who_may_not_write_or_read_is_told_first(here: Path, options: list[str], words: str) -> None:
    (here / "folder").chmod(0o500)
    (here / "log.mcap").chmod(0)
    command = [*POWERLESS, sys.executable, "-m", "hil", "replay", "log.mcap", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert words in done.stderr


def test_folders_of_one_second_are_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("hil.commands.outputs.time.strftime", lambda _: "20250101-120000")
    made = [new_folder("pair").name for _ in range(3)]
    assert made == ["pair-20250101-120000", "pair-20250101-120000-2", "pair-20250101-120000-3"]
    with pytest.raises(UsageError, match="cannot be made"):
        new_folder(LONG)


@pytest.mark.parametrize("command", [("simulate",), ("replay", "run.mcap")])
def test_figures_without_a_folder_are_refused(
    capsys: pytest.CaptureFixture[str], command: tuple[str, ...]
) -> None:
    assert "--out DIR" in refused(capsys, *command, "--figures", "pdf")
