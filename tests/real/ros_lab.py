"""A lab of real parts on this machine: robots and motion capture in rclpy, a bridge, each in a process.

They run in the Python of the peers (`scripts/setup peers`), on loopback, in a ROS domain of their own.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent


def peers_python() -> Path | None:
    """Python with the peers, of the venv ABREAST_PEERS or of .venv-peers in the checkout; None if none is."""
    folder = Path(os.environ.get("ABREAST_PEERS", ROOT / ".venv-peers"))
    python = folder / "bin" / "python"
    return python if python.exists() else None


def ros_environment() -> dict[str, str]:
    """Environment of a process with ROS on loopback, our packages, and stand-ins for what has no wheel."""
    return {
        **os.environ,
        "PYTHONPATH": f"{ROOT}{os.pathsep}{HERE / 'stand_ins'}",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "PYTHONUNBUFFERED": "1",
    }


def free_port() -> int:
    """A UDP port that is free just now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@dataclass(slots=True)
class Peer:
    """A process and what it has said, line by line, on either of its outputs."""

    name: str
    process: subprocess.Popen[str]
    lines: list[str] = field(default_factory=list)

    def read(self) -> None:
        """Take down what it says until it ends."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line.rstrip())

    def wait_for(self, words: str, patience: float = 60.0) -> str:
        """The first line that has these words in it."""
        until = time.monotonic() + patience
        while time.monotonic() < until:
            for line in list(self.lines):
                if words in line:
                    return line
            if self.process.poll() is not None and not any(words in line for line in self.lines):
                break
            time.sleep(0.02)
        raise AssertionError(f"{self.name} did not say {words!r}: {self.lines[-20:]}")

    def say(self, line: str) -> None:
        """Write a line to its standard input."""
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def finish(self, patience: float = 20.0) -> list[str]:
        """End its standard input, and the process if that does not; all that it said."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            self.process.wait(patience)
        except subprocess.TimeoutExpired:
            self.process.terminate()
            self.process.wait(patience)
        return self.lines


@contextmanager
def peer(name: str, arguments: Sequence[str], python: Path | str = sys.executable) -> Iterator[Peer]:
    """A process in that Python for as long as the block lasts."""
    process = subprocess.Popen(
        [str(python), *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=ros_environment(),
    )
    begun = Peer(name, process)
    reader = threading.Thread(target=begun.read, daemon=True)
    reader.start()
    try:
        yield begun
    finally:
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        reader.join(5)
        for stream in (process.stdin, process.stdout):
            if stream is not None and not stream.closed:
                stream.close()


LEADER_POSE, FOLLOWER_POSE = (0.287, 0.005, 1.553), (0.767, 0.685, -1.574)
HAND = {"v": 0.08, "u_mean": 0.2, "u_amplitude": 0.5, "omega": 1.5707963267948966}
"""What the leader of the scenario turtlebot3 drives, as a hand that drives it outside of us."""


@dataclass(frozen=True, slots=True)
class Lab:
    """What stands in the lab. ``namespaces``, ``bodies``: of leader and follower. ``mocap``: its type.

    ``hand``: the leader drives by itself. ``table``: where the robots' own poses are left, if anywhere.
    """

    domain: int
    namespaces: tuple[str, str] = ("leader", "follower")
    bodies: tuple[str, str] = ("1", "2")
    command_types: tuple[str, str] = ("TwistStamped", "TwistStamped")
    listens: tuple[bool, bool] = (True, True)
    mocap: str = "RigidBodies"
    topic: str = "rigid_bodies"
    hand: bool = False
    duration_s: float = 120.0
    table: str = ""

    def robots(self, poses_to: int) -> str:
        """Configuration of the robots."""
        poses = (LEADER_POSE, FOLLOWER_POSE)
        told = [
            {"namespace": namespace, "pose": pose, "type": kind, "listens": listens, "hand": hand}
            for namespace, pose, kind, listens, hand in zip(
                self.namespaces,
                poses,
                self.command_types,
                self.listens,
                (HAND if self.hand else None, None),
                strict=True,
            )
        ]
        more = {"table": self.table} if self.table else {}
        return self._told(robots=told, poses_to=poses_to, **more)

    def capture(self, poses_at: int) -> str:
        """Configuration of the motion capture."""
        return self._told(
            poses_at=poses_at,
            bodies=self.bodies,
            type=self.mocap,
            topic=self.topic,
            sigma_position=0.0003,
            sigma_heading=0.0035,
            latency_s=0.03,
        )

    def settings(self) -> list[str]:
        """What a scenario has to be set to for this lab, as options of a command."""
        (leader, follower), (first, second) = self.namespaces, self.bodies
        told = [
            f"leader.namespace={leader}",
            f"follower.namespace={follower}",
            f"leader.body={json.dumps(first)}",
            f"follower.body={json.dumps(second)}",
            f"controller.command_type={self.command_types[1]}",
            f"wire.domain={self.domain}",
        ]
        if self.mocap != "RigidBodies":
            told += [f"source.type={self.mocap}", f"source.topic={self.topic}"]
        return [word for setting in told for word in ("--set", setting)]

    def _told(self, **more: Any) -> str:
        return json.dumps({"domain": self.domain, "duration_s": self.duration_s, **more})


@contextmanager
def standing(lab: Lab, python: Path) -> Iterator[tuple[Peer, Peer]]:
    """Robots and motion capture of the lab, up and running."""
    port = free_port()
    with (
        peer("mocap", [str(HERE / "rclpy_mocap.py"), lab.capture(port)], python) as mocap,
        peer("robots", [str(HERE / "rclpy_robots.py"), lab.robots(port)], python) as robots,
    ):
        mocap.wait_for("ready")
        robots.wait_for("ready")
        yield robots, mocap


@contextmanager
def bridge(lab: Lab, endpoint: str, python: Path, scenario: str = "turtlebot3") -> Iterator[Peer]:
    """Our bridge to ROS 2, connected to a router at the endpoint."""
    command = ["-m", "hil", "bridge", "ros2", scenario, "--connect", endpoint, *lab.settings()]
    with peer("bridge", command, python) as begun:
        begun.wait_for("ready")
        yield begun
