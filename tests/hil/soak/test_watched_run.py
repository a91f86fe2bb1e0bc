"""A live run that is watched from outside."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hil.live.process_table import pids_with
from hil.soak.verified_log import verified_log
from hil.soak.watched_run import watched_run

PATIENCE = 120.0


@pytest.mark.slow
def test_each_process_is_watched_while_it_drives_and_the_log_repeats(tmp_path: Path) -> None:
    told: list[str] = []
    run = watched_run(["turtlebot3", "--duration", "6"], tmp_path / "run", lambda _, held: told.append(held))
    assert run.code == 0, run.said
    assert run.summary["cycles"]["count"] > 300
    assert set(run.memory) == {"run", "emulator", "follower", "recorder"}
    assert all(20.0 < sample.mb < 400.0 for samples in run.memory.values() for sample in samples)
    assert told
    verified = verified_log(tmp_path / "run" / "run.mcap")
    assert verified is not None
    assert verified.compared > 1000
    assert (verified.code, verified.differ) == (0, 0)


def soak(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "hil", "soak", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_soak_that_is_told_to_end_ends_its_run_and_leaves_its_verdict(
    number: signal.Signals, tmp_path: Path
) -> None:
    folder = tmp_path / "soak"
    with soak("--duration", "600", "--out", str(folder)) as process:
        until = time.monotonic() + PATIENCE
        while not (folder / "run.mcap").exists() and time.monotonic() < until:
            time.sleep(0.1)
        # It looks every 5 s.
        time.sleep(8.0)
        process.send_signal(number)
        _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, said
    result = json.loads((folder / "soak.json").read_text(encoding="utf-8"))
    assert {each["name"] for each in result["processes"]} >= {"run", "recorder"}
    assert pids_with(str(folder)) == {}


def test_a_soak_does_not_begin_where_one_was(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "soak.json").write_text("{}", encoding="utf-8")
    for option in ("recorder.rotate_s=0", "recorder.rotate_s=60"):
        with soak("--out", str(tmp_path), "--set", option) as process:
            _, said = process.communicate(timeout=PATIENCE)
        assert process.returncode == 2
        assert "already; give another folder" in said
    assert (tmp_path / "soak.json").read_text(encoding="utf-8") == "{}"


def test_a_run_that_does_not_begin_says_why(tmp_path: Path) -> None:
    run = watched_run(["no-such-scenario"], tmp_path / "run", lambda *_: None)
    assert (run.code, run.summary) == (2, {})
    assert "no-such-scenario" in run.said
    assert verified_log(tmp_path / "run" / "run.mcap") is None
