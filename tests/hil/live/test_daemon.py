"""The daemons one by one, as a lab starts them on its machines."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from hil.live.daemon import Ending, aftermath, run_daemon
from hil.log.events import recorded_commands, recorded_estimates
from hil.log.metadata import scenario_of
from hil.log.reader import Log, read_log
from hil.nodes.node import Outgoing, outgoing
from hil.replay.rerun import replay
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.events import Event, digest
from hil.wire.message_types import String
from hil.wire.pubsub import Inbox, Wire
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint
from hil.wire.topics import topics_of
from tests.hil.live.child_run import PATIENCE


def daemon(name: str, folder: Path, *options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "hil", name, "turtlebot3", *options],
        cwd=folder,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_until_ready(name: str, process: subprocess.Popen[str], endpoint: str) -> None:
    assert process.stderr is not None
    assert process.stderr.readline().startswith(f"abreast {name}: ready, turtlebot3 on {endpoint}")


@pytest.fixture
def endpoint() -> Iterator[str]:
    with reserved_endpoint() as reserved:
        yield reserved


@pytest.mark.slow
@pytest.mark.parametrize("drivers", [("follower",), ("controller", "estimator")], ids="-".join)
def test_daemons_started_by_hand_find_each_other_and_end_when_told(
    tmp_path: Path, endpoint: str, drivers: tuple[str, ...]
) -> None:
    daemons = {"recorder": daemon("recorder", tmp_path, "--listen", endpoint, "--out", "lab.mcap")}
    for name in drivers:
        daemons[name] = daemon(name, tmp_path, "--connect", endpoint)
    try:
        for name, process in daemons.items():
            wait_until_ready(name, process, endpoint)
        daemons["emulator"] = daemon("emulator", tmp_path, "--connect", endpoint, "--duration", "4")
        wait_until_ready("emulator", daemons["emulator"], endpoint)
        assert daemons["emulator"].wait(PATIENCE) == 0
        for name, number in zip(drivers, (signal.SIGTERM, signal.SIGINT), strict=False):
            daemons[name].send_signal(number)
        for name in drivers:
            assert daemons[name].wait(PATIENCE) == 0
        daemons["recorder"].terminate()
        assert daemons["recorder"].wait(PATIENCE) == 0
    finally:
        for process in daemons.values():
            process.kill()
            process.communicate()
    log = read_log(tmp_path / "lab.mcap")
    scenario = scenario_of(log)
    assert scenario is not None
    again = replay(log, scenario)
    assert min(again.parity[name].compared for name in ("estimates", "commands")) > 100
    assert again.mismatched == 0 or again.missing_inputs or lost_something(log, scenario)


def lost_something(log: Log, scenario: Scenario) -> bool:
    """Whether something is on no receipt. On a machine that freezes Zenoh may drop what it was taken with."""
    names = topics_of(scenario)
    recorded_outputs = {
        topics.RIGID_BODIES: recorded_estimates(log, names.estimate),
        names.estimate: recorded_commands(log, names.command),
    }
    for topic, outputs in recorded_outputs.items():
        taken = {name for output in outputs for name, _ in output.consumed}
        arrived = [digest(topic, record.payload) for record in log.records([topic])]
        last = max(place for place, name in enumerate(arrived) if name in taken)
        if not taken.issuperset(arrived[:last]):
            return True
    return False


class Breaking:
    """A worker whose first step breaks down."""

    subscribes: tuple[str, ...] = ()
    thorough = False

    def begin(self, now_ns: int) -> None:
        pass

    def due_ns(self) -> int:
        return 0

    def take(self, event: Event, now_ns: int) -> tuple[Outgoing, ...]:
        raise ZeroDivisionError("in a step")

    def end(self, now_ns: int) -> tuple[Outgoing, ...]:
        return (outgoing(topics.STOP, String(data="the controller ended"), now_ns),)


def test_who_breaks_down_says_stop_before_it_ends() -> None:
    with reserved_endpoint() as endpoint:
        router = open_session(Endpoints(listen=endpoint))
        ear = Wire(router)
        ear.subscribe([topics.STOP])
        try:
            with pytest.raises(ZeroDivisionError):
                run_daemon(Breaking, load_scenario("turtlebot3"), Endpoints(connect=endpoint), Ending())
            heard = ear.inbox.take(PATIENCE)
        finally:
            ear.close()
            close_session(router)
    assert heard is not None
    assert heard.topic == topics.STOP


@pytest.mark.parametrize("name", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_every_signal_that_ends_a_program_asks_for_the_end_and_no_longer(name: signal.Signals) -> None:
    # Under nohup, SIGHUP is ignored from the start.
    inherited = signal.signal(name, signal.SIG_DFL)
    ending = Ending()
    try:
        ending.on_signals()
        signal.raise_signal(name)
    finally:
        ending.leave_signals()
        left = signal.signal(name, inherited)
    assert ending.asked
    assert left == signal.SIG_DFL


def test_who_is_to_outlive_its_terminal_does() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    ending = Ending()
    try:
        ending.on_signals()
        signal.raise_signal(signal.SIGHUP)
    finally:
        ending.leave_signals()
        signal.signal(signal.SIGHUP, before)
    assert not ending.asked


class Diary:
    """Keeps what it takes and, where it ``goes_on``, finds something new each time."""

    subscribes: tuple[str, ...] = ("a",)

    def __init__(self, thorough: bool, goes_on: bool = False) -> None:
        self.thorough, self.goes_on = thorough, goes_on
        self.inbox, self.taken = Inbox(), 0
        for number in range(100):
            self.inbox.put(Event("a", bytes([number])))

    def begin(self, now_ns: int) -> None:
        pass

    def due_ns(self) -> int:
        return 0

    def take(self, event: Event, now_ns: int) -> tuple[Outgoing, ...]:
        self.taken += 1
        if self.goes_on:
            self.inbox.put(event)
        return ()

    def end(self, now_ns: int) -> tuple[Outgoing, ...]:
        return ()


@pytest.mark.parametrize(("thorough", "taken"), [(True, 100), (False, 0)])
def test_who_is_thorough_takes_what_has_arrived_before_it_ends(thorough: bool, taken: int) -> None:
    diary = Diary(thorough)
    list(aftermath(diary.inbox, diary))
    assert diary.taken == taken


def test_whoever_goes_on_sending_does_not_keep_a_worker_from_its_end() -> None:
    diary = Diary(thorough=True, goes_on=True)
    assert all(said == () for said in aftermath(diary.inbox, diary))
