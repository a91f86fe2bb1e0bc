"""A live run as a user has it: processes over Zenoh, ended by time, by Ctrl-C, by a kill, or by nonsense."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest

from formation.pose import Pose
from hil.emulator.lab_messages import frame_message
from hil.errors import UsageError
from hil.live.crew import APART, TOGETHER
from hil.log.reader import read_log
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import decode_as, encode, header, to_ns
from hil.wire.session import reserved_endpoint
from tests.hil.live.child_run import PATIENCE, Run

COMMAND, CMD_VEL = "follower/command", "follower/cmd_vel"
STILL_V = 0.025

MOMENTS = 5.0
"""What a log is behind when its writer is killed, on a machine that may have kept it waiting [s]."""


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Run]]:
    runs: list[Run] = []
    ports = ExitStack()

    def begin(*options: str, duration: float = 4.0, scenario: str = "turtlebot3") -> Run:
        folder, endpoint = tmp_path / f"run{len(runs)}", ports.enter_context(reserved_endpoint())
        where = ["--out", str(folder), "--listen", endpoint, "--duration", str(duration)]
        process = subprocess.Popen(
            [sys.executable, "-m", "hil", "run", scenario, *where, "--json", *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        runs.append(Run(folder, endpoint, process, len(APART if "--apart" in options else TOGETHER)))
        return runs[-1]

    with ports:
        yield begin
    for run in runs:
        if run.process.poll() is None:
            run.process.kill()
            run.process.communicate()
        for pid in run.daemons().values():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)


def last_truth(log: Path, topic: str = topics.TRUTH) -> msg.Truth:
    return decode_as(list(read_log(log).records(topics=[topic]))[-1].payload, msg.Truth)


def commands(log: Path, topic: str = COMMAND) -> list[tuple[float, msg.Command]]:
    """Commands with when they were given [s]."""
    decoded = [decode_as(record.payload, msg.Command) for record in read_log(log).records([topic])]
    return [(to_ns(each.header.stamp) * 1e-9, each) for each in decoded]


def few_frames_lost(summary: dict[str, Any]) -> bool:
    """A machine that freezes for a moment may cost frames: Zenoh drops what a subscriber cannot take."""
    frames = summary["frames"]
    return bool(0 <= frames["lost"] < 0.2 * frames["published"])


@pytest.mark.parametrize("options", [[], ["--apart"]], ids=["together", "apart"])
def test_a_run_estimates_drives_stops_and_leaves_nothing_behind(
    start: Callable[..., Run], options: list[str]
) -> None:
    run = start(*options, "--certify", "--set", "run.evaluate_from_s=2.0")
    code, summary, err = run.finish()
    assert code == 0, err
    assert run.daemons() == {}
    assert summary["mode"] == "live"
    assert few_frames_lost(summary)
    assert summary["commands"]["sent"] > 100
    assert summary["estimation"]["samples"] > 50
    assert summary["bounds"]["violations"]["v1_extended"] == 0
    assert summary["certified"]["certified"] > 50
    assert read_log(run.log).topics["follower/certified"] == "abreast_msgs/msg/CertifiedEstimate"
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
    assert max(abs(truth[-1].v1), abs(truth[-1].v2)) < STILL_V


@pytest.mark.slow
def test_a_killed_estimator_fails_the_run_and_stops_every_follower(start: Callable[..., Run]) -> None:
    followers = ("follower", "agent3")
    run = start("--apart", "--set", "chain.agents=3", duration=600.0, scenario="chain5-turtlebot3")
    run.wait_until_driving(*(f"{name}/truth" for name in followers))
    daemons = run.daemons()
    assert sorted(daemons) == ["controller", "emulator", "estimator", "recorder"]
    os.kill(daemons["estimator"], signal.SIGKILL)
    killed_at = time.time()
    code, summary, err = run.finish()
    assert code == 1
    assert "the estimator was killed by signal 9" in err
    assert run.daemons() == {}
    assert [pair["follower"] for pair in summary["pairs"]] == list(followers)
    for name in followers:
        sent_commands = commands(run.log, f"{name}/command")
        assert any(sent.v2 > 0.02 for at, sent in sent_commands if at < killed_at)
        late = [sent for at, sent in sent_commands if at > killed_at + 0.3]
        assert all(sent.v2 == sent.u2 == 0.0 and sent.stop for sent in [*late, sent_commands[-1][1]])
        assert sent_commands[-1][0] > killed_at
        moving = last_truth(run.log, f"{name}/truth")
        assert max(abs(moving.v1), abs(moving.v2)) < STILL_V


@pytest.mark.slow
@pytest.mark.parametrize(("killed", "options"), [("follower", []), ("controller", ["--apart"])])
def test_without_a_controller_somebody_else_stops_the_robot(
    start: Callable[..., Run], killed: str, options: list[str]
) -> None:
    run = start(*options, duration=600.0)
    run.wait_until_driving(topics.TRUTH)
    os.kill(run.daemons()[killed], signal.SIGKILL)
    code, _, err = run.finish()
    assert code == 1
    assert f"the {killed} was killed by signal 9" in err
    last = list(read_log(run.log).records(topics=[CMD_VEL]))[-1]
    sent = decode_as(last.payload, msg.TwistStamped).twist
    assert sent.linear.x == sent.angular.z == 0.0
    moving = last_truth(run.log)
    assert max(abs(moving.v1), abs(moving.v2)) < STILL_V


def test_an_end_that_is_asked_for_while_starting_leaves_no_process(start: Callable[..., Run]) -> None:
    run = start(duration=600.0)
    run.wait_until(lambda: len(run.daemons()) == run.size)
    run.process.send_signal(signal.SIGTERM)
    _, _, err = run.finish()
    assert "interrupted" in err
    assert "Traceback" not in err
    assert run.daemons() == {}


@pytest.mark.slow
def test_a_killed_supervisor_takes_its_daemons_along(start: Callable[..., Run]) -> None:
    run = start(duration=600.0)
    run.wait_until_driving(topics.TRUTH)
    run.process.kill()
    run.process.communicate()
    deadline = time.monotonic() + PATIENCE
    while run.daemons() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert run.daemons() == {}


@pytest.mark.slow
def test_a_killed_recorder_leaves_a_log_that_is_made_whole(start: Callable[..., Run]) -> None:
    run = start(duration=600.0)
    run.wait_until_driving(topics.TRUTH)
    os.kill(run.daemons()["recorder"], signal.SIGKILL)
    killed_at = time.time()
    code, _, err = run.finish()
    assert code == 1
    assert "the recorder was killed by signal 9" in err
    with pytest.raises(UsageError, match="abreast recover"):
        read_log(run.log.with_suffix(".cut.mcap"))
    logged = [record.log_ns * 1e-9 for record in read_log(run.log).records(topics=[topics.TRUTH])]
    assert killed_at - MOMENTS < max(logged) < killed_at + 0.1


@pytest.mark.slow
def test_a_folder_that_is_moved_away_during_a_run_is_told_at_once(
    start: Callable[..., Run], tmp_path: Path
) -> None:
    run = start(duration=600.0)
    run.wait_until_driving(topics.TRUTH)
    folder, elsewhere = run.log.parent, tmp_path / "elsewhere"
    folder.rename(elsewhere)
    run.wait_until_found("recorder", "disk")
    run.process.send_signal(signal.SIGINT)
    code, _, err = run.finish()
    assert code == 1
    assert f"log {run.log} is not there any more" in err.splitlines()[-1]
    assert "Traceback" not in err
    assert read_log(elsewhere / run.log.name).messages > 100


def last_refused(log: Path, node: str) -> dict[str, int]:
    """What a node said last of what it had refused, by cause."""
    said: dict[str, int] = {}
    for record in read_log(log).records(topics=[topics.DIAGNOSTICS]):
        for status in decode_as(record.payload, msg.DiagnosticArray).status:
            if status.name == f"abreast/{node}":
                values = {each.key: each.value for each in status.values}
                told = {key: value for key, value in values.items() if key.startswith("refused.")}
                said = {key.removeprefix("refused."): int(value) for key, value in told.items()}
    return said


@pytest.mark.slow
def test_nonsense_moves_nobody_and_an_interrupt_leaves_a_whole_log(start: Callable[..., Run]) -> None:
    each, rounds = 100, 5
    run = start(duration=600.0)
    run.wait_until_driving(topics.TRUTH)
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
    with run.listening() as wire:
        for _ in range(rounds):
            for payload in nonsense.values():
                for _ in range(each):
                    wire.publish(topics.RIGID_BODIES, payload)
            # Less than a flood.
            time.sleep(0.7)
    run.process.send_signal(signal.SIGINT)
    code, summary, err = run.finish()
    assert code == 130, err
    assert "interrupted" in err
    assert run.daemons() == {}
    assert summary["duration_s"] < 600.0
    assert "second_sender" in {found["name"] for found in summary["findings"]}
    # It came from somebody who is not listened to beside the motion capture.
    assert not nonsense.keys() & summary.get("rejected", {}).keys()
    assert last_refused(run.log, "follower_senders") == {topics.RIGID_BODIES: each * rounds * len(nonsense)}
    assert few_frames_lost(summary)
    assert summary["bounds"]["violations"]["v1_extended"] == 0
    for _, sent in commands(run.log):
        assert abs(sent.v2) <= 0.22
        assert abs(sent.u2) <= 2.84
    moving = last_truth(run.log)
    assert max(abs(moving.v1), abs(moving.v2)) < STILL_V
