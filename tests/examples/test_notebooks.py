"""The notebooks of ``examples``: they run as they are, are kept without outputs, and say what they should."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

import abreast
from hil.wire.message_types import RigidBodies

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))
SHORTEST = "leader_from_poses"


def named(path: Path) -> str:
    return path.stem


def code_of(path: Path) -> list[Any]:
    notebook: Any = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=named)
def test_a_notebook_is_kept_without_its_outputs(path: Path) -> None:
    assert all(not cell.outputs and cell.execution_count is None for cell in code_of(path))


def test_from_poses_to_a_picture_takes_less_than_twenty_lines() -> None:
    lines = [line for cell in code_of(EXAMPLES / f"{SHORTEST}.ipynb") for line in cell.source.splitlines()]
    assert 0 < sum(bool(line.strip()) for line in lines) < 20


@pytest.mark.parametrize("path", NOTEBOOKS, ids=named)
def test_a_notebook_runs_and_draws(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    notebook: Any = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]
    NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(EXAMPLES)}}
    ).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert not [output for output in outputs if output.get("name") == "stderr"]
    assert any("image/png" in output.get("data", {}) for output in outputs)


def test_the_table_of_poses_is_what_the_emulator_gives(tmp_path: Path) -> None:
    """Where the follower drives hangs on its estimates, so what these are made of is told."""
    changed: dict[str, str | float] = {"run.duration_s": 12.0, "mocap.rate_hz": 60.0, "mocap.loss": 0.05}
    changed |= {f"estimator.{name}": "given" for name in ("noise", "process_noise")}
    changed |= {"estimator.own_motion": "odometry"}
    abreast.run_lockstep(abreast.load_scenario("turtlebot3", changed), log=tmp_path / "run.mcap")
    log = abreast.read_log(tmp_path / "run.mcap")
    rows: list[list[float]] = []
    for record in log.records(["rigid_bodies"]):
        frame = log.decode(record)
        assert isinstance(frame, RigidBodies)
        leader, follower = (body.pose for body in frame.rigidbodies)
        heading = 2.0 * math.atan2(follower.orientation.z, follower.orientation.w)
        places = [leader.position.x, leader.position.y, follower.position.x, follower.position.y, heading]
        rows.append([frame.header.stamp.sec + frame.header.stamp.nanosec * 1e-9, *places])
    seen = np.array(rows)
    seen[:, 0] -= math.floor(seen[0, 0])
    table = EXAMPLES / "poses.csv"
    assert table.stat().st_size < 100_000
    assert np.allclose(np.loadtxt(table, delimiter=",", skiprows=1), seen, rtol=0.0, atol=1e-5)
