"""The order for a guard: made of a scenario, carried as a file, read back the same."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from formation.pose import Motion
from hil.errors import UsageError
from hil.guard.driver import drive_bytes
from hil.guard.order import read_order
from hil.guard.order_of import guard_order
from hil.scenario.files import load_scenario, scenario_names
from hil.wire.drive_message import drive_message
from hil.wire.key_layout import layout_of
from hil.wire.lab_robots import robots_of
from hil.wire.messages import encode
from hil.wire.ros_tokens import endpoint_in

LAB = ["leader.namespace=tb3_1", 'wire.topics={"follower/cmd_vel" = "base/drive"}']
BOUNDED = [
    "guard.fence=[-1, -2.0, 3.0, 4.0]",
    "guard.separation=0.2",
    "robot.v_rate=0.5",
    "guard.age_s=0.1",
    "follower.body=42",
]


@pytest.mark.parametrize("name", [name for name in scenario_names() if not name.startswith("flock")])
def test_every_robot_of_every_scenario_has_one_that_comes_back_the_same(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(name)
    for robot in robots_of(scenario):
        order = guard_order(scenario, robot.name)
        path = tmp_path / "order.json"
        path.write_text(order.as_text(), encoding="utf-8")
        assert read_order(path) == order
        assert order.cmd_vel == robot.cmd_vel
        assert order.wanted == f"{robot.cmd_vel}_wanted"


def test_it_holds_what_the_scenario_says_of_its_robot(tmp_path: Path) -> None:
    order = guard_order(load_scenario("turtlebot3", [*LAB, *BOUNDED]), "follower")
    assert order.rules.fence == (-1.0, -2.0, 3.0, 4.0)
    assert (order.rules.separation, order.rules.v_rate, order.rules.u_rate) == (0.2, 0.5, math.inf)
    assert (order.rules.age_s, order.rules.body) == (0.1, "42")
    assert order.cmd_vel == order.ros_topic == "base/drive"
    assert guard_order(load_scenario("turtlebot3", LAB), "leader").cmd_vel == "tb3_1/cmd_vel"


@pytest.mark.parametrize("layout", ["ros2dds", "rmw_zenoh"])
def test_it_shows_in_the_ros_graph_what_it_hears_and_says(layout: str) -> None:
    scenario = load_scenario("turtlebot3", [f"wire.layout={layout}", "wire.prefix=lab"])
    order = guard_order(scenario, "follower")
    ends = [end for token in order.tokens_of("7f") if (end := endpoint_in(layout_of(scenario), token))]
    assert {end.session for end in ends} == {"7f"}
    assert [end.key for end in ends if end.publishes] == ["lab/follower/cmd_vel", "lab/diagnostics"]
    assert [end.key for end in ends if not end.publishes] == ["lab/follower/cmd_vel_wanted", "lab/stop"]


@pytest.mark.parametrize("command_type", ["TwistStamped", "Twist"])
def test_a_driver_is_told_the_bytes_that_the_codec_writes(command_type: str) -> None:
    order = guard_order(load_scenario("turtlebot3", [f"controller.command_type={command_type}"]), "follower")
    motion, now_ns = Motion(0.123, -1.5), 1_700_000_000_123_456_789
    told = drive_message(motion, now_ns, "follower", stamped=command_type == "TwistStamped")
    assert drive_bytes(order, motion, now_ns) == encode(told)


def broken(order: dict[str, Any], tmp_path: Path) -> Path:
    path = tmp_path / "order.json"
    path.write_text(json.dumps(order), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "change",
    [
        {"abreast_guard": 2},
        {"rules": {}},
        {"rules": None},
        {"drive": "zz"},
        {"tokens": None},
        {"more": 1},
    ],
)
def test_a_file_that_is_no_order_is_refused_in_one_line(change: dict[str, Any], tmp_path: Path) -> None:
    order = json.loads(guard_order(load_scenario("turtlebot3"), "follower").as_text())
    with pytest.raises(UsageError, match="no order for a guard") as refused:
        read_order(broken(order | change, tmp_path))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("key", ["age_s", "latch_s", "v_max", "u_max"])
@pytest.mark.parametrize("value", [0.0, -1.0, None, "1"])
def test_limits_that_are_none_are_refused(key: str, value: object, tmp_path: Path) -> None:
    order = json.loads(guard_order(load_scenario("turtlebot3"), "follower").as_text())
    order["rules"][key] = value
    with pytest.raises(UsageError, match="no order for a guard"):
        read_order(broken(order, tmp_path))


def test_an_unknown_robot_and_a_missing_file_are_told(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no such robot; one of: leader, follower"):
        guard_order(load_scenario("turtlebot3"), "bob")
    with pytest.raises(UsageError, match="No such file"):
        read_order(tmp_path / "order.json")
    (tmp_path / "odd").write_bytes(b"\xff\xfe")
    with pytest.raises(UsageError, match="no order"):
        read_order(tmp_path / "odd")
