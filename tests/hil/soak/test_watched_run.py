"""A live run that is watched from outside."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.soak.verified_log import verified_log
from hil.soak.watched_run import watched_run


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


def test_a_run_that_does_not_begin_says_why(tmp_path: Path) -> None:
    run = watched_run(["no-such-scenario"], tmp_path / "run", lambda *_: None)
    assert (run.code, run.summary) == (2, {})
    assert "no-such-scenario" in run.said
    assert verified_log(tmp_path / "run" / "run.mcap") is None
