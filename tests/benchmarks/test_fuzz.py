from __future__ import annotations

import pytest

from benchmarks.fuzz import fuzz

NODES = ("estimator", "controller", "emulator", "leader", "lab_state", "recorder", "run_monitor")


@pytest.mark.parametrize("guarded", [False, True])
def test_no_input_makes_anybody_raise_or_a_robot_drive_beyond_its_limits(guarded: bool) -> None:
    counts = fuzz(6_000, seed=3, guarded=guarded)
    assert min(counts[name] for name in (*NODES, "start_barrier", "estimates")) > 100
    assert counts["drives"] > 100
