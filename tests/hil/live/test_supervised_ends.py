"""How a supervisor's run ends by what is on a wire that exists; it is alone there, without its daemons."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

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


STOP = topics.STOP, msg.String(data="enough")


def test_a_stop_before_the_leader_sets_off_ends_the_run(lab: tuple[Wire, _Supervisor]) -> None:
    wire, supervisor = lab
    outcome = outcome_of(supervisor, wire, STOP)
    assert outcome.failure == "stopped before the leader set off: enough"
    assert (outcome.interrupted, outcome.duration_s) == (False, 0.0)


def test_a_stop_that_cannot_be_read_does_too(lab: tuple[Wire, _Supervisor]) -> None:
    wire, supervisor = lab
    outcome = outcome_of(supervisor, wire, (topics.STOP, msg.Vector3(x=0.0, y=0.0, z=0.0)))
    assert outcome.failure.startswith("stopped before the leader set off: ")


def test_a_stop_after_that_is_no_failure(lab: tuple[Wire, _Supervisor]) -> None:
    wire, supervisor = lab
    now_ns = time.time_ns()
    set_off = diagnostics("leader", now_ns, "", {"motion_since_ns": now_ns})
    outcome = outcome_of(supervisor, wire, (topics.DIAGNOSTICS, set_off), STOP)
    assert outcome.failure == ""
