"""A host whose clock is set back while robots drive: they stand, go on, and the log can be verified."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from hil.emulator.node import EmulatorNode
from hil.live.node_worker import NodeWorker
from hil.live.recorder import Recorder
from hil.lockstep.lockstep import EPOCH_NS
from hil.log.reader import read_log
from hil.nodes.controller import ControllerNode
from hil.nodes.estimator import EstimatorNode
from hil.nodes.node import Outgoing
from hil.replay.rerun import replay
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import TICK, Event
from hil.wire.messages import decode_as, encode, header, to_ns

S = 1_000_000_000
BACK_NS, HOUR_NS = 4 * S, 3600 * S
COMMAND, ODOM = "follower/command", "follower/odom"


class Lab:
    """Daemons on a host whose clock is an hour behind from :data:`BACK_NS` on, and a world that is not.

    ``mocap_too``: the motion capture runs on the same host, else it has a clock of its own. With ``silent``
    nothing comes from the robots once the clock was set back.
    """

    def __init__(self, scenario: Scenario, log: Path, *, mocap_too: bool, silent: bool) -> None:
        self.mocap_too, self.silent = mocap_too, silent
        self.world = EmulatorNode(scenario)
        self.state = self.world.begin(EPOCH_NS)
        self.true_ns = EPOCH_NS
        self.workers = [NodeWorker([EstimatorNode(scenario)]), NodeWorker([ControllerNode(scenario)])]
        self.recorder = Recorder(scenario, log)
        self.recorder.begin(EPOCH_NS)
        self.commands: list[tuple[float, msg.Command]] = []
        for worker in self.workers:
            worker.begin(EPOCH_NS)

    def run_until(self, end_s: float) -> None:
        """Let time pass, a millisecond at a time."""
        while self.true_ns < EPOCH_NS + round(end_s * S):
            self.true_ns += S // 1000
            self.state, out = self.world.step(self.state, TICK, self.true_ns)
            waiting = [message for message in out if not (self.silent and self.set_back)]
            for worker in self.workers:
                if worker.due_ns() <= self.now_ns or self.jumps:
                    waiting += worker.take(TICK, self.now_ns)
            for message in waiting:
                self._deliver(message, waiting)

    @property
    def set_back(self) -> bool:
        return self.true_ns >= EPOCH_NS + BACK_NS

    @property
    def jumps(self) -> bool:
        """Whether this is the first millisecond after."""
        return 0 <= self.true_ns - EPOCH_NS - BACK_NS < S // 1000

    @property
    def now_ns(self) -> int:
        return self.true_ns - HOUR_NS * self.set_back

    def _deliver(self, message: Outgoing, waiting: list[Outgoing]) -> None:
        event = Event(message.topic, self._stamped(message))
        self.recorder.take(event, self.now_ns)
        for worker in self.workers:
            if message.topic in worker.subscribes:
                waiting += worker.take(event, self.now_ns)
        if message.topic in self.world.subscribes:
            self.state, _ = self.world.step(self.state, event, self.true_ns)
        if message.topic == COMMAND:
            seconds = (self.true_ns - EPOCH_NS) / S
            self.commands.append((seconds, decode_as(message.payload, msg.Command)))

    def _stamped(self, message: Outgoing) -> bytes:
        """Payload with the stamp that the host's clock gives it."""
        received: msg.RigidBodies | msg.Odometry
        if message.topic == topics.RIGID_BODIES and self.mocap_too:
            received = decode_as(message.payload, msg.RigidBodies)
        elif message.topic == ODOM:
            received = decode_as(message.payload, msg.Odometry)
        else:
            return message.payload
        capture_ns = to_ns(received.header.stamp)
        if capture_ns < EPOCH_NS + BACK_NS:
            return message.payload
        return encode(replace(received, header=header(capture_ns - HOUR_NS, received.header.frame_id)))


@contextmanager
def lab(folder: Path, *, mocap_too: bool, silent: bool = False) -> Iterator[Lab]:
    """A lab in which the pair drives, up to the moment before the clock is set back."""
    scenario = load_scenario("turtlebot3", ["mocap.rate_hz=30", "mocap.sigma_position=1e-4"])
    driven = Lab(scenario, folder / "lab.mcap", mocap_too=mocap_too, silent=silent)
    try:
        driven.run_until(BACK_NS / S - 0.001)
        assert driven.commands[-1][1].v2 > 0.05, driven.commands[-1]
        yield driven
    finally:
        driven.recorder.close()


@pytest.mark.parametrize(("mocap_too", "silent"), [(True, True), (False, False)])
def test_the_robot_is_told_to_stand_at_once(tmp_path: Path, mocap_too: bool, silent: bool) -> None:
    with lab(tmp_path, mocap_too=mocap_too, silent=silent) as driven:
        driven.run_until(BACK_NS / S + 0.5)
    after = [command for seconds, command in driven.commands if seconds >= BACK_NS / S]
    assert len(after) > 20
    assert all(command.stop and command.v2 == command.u2 == 0.0 for command in after)


def test_it_goes_on_with_what_is_heard_from_then_on_and_the_log_tells_all(tmp_path: Path) -> None:
    with lab(tmp_path, mocap_too=True) as driven:
        driven.run_until(BACK_NS / S + 2.0)
        driven.recorder.end(driven.now_ns)
    late = [command for seconds, command in driven.commands if seconds > BACK_NS / S + 1.5]
    assert all(not command.stop and command.v2 > 0.05 for command in late)
    played = replay(read_log(tmp_path / "lab.mcap"))
    assert {name: (each.compared > 50, each.mismatched) for name, each in played.parity.items()} == {
        "estimates": (True, 0),
        "commands": (True, 0),
    }
    assert played.missing_inputs == 0
