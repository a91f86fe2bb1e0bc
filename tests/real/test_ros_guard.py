"""The guard on a robot that is rclpy and nothing of ours, reached without a bridge."""

from __future__ import annotations

import csv
import signal
import sys
import time
from pathlib import Path

import pytest

from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import decode_as
from hil.wire.pubsub import Wire
from tests.hil.guard.guarded_lab import COMMANDER
from tests.real.ros_lab import HERE, Lab, Peer, free_port, peer
from tests.routers import router

pytestmark = pytest.mark.slow

PATIENCE, DRIVEN_S, LEFT_S = 90.0, 1.5, 2.0
V = 0.1
SOON_S = 0.3
STANDS_S = SOON_S + 0.5
"""By then a robot with a lag of 0.1 s that was told to stand in time does so to within a hundredth."""


def wait_until_driven(wire: Wire, guard: Peer) -> None:
    """Until the guard says that it lets the robot be driven."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until and guard.process.poll() is None:
        event = wire.inbox.take(0.5)
        if event is None or not event.topic:
            continue
        for status in decode_as(event.payload, msg.DiagnosticArray).status:
            values = {each.key: each.value for each in status.values}
            if status.name == "abreast/guard/leader" and float(values["v"]) == V:
                return
    raise AssertionError(guard.lines)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
@pytest.mark.parametrize(("domain", "kind"), [(111, "TwistStamped"), (112, "Twist")])
def test_a_robot_in_ros_stands_soon_after_its_commander_is_gone(
    peers: Path, tmp_path: Path, domain: int, kind: str, number: signal.Signals
) -> None:
    lab = Lab(
        domain=domain, command_types=(kind, kind), duration_s=PATIENCE, table=str(tmp_path / "poses.csv")
    )
    table = tmp_path / "poses.csv"
    with router() as (endpoint, wire):
        wire.subscribe([topics.DIAGNOSTICS])
        options = ["--robot", "leader", "--ros", "--connect", endpoint, *lab.settings()]
        with (
            peer("robots", [str(HERE / "rclpy_robots.py"), lab.robots(free_port())], peers) as robots,
            peer("guard", ["-m", "hil", "guard", "turtlebot3", *options], peers) as guard,
        ):
            robots.wait_for("ready")
            guard.wait_for("ready")
            with peer(
                "commander", [str(COMMANDER), endpoint, str(V), "0.5", "leader"], sys.executable
            ) as commander:
                wait_until_driven(wire, guard)
                time.sleep(DRIVEN_S)
                commander.process.send_signal(number)
                gone_s = time.time()
                time.sleep(LEFT_S)
                commander.process.send_signal(signal.SIGCONT)
                time.sleep(LEFT_S)
            robots.finish()
    with table.open(encoding="utf-8") as file:
        rows = [[float(cell) for cell in row] for row in csv.reader(file)]
    speeds = [(row[0] - gone_s, row[-2], row[-1]) for row in rows]
    driven = [v for at, v, _ in speeds if -0.5 < at < 0.0]
    left = [max(abs(v), abs(u)) for at, v, u in speeds if at > STANDS_S]
    assert min(driven) > 0.9 * V
    assert len(left) > 100
    assert max(left) < 0.01
