"""A live run in a lab with names, topics and motion capture of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from hil.log.reader import read_log
from hil.wire.session import reserved_endpoint

LAB = [
    "leader.body=1",
    'leader.namespace=""',
    "follower.body=burger b",
    "follower.namespace=tb3_1",
    "wire.prefix=lab7",
    'wire.topics={"tb3_1/odom"="tb3_1/wheel/odom"}',
    "source.up=y",
    "source.scale=0.001",
]


@pytest.mark.slow
@pytest.mark.parametrize(
    "source", [["type=PoseStamped"], ["type=TransformStamped", "topic=vicon"], ["type=RigidBodies"]]
)
def test_a_lab_is_taken_as_it_is(tmp_path: Path, source: list[str]) -> None:
    """The emulator speaks as the lab does; what is estimated and logged is as if it spoke as we do."""
    given = [*LAB, *(f"source.{each}" for each in source), "run.evaluate_from_s=2.0"]
    options = [word for key in given for word in ("--set", key)]
    folder = tmp_path / "run"
    with reserved_endpoint() as endpoint:
        where = ["--out", str(folder), "--listen", endpoint, "--duration", "4"]
        command = [sys.executable, "-m", "hil", "run", "turtlebot3", *where, "--json", *options]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["estimation"]["samples"] > 100
    assert summary["estimation"]["rmse"]["v1"] < 0.005
    log = read_log(folder / "run.mcap")
    assert {"rigid_bodies", "odom", "tb3_1/odom", "tb3_1/cmd_vel"} <= set(log.topics)
    (first,) = list(log.records(["rigid_bodies"]))[:1]
    assert [body.rigid_body_name for body in log.decode(first).rigidbodies] == ["1", "burger b"]  # type: ignore[attr-defined]
    verified = [sys.executable, "-m", "hil", "replay", str(folder / "run.mcap"), "--verify", "--json"]
    assert subprocess.run(verified, capture_output=True, check=False).returncode == 0
