"""Who listens to a robot's commands, told by tokens of another session, in both layouts."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from hil.live.listener_watch import Commanded, ListenerWatch
from hil.nodes.findings import findings_in
from hil.scenario.files import load_scenario
from hil.wire.key_layout import layout_of
from hil.wire.message_types import DiagnosticArray
from hil.wire.messages import decode_as
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint

ROBOT = Commanded("listeners", "follower/cmd_vel", "follower/odom", "follower/cmd_vel")
S = 1_000_000_000
PATIENCE = 30.0


@contextmanager
def watched(layout: str, robot_takes: str) -> Iterator[tuple[ListenerWatch, Wire, Wire, list[bytes]]]:
    """A watch on a robot, its own wire and that of the robot, and what is said of it."""
    settings = [f"wire.layout={layout}", "wire.prefix=lab"]
    ours = layout_of(load_scenario("turtlebot3", settings))
    theirs = layout_of(load_scenario("turtlebot3", [*settings, f"controller.command_type={robot_takes}"]))
    with reserved_endpoint() as endpoint:
        router = open_session(Endpoints(listen=endpoint))
        session = open_session(Endpoints(connect=endpoint))
        wire, robot = Wire(router, layout=ours, node="controller"), Wire(session, layout=theirs, node="robot")
        said: list[bytes] = []
        try:
            yield ListenerWatch(wire, ours, [ROBOT], said.append), wire, robot, said
        finally:
            for each in (wire, robot):
                each.close()
            for one in (session, router):
                close_session(one)


def found_within(watch: ListenerWatch, wire: Wire, seconds: int, known: int) -> set[str]:
    """Findings as of a watch of so many seconds, once that many endpoints of the robot are known."""
    until = time.monotonic() + PATIENCE
    while len([each for each in wire.graph() if "follower" in each.key]) < known:
        assert time.monotonic() < until
        time.sleep(0.01)
    found: set[str] = set()
    for tick in range(2 * seconds + 1):
        for report in watch.reports(1_700_000_000 * S + tick * S // 2):
            found = set(findings_in(decode_as(report.payload, DiagnosticArray))["listeners"])
    return found


@pytest.mark.parametrize("layout", ["ros2dds", "rmw_zenoh"])
def test_a_deaf_robot_and_another_type_are_found_within_two_seconds(layout: str) -> None:
    with watched(layout, "Twist") as (watch, wire, robot, said):
        assert not found_within(watch, wire, 2, known=0)
        robot.publish("follower/odom", b"")
        assert found_within(watch, wire, 2, known=1) == {"deaf_robot"}
        robot.subscribe(["follower/cmd_vel"])
        assert found_within(watch, wire, 2, known=2) == {"command_type"}
    assert said


@pytest.mark.parametrize("layout", ["ros2dds", "rmw_zenoh"])
def test_nothing_is_said_of_a_robot_that_listens(layout: str) -> None:
    with watched(layout, "TwistStamped") as (watch, wire, robot, said):
        robot.publish("follower/odom", b"")
        robot.subscribe(["follower/cmd_vel"])
        assert not found_within(watch, wire, 3, known=2)
    assert not said


def test_who_takes_down_everything_listens_to_nobody() -> None:
    with watched("ros2dds", "TwistStamped") as (watch, wire, robot, _):
        robot.publish("follower/odom", b"")
        robot.subscribe(["follower/cmd_vel"], shown=False)
        assert found_within(watch, wire, 2, known=1) == {"deaf_robot"}
