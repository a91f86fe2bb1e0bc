"""A whole run with robots and a motion capture that are not ours: rclpy, in processes of their own."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from hil.scenario.files import load_scenario
from hil.wire.session import reserved_endpoint
from tests.hil.live.own_poses import off_orbit
from tests.real.ros_lab import ROOT, Lab, Peer, bridge, peer, standing

pytestmark = pytest.mark.slow

PATIENCE = 400.0
OFF_M = 0.003
JUDGED_S = (15.0, 29.5)
"""What is judged of a run of 30 s, as ``run.evaluate_from_s`` has it, up to just before the stop."""


@contextmanager
def real_run(lab: Lab, endpoint: str, folder: Path, *options: str) -> Iterator[Peer]:
    where = ["--listen", endpoint, "--out", str(folder)]
    command = ["-m", "hil", "run", "turtlebot3", "--real", *where, *lab.settings(), *options]
    with peer("run", command) as begun:
        begun.wait_for("robots and bridges connect to")
        yield begun


@contextmanager
def guards(lab: Lab, endpoint: str) -> Iterator[None]:
    """Those of the robots that abreast commands."""
    with ExitStack() as held:
        for robot in ("follower",) if lab.hand else ("leader", "follower"):
            options = ["--robot", robot, "--connect", endpoint, *lab.settings()]
            held.enter_context(peer("guard", ["-m", "hil", "guard", "turtlebot3", *options]))
        yield


def verified(log: Path) -> dict[str, Any]:
    """JSON of a replay that repeats a run, whose process must end well."""
    command = [sys.executable, "-m", "hil", "replay", str(log), "--verify", "--json"]
    done = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)}
    )
    assert done.returncode == 0, done.stderr
    summary: dict[str, Any] = json.loads(done.stdout)
    return summary


@pytest.mark.parametrize(
    "lab",
    [
        Lab(domain=101),
        Lab(domain=102, namespaces=("tb3_1", ""), command_types=("Twist", "Twist"), bodies=("burger a", "7")),
        Lab(domain=103, hand=True),
    ],
    ids=["namespaced, TwistStamped", "follower without namespace, Twist", "by hand"],
)
def test_a_real_pair_keeps_to_the_orbit_and_is_judged_and_repeated(
    lab: Lab, peers: Path, tmp_path: Path
) -> None:
    folder, table = tmp_path / "run", tmp_path / "poses.csv"
    lab = dataclasses.replace(lab, table=str(table), duration_s=PATIENCE)
    options = ["--leader", "hand"] if lab.hand else ["--countdown", "1"]
    with (
        reserved_endpoint() as endpoint,
        real_run(lab, endpoint, folder, *options) as run,
        standing(lab, peers) as (robots, _),
        bridge(lab, endpoint, peers),
        guards(lab, endpoint),
    ):
        if lab.hand:
            run.wait_for(f"drive {lab.bodies[0]!r} off by hand", PATIENCE)
            robots.say("go")
        run.process.wait(PATIENCE)
        assert run.process.returncode == 0, run.lines
        ended = json.loads(robots.finish()[-1])
    rho, _ = off_orbit(table, load_scenario("turtlebot3"), JUDGED_S)
    assert rho < OFF_M
    follower = ended[f"/{lab.namespaces[1]}"]
    assert max(map(abs, follower["speed"])) < 0.01
    if not lab.hand:
        assert max(map(abs, ended[f"/{lab.namespaces[0]}"]["speed"])) < 0.01
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert (summary["truth"], summary["mode"]) == ("mocap", "live")
    assert "seed" not in summary
    assert summary["formation"]["orbit_deviation_rms"]["rho"] < OFF_M
    assert summary["estimation"]["rmse"]["v1"] < 0.003
    again = verified(folder / "run.mcap")
    assert again["parity"]["estimates"]["compared"] > 1000
    assert sum(part["mismatched"] for part in again["parity"].values()) == 0
    assert again["truth"] == "mocap"
    assert again["formation"]["orbit_deviation_rms"] == summary["formation"]["orbit_deviation_rms"]
