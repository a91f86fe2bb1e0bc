"""A guard, its driver, a controller, an operator and a stranger, each by keys of its own."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from formation.pose import STANDSTILL, Motion
from hil.wire import topics
from hil.wire.drive_message import drive_message, read_drive
from hil.wire.message_types import String
from hil.wire.messages import encode
from hil.wire.pubsub import Wire
from tests.hil.guard.guarded_lab import FORWARD, TOLD, WANTED
from tests.tls_labs import PATIENCE, lab_keys, tls_lab


class Driver:
    """A robot's driver by its keys, beside a controller who wants it to drive."""

    def __init__(self, robot: Wire, controller: Wire) -> None:
        self.robot, self.controller = robot, controller
        self.told = STANDSTILL
        robot.subscribe([TOLD])

    def listen(self) -> None:
        wanted = drive_message(FORWARD, time.time_ns(), "follower", stamped=True)
        self.controller.publish(WANTED, encode(wanted))
        if (event := self.robot.inbox.take(0.02)) is not None and event.topic:
            self.told = read_drive(event.payload, stamped=True)

    def until(self, motion: Motion, meanwhile: Callable[[], None] = lambda: None) -> None:
        until = time.monotonic() + PATIENCE
        while self.told != motion:
            assert time.monotonic() < until
            meanwhile()
            self.listen()


def test_a_guarded_robot_obeys_the_controller_and_the_operator_and_nobody_else(tmp_path: Path) -> None:
    scenario = lab_keys(tmp_path / "keys")
    with tls_lab(tmp_path / "keys") as lab:
        given = ("--robot", "follower", "--secure", str(tmp_path / "keys"), "--connect", lab.endpoint)
        guard = subprocess.Popen([sys.executable, "-m", "hil", "guard", "turtlebot3", *given])
        try:
            driver = Driver(lab.wire("robot", scenario), lab.wire("controller", scenario))
            operator = lab.wire("operator", scenario)
            # Before anybody drives: while they join no command is fresh.
            strangers = [lab.wire(role, scenario, strict=False) for role in ("viewer", "mocap", "estimator")]

            def order(topic: str, word: str) -> None:
                operator.publish(topic, encode(String(data=word)))

            driver.until(FORWARD, lambda: order(topics.ARM, "follower"))
            still = encode(drive_message(STANDSTILL, time.time_ns(), "follower", stamped=True))
            told: set[Motion] = set()
            for _ in range(50):
                for stranger in strangers:
                    stranger.publish(topics.STOP, encode(String(data="a stranger says so")))
                    stranger.publish(TOLD, still)
                    stranger.publish(WANTED, still)
                driver.listen()
                told.add(driver.told)
            assert told == {FORWARD}
            order(topics.STOP, "enough")
            driver.until(STANDSTILL)
        finally:
            guard.terminate()
            assert guard.wait(PATIENCE) == 0
