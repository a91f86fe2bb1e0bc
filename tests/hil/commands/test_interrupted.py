"""Ctrl-C leaves a verdict of what there is."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from hil.judge.replayed import ReplayChoice, replayed
from hil.log import bulk
from hil.log.reader import Log, read_log
from hil.wire.message_types import String
from hil.wire.messages import decode_as

PATIENCE = 300.0


def interrupted(folder: Path, ready: Callable[[], bool], *arguments: str) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command that gets a SIGINT once something is there."""
    command = [sys.executable, "-m", "hil", *arguments]
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        until_s = time.monotonic() + PATIENCE
        while not ready() and process.poll() is None and time.monotonic() < until_s:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
    return process.returncode, out, err


@pytest.mark.parametrize("options", [[], ["--json"]])
def test_a_lockstep_run_is_judged_up_to_there_and_its_log_is_whole(
    options: list[str], tmp_path: Path
) -> None:
    log = tmp_path / "out" / "run.mcap"
    code, out, err = interrupted(
        tmp_path,
        lambda: log.exists() and log.stat().st_size > 200_000,
        *("run", "--lockstep", "--duration", "100000", "--out", "out", *options),
    )
    assert code == 130, err
    assert "the log is whole" in err.splitlines()[-1]
    if options:
        assert json.loads(out)["estimation"]["samples"] > 0
    else:
        assert "RMSE v1" in out
    whole = read_log(log)
    (stop,) = [decode_as(record.payload, String) for record in whole.records(["stop"])]
    assert stop.data == "interrupted"
    assert (tmp_path / "out" / "report.html").exists()


def test_a_sweep_reports_what_was_flown_and_goes_on_later(tmp_path: Path) -> None:
    parts = tmp_path / "out" / "parts"
    words = ["sweep", "--runs", "60", "--duration", "5", "--estimators", "ekf", "--out", "out", "--json"]
    code, out, err = interrupted(tmp_path, lambda: any(parts.glob("*.npy")), *words, "--workers", "1")
    assert code == 130, err
    assert "goes on" in err.splitlines()[-1]
    result = json.loads(out)
    assert result["interrupted"]
    assert sum(cell["runs"] for cell in result["cells"]) == result["runs_done"]
    assert json.loads((tmp_path / "out" / "results.json").read_text())["interrupted"]
    assert (tmp_path / "out" / "report.html").exists()


def test_a_replay_ends_where_it_is_told_to(short_log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bulk, "_BATCH_BYTES", 1)
    told: list[float] = []

    def go_on(share: float) -> bool:
        told.append(share)
        return share < 0.6

    whole = replayed(short_log, ReplayChoice(verify=True))
    part = replayed(short_log, ReplayChoice(verify=True, go_on=go_on))
    assert told == sorted(told)
    assert told[-2] < 0.6 <= told[-1] < 1.0
    share = part.summary["estimation"]["samples"] / whole.summary["estimation"]["samples"]
    assert 0.1 < share < 0.6
    assert part.why_not_same(short_log) == ""
    compared = [each.summary["parity"]["estimates"]["compared"] for each in (part, whole)]
    assert 0 < compared[0] < compared[1]
