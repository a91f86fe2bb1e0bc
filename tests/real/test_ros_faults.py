"""Faults where drivers are rclpy's, and a network namespace lies between the robots and the lab."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from tests.real.ros_lab import ros_environment

pytestmark = pytest.mark.slow

CHOSEN = {"kill-controller-run", "stop-supervisor-by-hand", "kill-leader-by-hand", "cut-1s-relay"}
BY_RIGHTS = {"cut-1s-netns"}
"""Takes the right to make network namespaces, which not every root has."""


def test_a_driver_in_ros_is_told_to_stand_whoever_is_gone(peers: Path, tmp_path: Path) -> None:
    words = [word for name in sorted(CHOSEN | BY_RIGHTS) for word in ("--only", name)]
    done = subprocess.run(
        [str(peers), "-m", "hil", "faults", "--ros", *words, "--json", "--out", str(tmp_path)],
        capture_output=True,
        text=True,
        env=ros_environment(),
        timeout=900.0,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["ros"] is True
    tried = {case["fault"] for case in result["cases"]}
    assert tried | ({each["fault"] for each in result["skipped"]} & BY_RIGHTS) == CHOSEN | BY_RIGHTS
    # A robot that did not drive would be told nothing for long as well.
    assert all(0.0 < case["oldest_command_s"] < 0.3 for case in result["cases"])
    assert "rclpy" in (tmp_path / "reliability.md").read_text(encoding="utf-8")
