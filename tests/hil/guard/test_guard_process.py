"""The guard as a process between real commanders and a driver that keeps its last command."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from formation.pose import STANDSTILL, Motion
from hil.wire import topics
from hil.wire.drive_message import drive_message
from hil.wire.message_types import String
from hil.wire.messages import encode
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint
from tests.hil.guard.guarded_lab import (
    COMMANDER,
    FORWARD,
    PATIENCE,
    TOLD,
    WANTED,
    Lab,
    guarded_lab,
    router_client,
)


@pytest.fixture
def lab() -> Iterator[Lab]:
    with guarded_lab() as lab:
        yield lab


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_commander_that_is_gone_or_frozen_leaves_a_robot_that_stands_until_it_is_armed(
    lab: Lab, number: signal.Signals
) -> None:
    lab.guard()
    commander = lab.commander()
    lab.until(lab.drives)
    lab.listen(0.3)
    commander.send_signal(number)
    cause_s = time.monotonic()
    lab.stands_after(cause_s)
    if number == signal.SIGSTOP:
        commander.send_signal(signal.SIGCONT)
        lab.listen(1.0)
        assert lab.told == STANDSTILL
    else:
        lab.commander()
        lab.until(lambda: "restart" in lab.guards.held["follower"] or "silent" in lab.guards.held["follower"])
        lab.listen(1.5)
        assert lab.told == STANDSTILL
    lab.arm()
    lab.until(lab.drives)


def test_a_second_commander_stops_the_robot_within_a_second_and_is_named(lab: Lab) -> None:
    lab.guard()
    lab.commander()
    lab.until(lab.drives)
    lab.commander()
    lab.until(lambda: lab.told == STANDSTILL)
    lab.until(lambda: "sends commands as well as session" in lab.guards.held["follower"])
    lab.listen(1.0)
    assert lab.told == STANDSTILL


@pytest.mark.parametrize("where", [WANTED, TOLD])
def test_a_stranger_does_not_drive_the_robot(lab: Lab, where: str) -> None:
    """One on the topic of the guard, and one past it, whom the guard can but contradict."""
    lab.guard()
    lab.commander()
    lab.until(lab.drives)
    with router_client(lab.endpoint) as stranger:
        told = encode(drive_message(Motion(0.2, 2.0), time.time_ns(), "follower", stamped=True))
        stranger.put(where, told)
        lab.until(lambda: lab.told == STANDSTILL)
        lab.until(lambda: "without a session" in lab.guards.held["follower"])
        lab.listen(0.5)
    assert lab.told == STANDSTILL


def test_a_stop_holds_until_arming_and_a_guard_that_ends_leaves_its_robot_standing(lab: Lab) -> None:
    guard = lab.guard()
    lab.commander()
    lab.until(lab.drives)
    lab.wire.publish(topics.STOP, encode(String(data="enough")))
    lab.until(lambda: lab.told == STANDSTILL)
    lab.until(lambda: "enough" in lab.guards.held["follower"])
    lab.listen(0.5)
    assert lab.told == STANDSTILL
    lab.arm()
    lab.until(lab.drives)
    guard.send_signal(signal.SIGTERM)
    lab.until(lambda: lab.told == STANDSTILL)
    _, words = guard.communicate(timeout=PATIENCE)
    assert guard.returncode == 0
    assert "latched (stopped)" in words
    lab.listen(0.5)
    assert lab.told == STANDSTILL


def test_a_guard_that_was_killed_and_comes_again_does_not_drive_unasked(lab: Lab) -> None:
    guard = lab.guard()
    lab.commander()
    lab.until(lab.drives)
    guard.kill()
    guard.wait()
    lab.guards.held.clear()
    lab.guard()
    lab.until(lambda: lab.told == STANDSTILL)
    lab.until(lambda: "restart" in lab.guards.held["follower"])
    lab.arm()
    lab.until(lab.drives)


def test_commands_go_on_past_a_router_that_comes_again(lab: Lab) -> None:
    """The robot's own side is the guard's: its driver is told to stand though the lab's router is gone."""
    with reserved_endpoint() as own, reserved_endpoint() as far:
        session = open_session(Endpoints(listen=far))
        given = ("guard", "turtlebot3", "--robot", "follower", "--connect", far, "--listen", own)
        lab.start("-m", "hil", *given)
        driver = open_session(Endpoints(connect=own), PATIENCE)
        wire = Wire(driver)
        near = Lab(own, wire, ExitStack())
        near.until(lambda: "follower" in near.guards.held)
        lab.start(str(COMMANDER), far, str(FORWARD.v), str(FORWARD.u))
        near.until(near.drives)
        cause_s = time.monotonic()
        close_session(session)
        near.stands_after(cause_s)
        session = open_session(Endpoints(listen=far))
        near.until(lambda: "silent" in near.guards.held.get("follower", ""))
        near.listen(2.0)
        assert near.told == STANDSTILL
        near.arm()
        near.until(near.drives)
        wire.close()
        close_session(driver)
        close_session(session)
