from __future__ import annotations

from benchmarks.fuzz import fuzz


def test_no_input_makes_a_node_raise_or_a_robot_drive_beyond_its_limits() -> None:
    counts = fuzz(5_000, seed=3)
    assert min(counts[name] for name in ("estimator", "controller", "emulator", "leader", "lab_state")) > 100
    assert counts["drives"] > 100
