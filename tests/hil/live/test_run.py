"""A live run as a user has it: processes over Zenoh, ended by time, by Ctrl-C, by a kill, or by nonsense."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from formation.pose import Pose
from hil.emulator.lab_messages import frame_message
from hil.errors import UsageError
from hil.log.reader import read_log
from hil.log.recovery import recover
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import decode_as, encode, header
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, free_endpoint, open_session

ESTIMATE, COMMAND, CMD_VEL = "follower/leader_estimate", "follower/command", "follower/cmd_vel"


@dataclass
class Run:
    """An ``abreast run`` as a child process."""

    folder: Path
    endpoint: str
    process: subprocess.Popen[str]

    @property
    def log(self) -> Path:
        return self.folder / "run.mcap"

    def daemons(self) -> dict[str, int]:
        """Process ids of the run's daemons by name."""
        found = {}
        for entry in Path("/proc").iterdir():
            if not entry.name.isdecimal():
                continue
            try:
                words = (entry / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if str(self.folder / "scenario.toml").encode() in words:
                found[words[3].decode()] = int(entry.name)
        return found

    def wait_until(self, what: Callable[[], object], timeout: float = 30.0) -> None:
        deadline = time.monotonic() + timeout
        while not what():
            assert self.process.poll() is None, self.process.communicate()[1]
            assert time.monotonic() < deadline, "waited in vain"
            time.sleep(0.02)

    def logged_bytes(self) -> int:
        return self.log.stat().st_size if self.log.exists() else 0

    def finish(self, timeout: float = 40.0) -> tuple[int, dict[str, Any], str]:
        out, err = self.process.communicate(timeout=timeout)
        return self.process.returncode, json.loads(out) if out.strip() else {}, err


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Run]]:
    runs: list[Run] = []

    def begin(*options: str, duration: float = 4.0, scenario: str = "turtlebot3") -> Run:
        folder, endpoint = tmp_path / f"run{len(runs)}", free_endpoint()
        arguments = [
            "--out",
            str(folder),
            "--duration",
            str(duration),
            "--listen",
            endpoint,
            "--json",
            *options,
        ]
        process = subprocess.Popen(
            [sys.executable, "-m", "hil", "run", scenario, *arguments, *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        runs.append(Run(folder, endpoint, process))
        return runs[-1]

    yield begin
    for run in runs:
        if run.process.poll() is None:
            run.process.kill()
            run.process.communicate()
        for pid in run.daemons().values():
            os.kill(pid, signal.SIGKILL)


def driving(run: Run) -> Callable[[], bool]:
    """True once the log has more than the start: the robots drive by then."""
    return lambda: run.logged_bytes() > 150_000


def all_driving(run: Run, *followers: str) -> Callable[[], bool]:
    """True once what is logged so far has every one of the followers driving."""

    def check() -> bool:
        if not driving(run)():
            return False
        so_far = run.log.with_name("so_far.mcap")
        so_far.unlink(missing_ok=True)
        recover(run.log, so_far)
        log = read_log(so_far)
        return all(
            any(
                decode_as(record.payload, msg.Command).v2 > 0.02
                for record in log.records([f"{name}/command"])
            )
            for name in followers
        )

    return check


def stamps(log: Path, topic: str) -> list[float]:
    return [record.log_ns * 1e-9 for record in read_log(log).records(topics=[topic])]


def commands_after(log: Path, since: float) -> list[tuple[float, msg.Command]]:
    records = read_log(log).records(topics=[COMMAND], start_ns=round(since * 1e9))
    return [(record.log_ns * 1e-9 - since, decode_as(record.payload, msg.Command)) for record in records]


def test_a_run_estimates_drives_stops_and_leaves_nothing_behind(start: Callable[..., Run]) -> None:
    run = start("--set", "run.evaluate_from_s=2.0")
    code, summary, err = run.finish()
    assert code == 0, err
    assert run.daemons() == {}
    assert summary["mode"] == "live"
    assert summary["frames"]["lost"] == 0
    assert summary["commands"]["sent"] > 300
    assert summary["estimation"]["rmse"]["v1"] < 0.01
    assert summary["bounds"]["violations"]["v1_extended"] == 0
    assert summary["latency_ms"]["capture_to_command"]["p50"] > 30.0
    assert {path.name for path in run.folder.iterdir()} == {
        "run.mcap",
        "scenario.toml",
        "summary.json",
        "report.html",
        "run.png",
    }
    truth = [decode_as(r.payload, msg.Truth) for r in read_log(run.log).records(topics=[topics.TRUTH])]
    assert truth[0].v1 == truth[0].v2 == 0.0
    assert max(abs(truth[-1].v1), abs(truth[-1].v2)) < 0.02


def test_a_killed_estimator_stops_the_robots_and_fails_the_run(start: Callable[..., Run]) -> None:
    run = start(duration=30.0)
    run.wait_until(driving(run))
    killed_at = time.time()
    os.kill(run.daemons()["estimator"], signal.SIGKILL)
    code, _, err = run.finish()
    assert code == 1
    assert "the estimator was killed by signal 9" in err
    assert run.daemons() == {}
    late = [sent for after, sent in commands_after(run.log, killed_at) if after > 0.3]
    assert late
    assert all(sent.v2 == sent.u2 == 0.0 and sent.stop for sent in late)
    for record in read_log(run.log).records(topics=[topics.TRUTH], start_ns=round((killed_at + 0.3) * 1e9)):
        moving = decode_as(record.payload, msg.Truth)
        assert max(abs(moving.v1), abs(moving.v2)) < 0.025


def test_a_killed_estimator_stops_every_follower_of_a_chain(start: Callable[..., Run]) -> None:
    run = start("--set", "chain.agents=3", duration=30.0, scenario="chain5-turtlebot3")
    run.wait_until(all_driving(run, "follower", "agent3"))
    assert sorted(run.daemons()) == ["controller", "emulator", "estimator", "recorder"]
    killed_at = time.time()
    os.kill(run.daemons()["estimator"], signal.SIGKILL)
    code, summary, err = run.finish()
    assert code == 1
    assert "the estimator was killed by signal 9" in err
    assert run.daemons() == {}
    assert [pair["follower"] for pair in summary["pairs"]] == ["follower", "agent3"]
    for name in ("follower", "agent3"):
        before, late = commands_around(run.log, killed_at, f"{name}/command")
        assert any(sent.v2 > 0.02 for sent in before)
        assert late
        assert all(sent.v2 == sent.u2 == 0.0 and sent.stop for sent in late)
        last = list(read_log(run.log).records(topics=[f"{name}/truth"]))[-1]
        moving = decode_as(last.payload, msg.Truth)
        assert max(abs(moving.v1), abs(moving.v2)) < 0.025


def commands_around(log: Path, moment: float, topic: str) -> tuple[list[msg.Command], list[msg.Command]]:
    """Commands before a moment, and from 0.3 s after it on."""
    told = [
        (record.log_ns * 1e-9, decode_as(record.payload, msg.Command))
        for record in read_log(log).records([topic])
    ]
    return [sent for at, sent in told if at < moment], [sent for at, sent in told if at > moment + 0.3]


def test_without_a_controller_somebody_else_stops_the_robot(start: Callable[..., Run]) -> None:
    run = start(duration=30.0)
    run.wait_until(driving(run))
    os.kill(run.daemons()["controller"], signal.SIGKILL)
    code, _, err = run.finish()
    assert code == 1
    assert "the controller was killed by signal 9" in err
    last = list(read_log(run.log).records(topics=[CMD_VEL]))[-1]
    sent = decode_as(last.payload, msg.TwistStamped).twist
    assert sent.linear.x == sent.angular.z == 0.0


def test_an_interrupted_run_leaves_a_whole_log_and_standing_robots(start: Callable[..., Run]) -> None:
    run = start(duration=30.0)
    run.wait_until(driving(run))
    run.process.send_signal(signal.SIGINT)
    code, summary, err = run.finish()
    assert code == 0, err
    assert "interrupted" in err
    assert run.daemons() == {}
    assert summary["duration_s"] < 30.0
    last = list(read_log(run.log).records(topics=[topics.TRUTH]))[-1]
    moving = decode_as(last.payload, msg.Truth)
    assert max(abs(moving.v1), abs(moving.v2)) < 0.02


def test_an_end_that_is_asked_for_while_starting_leaves_no_process(start: Callable[..., Run]) -> None:
    run = start(duration=30.0)
    run.wait_until(lambda: len(run.daemons()) == 4)
    run.process.send_signal(signal.SIGTERM)
    _, _, err = run.finish()
    assert "interrupted" in err
    assert "Traceback" not in err
    assert run.daemons() == {}


def test_a_killed_supervisor_takes_its_daemons_along(start: Callable[..., Run]) -> None:
    run = start(duration=30.0)
    run.wait_until(driving(run))
    run.process.kill()
    run.process.communicate()
    deadline = time.monotonic() + 10.0
    while run.daemons() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert run.daemons() == {}


def test_a_killed_recorder_loses_at_most_half_a_second(start: Callable[..., Run]) -> None:
    run = start(duration=30.0)
    run.wait_until(driving(run))
    killed_at = time.time()
    os.kill(run.daemons()["recorder"], signal.SIGKILL)
    code, _, err = run.finish()
    assert code == 1
    assert "the recorder was killed by signal 9" in err
    with pytest.raises(UsageError, match="abreast recover"):
        read_log(run.log.with_suffix(".cut.mcap"))
    assert killed_at - 0.5 < max(stamps(run.log, topics.TRUTH)) < killed_at + 0.1


def test_nonsense_on_the_wire_is_counted_and_moves_nobody(start: Callable[..., Run]) -> None:
    many = 10_000
    run = start(duration=9.0)
    run.wait_until(driving(run))
    session = open_session(Endpoints(connect=run.endpoint))
    wire = Wire(session)
    now_ns = time.time_ns()

    def frame(leader: Pose, name: str = "leader", zero: bool = False) -> bytes:
        message = frame_message(
            now_ns, 0, [(name, leader), ("follower" if name == "leader" else "box", leader)]
        )
        if zero:
            nothing = msg.Quaternion(x=0.0, y=0.0, z=0.0, w=0.0)
            pose = msg.Pose(position=msg.Point(x=0.0, y=0.0, z=0.0), orientation=nothing)
            bodies = [msg.RigidBody(body.rigid_body_name, [], pose) for body in message.rigidbodies]
            message = msg.RigidBodies(header(now_ns, ""), 0, bodies)
        return encode(message)

    nonsense = {
        "malformed": b"\x07\x2a\x99",
        "not_finite": frame(Pose(float("nan"), 0.0, 0.0)),
        "bad_quaternion": frame(Pose(0.0, 0.0, 0.0), zero=True),
        "unknown_body": frame(Pose(0.0, 0.0, 0.0), name="cart"),
    }
    try:
        for _ in range(many // 50):
            for payload in nonsense.values():
                for _ in range(50):
                    wire.publish(topics.RIGID_BODIES, payload)
            time.sleep(0.02)
    finally:
        wire.close()
        close_session(session)
    code, summary, err = run.finish()
    assert code == 0, err
    assert {cause: summary["rejected"].get(cause) for cause in nonsense} == dict.fromkeys(nonsense, many)
    assert summary["frames"]["lost"] == 0
    assert summary["bounds"]["violations"]["v1_extended"] == 0
    assert summary["estimation"]["max"]["v1"] < 0.03
    for _, sent in commands_after(run.log, 0.0):
        assert abs(sent.v2) <= 0.22
        assert abs(sent.u2) <= 2.84
