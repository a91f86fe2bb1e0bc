"""The console script: exit codes, one line per mistake, one JSON object on stdout."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from hil.command_line import COMMANDS, main
from hil.errors import UsageError
from hil.judge.run_data import run_data_of_log
from hil.live.run import Outcome
from hil.lockstep.run import run_lockstep
from hil.log.reader import Log, read_log
from hil.log.rotating_log import log_place
from hil.reports.judged_log import claimed
from hil.scenario.checked_toml import data_folder
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from tests.hil.small_disk import small_disk


def abreast(*arguments: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "hil", *arguments], capture_output=True, text=True, cwd=folder
    )


def test_help_names_every_command() -> None:
    result = abreast("--help")
    assert result.returncode == 0
    assert all(f"  {name} " in result.stdout for name in COMMANDS)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["rnu"], "rnu"),
        (["run", "--speed", "3"], "--speed"),
        (["run", "turtelbot3"], "did you mean 'turtlebot3'"),
        (["run", "--set", "mocap.los=0.1"], "did you mean 'loss'"),
        (["run", "--set", "mocap.rate_hz=-5"], "mocap.rate_hz"),
        (["run", "--set", "mocap.rate_hz=often"], "mocap.rate_hz"),
        (["run", "--set", "formation.rho_0=0"], "formation.rho_0"),
        (["run", "--estimator", "kalman"], "estimator.kind"),
        (["run", "--duration", "-3"], "--duration"),
        (["estimator", "turtlebot3", "--listen", "nonsense"], "nonsense"),
        (["recorder", "turtlebot3"], "--out"),
        (["replay", "no_such.mcap"], "no_such.mcap"),
        (["simulate", "turtlebot3", "--law", "clever"], "controller.law"),
        (["run", "--real", "--lockstep"], "--real"),
        (["run", "--no-guard", "--lockstep"], "--no-guard"),
        (["guard", "turtlebot3", "--robot", "bob"], "one of: leader, follower"),
        (["arm", "bob"], "one of: leader, follower"),
        (["run", "--leader", "hand"], "--real"),
        (["run", "--emulate", "leader"], "--real"),
        (["run", "--real", "--emulate", "leader", "--countdown", "1"], "--countdown"),
        (["run", "--real", "--leader", "hand", "--countdown", "1"], "--countdown"),
        (["run", "chain5-turtlebot3", "--real", "--emulate", "follower"], "--emulate"),
    ],
)
def test_a_mistake_gives_exit_code_2_and_one_line(
    arguments: list[str],
    said: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    printed = capsys.readouterr()
    assert ended.value.code == 2
    assert printed.out == ""
    assert len(printed.err.strip().splitlines()) == 1
    assert said in printed.err
    assert list(tmp_path.iterdir()) == []


def test_a_lockstep_run_prints_one_json_object_and_leaves_its_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["run", "--lockstep", "--duration", "3", "--seed", "7", "--json", "--out"]
    first = abreast(*arguments, "a", folder=tmp_path)
    assert first.returncode == 0, first.stderr
    summary = json.loads(first.stdout)
    assert (summary["scenario"], summary["seed"], summary["mode"]) == ("turtlebot3", 7, "lockstep")
    took = summary.pop("lockstep")
    assert took["times_real_time"] == pytest.approx(3.0 / took["wall_s"])
    assert json.loads((tmp_path / "a" / "summary.json").read_text()) == summary
    again = tmp_path / "again.mcap"
    run_lockstep(load_scenario("turtlebot3", ["run.duration_s=3.0", "run.seed=7"]), again)
    assert (tmp_path / "a" / "run.mcap").read_bytes() == again.read_bytes()
    with pytest.raises(SystemExit) as refused:
        main([*arguments, str(tmp_path / "a")])
    assert refused.value.code == 2
    assert "run.mcap exists already" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--from", "--to"])
@pytest.mark.parametrize("given", ["nan", "inf", "-inf", "1e300"])
def test_a_time_that_no_clock_tells_is_refused(
    option: str, given: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for command in ("replay", "calibrate"):
        with pytest.raises(SystemExit) as ended:
            main([command, "no_such.mcap", option, given])
        assert ended.value.code == 2
        assert option in capsys.readouterr().err


@pytest.mark.parametrize(
    "override",
    [
        "mocap.latency_s=1e300",
        "mocap.clock_offset_s=1e12",
        "mocap.clock_offset_s=-1e10",
        "controller.transport_s=1e20",
        "estimator.transport_latency_s=1e12",
        "robot.odometry_delay_s=1e12",
        "controller.max_age_s=1e300",
        "estimator.sigma_position=1e300",
    ],
)
def test_a_number_that_no_lab_has_is_a_mistake(override: str) -> None:
    with pytest.raises(UsageError, match=override.partition("=")[0]):
        load_scenario("turtlebot3", [override])


def test_a_name_that_is_no_text_is_written_as_far_as_it_is(tmp_path: Path, short_log: Log) -> None:
    mine = tmp_path / os.fsdecode(b"lab\xff.toml")
    mine.write_bytes((data_folder() / "scenarios" / "turtlebot3.toml").read_bytes())
    assert load_scenario(str(mine)).name == "lab?"
    log = tmp_path / os.fsdecode(b"run\xff.mcap")
    log.write_bytes(short_log.path.read_bytes())
    facts = run_data_of_log(read_log(log)).log
    assert facts is not None
    assert facts.path == f"{tmp_path}/run?.mcap"


def test_two_runs_do_not_write_into_one_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with claimed(tmp_path):
        for how in (["--lockstep"], []):
            assert main_code(["run", *how, "--duration", "0.3", "--out", str(tmp_path)]) == 2
            assert "another run" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_told_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "summary.json").symlink_to("/dev/full")
    assert main_code(["run", "--lockstep", "--duration", "0.3", "--out", str(tmp_path)]) == 1
    assert "No space left" in capsys.readouterr().err.splitlines()[-1]
    assert read_log(tmp_path / "run.mcap").messages > 100


def test_a_log_that_fills_its_disk_is_whole_and_both_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with small_disk(tmp_path / "disk", 1) as folder:
        (folder / "others").write_bytes(bytes(900_000))
        out = folder / "out"
        assert main_code(["run", "--lockstep", "--duration", "3", "--out", str(out)]) == 1
        said = capsys.readouterr().err.splitlines()[-1]
        assert (
            f"log {out / 'run.mcap'}: writing failed (No space left on device) on disk {folder} (0.0 MB"
            in said
        )
        assert read_log(out / "run.mcap").messages > 100
        assert {each.name for each in out.iterdir()} == {"run.mcap", "scenario.toml"}


def main_code(arguments: list[str]) -> object:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    return ended.value.code


def test_a_run_that_broke_down_says_so_even_without_room_for_a_verdict(
    tmp_path: Path, short_log: Log, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(_scenario: Scenario, log_path: Path, _live: object) -> Outcome:
        log_path.write_bytes(short_log.path.read_bytes())
        return Outcome("the recorder ended", False, 0.0, "the robots were told to stand")

    monkeypatch.setattr("hil.commands.run._live", broken)
    (tmp_path / "summary.json").symlink_to("/dev/full")
    assert main_code(["run", "--out", str(tmp_path)]) == 1
    told = "the run broke down: the recorder ended; the robots were told to stand, the log is"
    assert told in capsys.readouterr().err.splitlines()[-1]


def test_a_run_that_somebody_stopped_did_not_break_down(
    tmp_path: Path, short_log: Log, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stopped(_scenario: Scenario, log_path: Path, _live: object) -> Outcome:
        log_path.write_bytes(short_log.path.read_bytes())
        return Outcome("stopped after 12.7 s: enough (by me)", False, 12.7, "the robots stand", stopped=True)

    monkeypatch.setattr("hil.commands.run._live", stopped)
    assert main_code(["run", "--out", str(tmp_path)]) == 1
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith("abreast: stopped after 12.7 s: enough (by me); the robots stand, the log is ")


def test_pieces_of_a_log_are_made_whole_or_put_aside(
    tmp_path: Path, short_log: Log, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    content = short_log.path.read_bytes()

    def broken(scenario: Scenario, log_path: Path, _live: object) -> Outcome:
        place = log_place(log_path, scenario.recorder)
        place.mkdir()
        (place / "run_0.mcap").write_bytes(content[: -len(content) // 10])
        (place / "run_1.mcap").write_bytes(content[:1000])
        return Outcome("the recorder was killed", False, 0.0, "the robots stand", recorded=True)

    monkeypatch.setattr("hil.commands.run._live", broken)
    assert main_code(["run", "--out", str(tmp_path), "--set", "recorder.rotate_s=1"]) == 1
    said = capsys.readouterr().err
    assert "the run broke down: the recorder was killed" in said.splitlines()[-1]
    assert "run_1.mcap: holds nothing to recover" in said
    names = sorted(each.name for each in (tmp_path / "run").iterdir())
    assert names == ["run_0.mcap", "run_0.mcap.cut", "run_1.mcap.cut"]
    assert read_log(tmp_path / "run" / "run_0.mcap").messages > 100
    assert (tmp_path / "summary.json").exists()


def test_a_log_that_is_gone_after_a_run_is_what_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def driven(*_: object) -> Outcome:
        return Outcome("", False, 1.0, "the robots stand", recorded=True)

    monkeypatch.setattr("hil.commands.run._live", driven)
    assert main_code(["run", "--out", str(tmp_path)]) == 1
    assert f"log {tmp_path / 'run.mcap'} is not there any more" in capsys.readouterr().err


def test_times_of_a_recording_may_count_from_1970(capsys: pytest.CaptureFixture[str]) -> None:
    assert main_code(["replay", "no_such.mcap", "--from", "1767225600.5", "--to", "1767225700"]) == 2
    assert "no such file" in capsys.readouterr().err
