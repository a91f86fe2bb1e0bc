"""The path of docs/lab.md, walked as it is written: Motive, two robots in ROS 2, and every command of it."""

from __future__ import annotations

import json
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire.endpoints import DEFAULT_ENDPOINT
from hil.wire.messages import decode_as
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session
from tests.hil.live.own_poses import off_orbit
from tests.real.ros_lab import HERE, ROOT, Lab, Peer, free_port, peer, ros_environment

pytestmark = pytest.mark.slow

PATIENCE, OFF_M, DRIVEN_S, LOOKED_S = 400.0, 0.003, 35.0, 6.0
LEADER_MOUNT, FOLLOWER_MOUNT = (0.02, 0.0, 0.0), (0.012, 0.0, 0.05)
"""How the bodies sit on the robots, which nobody is told."""

NEEDED = {"scripts/setup", "pip", "export", "ros2", "local", "allow"}
"""What begins lines that are not ours: robots and clocks, which are others here."""


class Steps:
    """The commands of the path, each of which is to be taken once."""

    def __init__(self) -> None:
        text = (ROOT / "docs" / "lab.md").read_text(encoding="utf-8")
        section = text.split("\n## From unpacked robots")[1].split("\n### When it does not")[0]
        blocks = re.findall(r"```(\w*)\n(.*?)```", section, re.DOTALL)
        (self.scenario,) = (block for kind, block in blocks if kind == "toml")
        lines = [line for kind, block in blocks if not kind for line in block.splitlines()]
        self.left = [line.split("  #")[0].strip() for line in lines if line.split()[0] not in NEEDED]

    def take(self, begin: str) -> list[str]:
        """Arguments to Python of the next command that begins so; Motive is on this machine."""
        line = next(each for each in self.left if each.startswith(f"abreast {begin}"))
        self.left.remove(line)
        return ["-m", "hil", *shlex.split(line.replace("192.0.2.20", "127.0.0.1"))[1:]]


def done(command: list[str], code: int = 0) -> subprocess.CompletedProcess[str]:
    """A command that has ended with this code."""
    ended = subprocess.run(
        [sys.executable, *command],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        env=ros_environment(),
        check=False,
    )
    assert ended.returncode == code, ended.stdout + ended.stderr
    return ended


@contextmanager
def placed(lab: Lab, poses_to: int, peers: Path) -> Iterator[Peer]:
    """Both robots, put where a run begins, switched on, and in the graph."""
    with peer("robots", [str(HERE / "rclpy_robots.py"), lab.robots(poses_to)], peers) as robots:
        robots.wait_for("met")
        yield robots


@contextmanager
def motive(poses_at: int) -> Iterator[Peer]:
    given = {
        "poses_at": poses_at,
        "data_port": free_port(),  # others here may listen at Motive's own
        "duration_s": 4.0 * PATIENCE,
        "bodies": ["leader", "follower"],
        "mounts": [LEADER_MOUNT, FOLLOWER_MOUNT],
        "sigma_position": 0.0003,
        "sigma_heading": 0.0035,
    }
    with peer("motive", [str(HERE / "motive.py"), json.dumps(given)]) as begun:
        begun.wait_for("ready")
        yield begun


def put_in(scenario: Path, told: str) -> None:
    """Put the lines that a calibration prints into a scenario, each below its section."""
    text = scenario.read_text(encoding="utf-8")
    for section, lines in re.findall(r"^\[(\w+)\]\n((?:\w+ = .*\n?)+)", told, re.MULTILINE):
        head = f"[{section}]\n"
        text = text.replace(head, head + lines) if head in text else f"{text}\n{head}{lines}"
    scenario.write_text(text, encoding="utf-8")


def wait_until_driven(topic: str, run: Peer) -> None:
    """Until a robot is told to drive ahead."""
    session = open_session(Endpoints(connect=DEFAULT_ENDPOINT))
    wire, until = Wire(session), time.monotonic() + PATIENCE
    try:
        wire.subscribe([topic])
        while time.monotonic() < until and run.process.poll() is None:
            event = wire.inbox.take(0.5)
            if event is not None and decode_as(event.payload, msg.Twist).linear.x > 0.02:
                return
    finally:
        wire.close()
        close_session(session)
    raise AssertionError(f"nobody drives by {topic}: {run.lines}")


def test_the_path_leads_to_a_formation(peers: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    path, scenario, port = Steps(), tmp_path / "my_lab.toml", free_port()
    scenario.write_text(path.scenario, encoding="utf-8")
    lab = Lab(
        domain=30,
        namespaces=("tb3_0", "tb3_1"),
        command_types=("Twist", "Twist"),
        duration_s=PATIENCE,
        table=str(tmp_path / "poses.csv"),
    )
    with (
        motive(port),
        peer("bridge natnet", path.take("bridge natnet")) as cameras,
        peer("bridge ros2", path.take("bridge ros2"), peers) as wheels,
        ExitStack() as held,
    ):
        cameras.wait_for("ready")
        wheels.wait_for("ready")
        for guard in (held.enter_context(peer("guard", path.take("guard"))) for _ in range(2)):
            guard.wait_for("ready")
        with placed(lab, port, peers) as robots:
            done(path.take("doctor"))
            creeps = [path.take("doctor"), path.take("doctor")]
            for creep in creeps:
                refused = re.findall(r"^ *no +(\w+)", done(creep, 1).stdout, re.MULTILINE)
                assert set(refused) == {"frame_pivot"}
            told = {"domain": 30, "robots": lab.namespaces, "seconds": DRIVEN_S}
            recorder = path.take("recorder")
            with peer("hand", [str(HERE / "rclpy_teleop.py"), json.dumps(told)], peers):
                done(recorder)
            robots.finish()
        put_in(scenario, done(path.take("calibrate")).stdout)
        found = load_scenario(str(scenario))
        assert found.follower.mount == pytest.approx(FOLLOWER_MOUNT, abs=0.004)
        assert found.leader.mount == pytest.approx(LEADER_MOUNT, abs=0.004)
        with placed(lab, port, peers) as robots:
            for creep in creeps:
                done(creep)
            robots.finish()
        drive = path.take("run")
        with placed(lab, port, peers) as robots:
            done(drive)
            ended = json.loads(robots.finish()[-1])
        assert all(max(map(abs, each["speed"])) < 0.01 for each in ended.values())
        rho, _ = off_orbit(Path(lab.table), found, (15.0, 29.5))
        assert rho < OFF_M
        summary = json.loads(Path("first/summary.json").read_text(encoding="utf-8"))
        assert summary["formation"]["orbit_deviation_rms"]["rho"] < OFF_M
        # A machine that is busy with all of this may hold a command up.
        assert {each["name"] for each in summary["findings"]} <= {"command_gaps"}
        done(["-m", "hil", "replay", "first/run.mcap", "--verify"])
        with (
            placed(lab, port, peers) as robots,
            peer("run", [each if each != "first" else "second" for each in drive]) as run,
        ):
            wait_until_driven("tb3_1/cmd_vel", run)
            with peer("status", path.take("status")) as seen:
                time.sleep(LOOKED_S)
                seen.process.send_signal(signal.SIGINT)
                assert any("controller" in line for line in seen.finish())
            done(path.take("stop"))
            ended = json.loads(robots.finish()[-1])
            assert all(max(map(abs, each["speed"])) < 0.01 for each in ended.values())
    assert path.left == []
