"""Workers of a sweep: they end with it, however it ends."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

PATIENCE = 120.0


def children_of(pid: int) -> set[int]:
    """Processes that a process has started, and those that these have."""
    below: set[int] = set()
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except OSError:
                continue
            if parent == pid:
                below |= {int(entry.name)} | children_of(int(entry.name))
    return below


def alive(pid: int) -> bool:
    try:
        state = (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


@pytest.mark.slow
def test_workers_of_a_sweep_that_is_killed_end_by_themselves(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hil", "sweep", "--workers", "2", "--runs", "100000", "--out", "sweep"]
    sweep = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    workers: set[int] = set()
    try:
        deadline = time.monotonic() + PATIENCE
        while not list(tmp_path.glob("sweep/**/*.np[yz]")) and len(workers) < 3:
            assert sweep.poll() is None
            assert time.monotonic() < deadline
            workers = children_of(sweep.pid)
            time.sleep(0.1)
        # They are at work, and not only starting.
        time.sleep(3.0)
        workers = children_of(sweep.pid)
        sweep.send_signal(signal.SIGKILL)
        sweep.wait()
        assert len(workers) >= 2
        while any(map(alive, workers)):
            assert time.monotonic() < deadline, "workers go on"
            time.sleep(0.1)
    finally:
        sweep.kill()
        for pid in filter(alive, workers):
            subprocess.run(["kill", "-9", str(pid)], check=False)
