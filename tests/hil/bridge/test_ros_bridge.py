"""What a bridge to ROS 2 does of itself, with a real wire on one side and ROS held by the test."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import pytest

from formation.pose import Motion
from hil.bridge.ros_bridge import RosBridge
from hil.bridge.ros_routes import routes_of
from hil.nodes.findings import findings_in
from hil.scenario.files import load_scenario
from hil.wire.drive_message import drive_message
from hil.wire.message_types import DiagnosticArray, TwistStamped
from hil.wire.messages import decode_as, encode
from hil.wire.pubsub import Wire
from tests.routers import router

ROUTES = routes_of(load_scenario("turtlebot3"))
REFUSED = b"what no middleware takes"
S = 1_000_000_000


@dataclass
class Ros:
    """ROS as a robot has it: keeps what it is told, and refuses bytes that are no message."""

    told: list[tuple[str, bytes]] = field(default_factory=list)
    types: dict[str, list[str]] = field(default_factory=dict)
    left: bool = False

    def spin(self, timeout: float) -> None:
        time.sleep(min(timeout, 0.01))

    def publish(self, topic: str, payload: bytes) -> None:
        if payload == REFUSED:
            raise RuntimeError("deserialization failed")
        self.told.append((topic, payload))

    def listeners(self, topic: str) -> list[str]:
        return self.types.get(topic, [])

    def close(self) -> None:
        self.left = True


@contextmanager
def bridged(
    allowed: frozenset[str] | None = None,
) -> Iterator[tuple[Ros, RosBridge, Wire, list[str]]]:
    ros, said = Ros(), list[str]()
    with router(allowed) as (_, wire):
        bridge = RosBridge(wire, ROUTES, lambda _: ros, said.append)
        try:
            yield ros, bridge, wire, said
        finally:
            if not ros.left:
                bridge.close()


def drives(robot: str, v: float) -> tuple[str, bytes]:
    return f"{robot}/cmd_vel", encode(drive_message(Motion(v, 0.0), time.time_ns(), robot, stamped=True))


def until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 20.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def last_speeds(ros: Ros) -> dict[str, float]:
    return {topic: decode_as(payload, TwistStamped).twist.linear.x for topic, payload in ros.told}


def test_a_bridge_that_ends_tells_who_was_told_to_drive_to_stand() -> None:
    with bridged() as (ros, bridge, wire, _):
        wire.publish(*drives("follower", 0.1))
        until(lambda: bool(ros.told))
        bridge.close()
    assert ros.left
    assert last_speeds(ros) == {"follower/cmd_vel": 0.0}


def test_what_ros_refuses_is_dropped_and_told_once_and_the_next_goes_out() -> None:
    with bridged() as (ros, bridge, wire, said):
        for _ in range(3):
            wire.publish("follower/cmd_vel", REFUSED)
        wire.publish(*drives("follower", 0.1))
        until(lambda: bool(ros.told))
        (report,) = (decode_as(each.payload, DiagnosticArray) for each in bridge.end(S))
    values = {each.key: each.value for each in report.status[0].values}
    assert (values["refused.follower/cmd_vel"], values["carried.follower/cmd_vel"]) == ("3", "1")
    assert [line for line in said if "refuses" in line] == [
        "ROS refuses a message on follower/cmd_vel (deserialization failed); it is dropped, as others like it"
    ]


@pytest.mark.parametrize(("told", "names"), [([], {"follower"}), (["leader"], {"leader", "follower"})])
def test_a_leader_is_deaf_once_it_was_told_to_drive(told: list[str], names: set[str]) -> None:
    with bridged() as (ros, bridge, wire, _):
        for robot in told:
            wire.publish(*drives(robot, 0.1))
        until(lambda: len(ros.told) == len(told))
        list(bridge.take(S))
        (said,) = bridge.take(4 * S)
        found = findings_in(decode_as(said.payload, DiagnosticArray))["bridge/ros2"]
    assert {name for name in ("leader", "follower") if f"/{name}/cmd_vel" in found["deaf_robot"]} == names


def test_orders_from_ros_that_keys_leave_to_others_are_dropped_and_told_once() -> None:
    with bridged(frozenset({"follower/odom", "diagnostics"})) as (_, bridge, _, said):
        for _ in range(3):
            for topic in ("stop", "follower/side", "follower/odom"):
                bridge._hear(topic, topic.encode())
            time.sleep(0.01)
        brought = [each.topic for each in bridge.take(S)]
    assert "follower/odom" in brought
    assert not {"stop", "follower/side"} & set(brought)
    assert [line for line in said if "keys" in line] == [
        f"our keys do not let {topic} through from ROS; it is dropped, as others like it"
        for topic in ("stop", "follower/side")
    ]
