"""How a supervisor's run ends by what is on a wire that exists; it is alone there, without its daemons."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from formation.pose import Motion, Pose
from hil.emulator.lab_messages import odometry_message
from hil.live import run
from hil.live.child_processes import Children
from hil.live.crew import Crew
from hil.live.daemon import Ending
from hil.live.run import Outcome, _Supervisor
from hil.live.run_monitor import Snapshot
from hil.nodes.node import diagnostics
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import encode
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints
from tests.routers import router

SCENARIO = load_scenario("turtlebot3", ["run.duration_s=0.5"])


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Wire, _Supervisor]]:
    """A mouth on the wire of a run with real robots, and the run's supervisor."""
    monkeypatch.setattr(Children, "start", lambda *_: None)
    with router() as (endpoint, wire):
        supervisor = _Supervisor(
            SCENARIO,
            tmp_path / "scenario.toml",
            tmp_path / "run.mcap",
            Endpoints(connect=endpoint),
            Crew(real=True),
        )
        yield wire, supervisor
        supervisor.close()


def outcome_of(supervisor: _Supervisor, wire: Wire, *said: tuple[str, msg.Message]) -> Outcome:
    """How it ends after somebody has said something, which it is given to hear."""
    looks = 0

    def show(_snapshot: Snapshot, _elapsed: float | None) -> None:
        nonlocal looks
        looks += 1
        assert looks < 600, "waits for ever"
        if looks == 1:
            for topic, message in said:
                wire.publish(topic, encode(message))

    return supervisor.run(Ending(), show)


@contextmanager
def robot(wire: Wire, name: str, v: float) -> Iterator[threading.Event]:
    """A robot that tells all the time how fast it is and heeds nobody, until its link is gone."""
    gone = threading.Event()

    def tell() -> None:
        while not gone.wait(0.02):
            odometry = odometry_message(5, name, Pose(0.0, 0.0, 0.0), Motion(v, 0.0))
            wire.publish(f"{name}/odom", encode(odometry))

    telling = threading.Thread(target=tell)
    telling.start()
    try:
        yield gone
    finally:
        gone.set()
        telling.join()


STOP = topics.STOP, msg.String(data="enough")


def test_a_stop_before_the_leader_sets_off_ends_the_run(lab: tuple[Wire, _Supervisor]) -> None:
    wire, supervisor = lab
    outcome = outcome_of(supervisor, wire, STOP)
    assert outcome.failure.startswith("stopped before the leader set off: enough (by session ")
    assert (outcome.interrupted, outcome.duration_s) == (False, 0.0)


def test_a_stop_that_cannot_be_read_does_too(lab: tuple[Wire, _Supervisor]) -> None:
    wire, supervisor = lab
    outcome = outcome_of(supervisor, wire, (topics.STOP, msg.Vector3(x=0.0, y=0.0, z=0.0)))
    assert outcome.failure.startswith("stopped before the leader set off: ")


def test_a_stop_after_that_ends_the_run_before_its_time(lab: tuple[Wire, _Supervisor]) -> None:
    wire, supervisor = lab
    outcome = outcome_of(supervisor, wire, set_off(), STOP)
    assert re.match(r"stopped after [0-9.]+ s: enough \(by session ", outcome.failure)
    assert outcome.stopped


def test_a_stop_is_heeded_where_our_keys_do_not_let_us_say_by_whom(
    lab: tuple[Wire, _Supervisor], monkeypatch: pytest.MonkeyPatch
) -> None:
    wire, supervisor = lab
    ours = supervisor._wire
    monkeypatch.setattr(ours, "_allowed", frozenset({topics.STOP}))
    wire.subscribe([topics.DIAGNOSTICS])
    outcome = outcome_of(supervisor, wire, set_off(), STOP)
    assert outcome.stopped
    assert not any(b"stopped_by" in event.payload for event in iter(lambda: wire.inbox.take(0.2), None))


def test_a_guard_that_holds_its_robot_ends_the_run(lab: tuple[Wire, _Supervisor]) -> None:
    wire, supervisor = lab
    values = {"latched": "fence", "latched_by": "follower"}
    held = diagnostics("guard/follower", time.time_ns(), "latched (fence): outside", values)
    outcome = outcome_of(supervisor, wire, set_off(), (topics.DIAGNOSTICS, held))
    assert outcome.failure == (
        "stopped before its time: guard/follower latched (fence): outside (by follower)"
    )
    assert not outcome.stopped


def set_off() -> tuple[str, msg.Message]:
    now_ns = time.time_ns()
    return topics.DIAGNOSTICS, diagnostics("leader", now_ns, "", {"motion_since_ns": now_ns})


def test_robots_that_say_that_they_stand_are_said_to(lab: tuple[Wire, _Supervisor]) -> None:
    wire, supervisor = lab
    with robot(wire, "leader", 0.0), robot(wire, "follower", 0.0):
        outcome = outcome_of(supervisor, wire, set_off())
    assert (outcome.failure, outcome.robots) == ("", "the robots stand")


def test_a_robot_that_drives_on_fails_the_run(
    lab: tuple[Wire, _Supervisor], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "STANDSTILL_TIMEOUT", 1.0)
    wire, supervisor = lab
    with robot(wire, "leader", 0.0), robot(wire, "follower", 0.1):
        outcome = outcome_of(supervisor, wire, set_off())
    assert outcome.failure == "follower has not been seen to stand within 1 s; use its switch"
    assert outcome.robots == "the robots were told to stand, leader seen to"


def test_what_robots_said_before_their_links_were_gone_is_no_standstill(
    lab: tuple[Wire, _Supervisor], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "STANDSTILL_TIMEOUT", 1.0)
    wire, supervisor = lab
    with robot(wire, "leader", 0.0) as leader_gone, robot(wire, "follower", 0.0) as follower_gone:
        time.sleep(0.2)
        leader_gone.set()
        follower_gone.set()
        time.sleep(0.2)
        outcome = outcome_of(supervisor, wire, STOP)
    assert outcome.failure.startswith("stopped before the leader set off: enough (by session ")
    assert outcome.failure.endswith(
        "; leader, follower have not been seen to stand within 1 s; use their switch"
    )
    assert not outcome.stopped
    assert outcome.robots == "the robots were told to stand"


def test_robots_that_tell_nothing_of_their_motion_are_not_said_to_stand(
    lab: tuple[Wire, _Supervisor],
) -> None:
    wire, supervisor = lab
    outcome = outcome_of(supervisor, wire, set_off())
    assert (outcome.failure, outcome.robots) == ("", "the robots were told to stand")
