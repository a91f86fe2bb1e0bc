"""A handful of faults in live runs, by the command itself."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hil.live.process_table import pids_with

HANDFUL = ("kill-follower-run", "stop-follower-run", "cut-1s-relay", "second-controller", "mocap-dropout")


def faults(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "hil", "faults", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=900.0)


@pytest.mark.slow
def test_a_handful_of_faults_does_not_let_a_robot_go(tmp_path: Path) -> None:
    chosen = [word for name in HANDFUL for word in ("--only", name)]
    done = faults(*chosen, "--json", "--out", str(tmp_path))
    result = json.loads(done.stdout)
    assert done.returncode == 0, done.stderr
    assert {case["fault"] for case in result["cases"]} == set(HANDFUL)
    # A robot that did not drive would be told nothing for long as well.
    assert all(case["oldest_command_s"] > 0.0 for case in result["cases"])
    # The controller goes on for as long as a measurement may be old, and no longer.
    (blind,) = (case for case in result["cases"] if case["fault"] == "mocap-dropout")
    assert 0.1 < blind["runaway_s"] < 0.3
    assert result == json.loads((tmp_path / "faults.json").read_text(encoding="utf-8"))
    assert "kill-follower-run" in (tmp_path / "reliability.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_ctrl_c_leaves_what_was_tried_by_then(tmp_path: Path) -> None:
    words = ["faults", "--only", "term-recorder-by-hand", "--tries", "50", "--out", str(tmp_path), "--json"]
    with subprocess.Popen(
        [sys.executable, "-m", "hil", *words], stdout=subprocess.PIPE, text=True
    ) as process:
        until = time.monotonic() + 300.0
        # The second try has begun once its folder is there.
        while time.monotonic() < until and not second_tries(process.pid):
            time.sleep(0.2)
        # Whoever is in a hurry presses it twice.
        process.send_signal(signal.SIGINT)
        time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        told, _ = process.communicate(timeout=120.0)
    assert pids_with("abreast-faults-") == {}
    assert process.returncode == 130
    (case,) = json.loads(told)["cases"]
    assert case["fault"] == "term-recorder-by-hand"
    assert 1 <= case["tries"] < 50
    assert (tmp_path / "reliability.md").is_file()


def second_tries(pid: int) -> list[str]:
    """Processes of a second or later try."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8").split()
    words = [Path(f"/proc/{each}/cmdline").read_text(encoding="utf-8") for each in children]
    return [each for each in words if re.search(r"abreast-faults-\w+/1-[1-9]", each)]


def test_a_fault_that_is_none_is_said() -> None:
    done = faults("--only", "gremlins")
    assert (done.returncode, done.stdout) == (2, "")
    assert "gremlins" in done.stderr
    assert "--list" in done.stderr


def test_what_is_there_is_added_to_if_it_is_a_result(tmp_path: Path) -> None:
    assert faults("--add", "--only", "kill-follower-run").returncode == 2
    (tmp_path / "faults.json").write_text('{"cases": 3}', encoding="utf-8")
    done = faults("--add", "--out", str(tmp_path), "--only", "kill-follower-run")
    assert (done.returncode, done.stdout) == (2, "")
    assert "faults.json is no result" in done.stderr


def test_drivers_in_ros_take_rclpy() -> None:
    done = faults("--ros", "--only", "kill-follower-run")
    assert (done.returncode, done.stdout) == (2, "")
    assert "--ros: rclpy is not installed here" in done.stderr


def test_all_names_are_listed() -> None:
    done = faults("--list")
    assert done.returncode == 0
    assert set(HANDFUL) <= set(done.stdout.split())
