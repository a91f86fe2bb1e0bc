from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import zenoh

from hil.bridge.ros_graph import message_class
from hil.bridge.ros_routes import Route, routes_of
from hil.errors import UsageError
from hil.scenario.files import load_scenario

ROOT = Path(__file__).resolve().parents[3]


def routes(*settings: str, scenario: str = "turtlebot3") -> dict[str, Route]:
    return {route.name: route for route in routes_of(load_scenario(scenario, list(settings)))}


def test_sensors_come_in_best_effort_and_commands_go_out_one_at_a_time() -> None:
    found = routes()
    sensed = {name for name, route in found.items() if route.way == "in" and not route.optional}
    assert sensed == {"/rigid_bodies", "/leader/odom", "/follower/odom"}
    assert not any(found[name].reliable for name in sensed)
    driven = found["/follower/cmd_vel"]
    assert (driven.way, driven.reliable, driven.depth, driven.drives) == ("out", True, 1, True)
    # Who drives the leader by hand has a robot that may be deaf to us.
    assert (found["/leader/cmd_vel"].drives, found["/leader/cmd_vel"].due, driven.due) == (True, False, True)
    # Nor is anybody in ROS to listen for a follower that is emulated.
    assert not routes("source.emulated=follower")["/follower/cmd_vel"].due
    assert (found["/stop"].way, found["/diagnostics"].way) == ("both", "out")


def test_names_types_and_source_are_the_labs() -> None:
    found = routes(
        "controller.command_type=Twist",
        "leader.namespace=tb3_1",
        'follower.namespace=""',
        "wire.prefix=lab",
        "source.type=PoseStamped",
        "leader.body=a",
        "follower.body=b",
    )
    assert found["/cmd_vel"].typename == "geometry_msgs/msg/Twist"
    assert found["/vrpn_mocap/a/pose"].typename == "geometry_msgs/msg/PoseStamped"
    assert found["/vrpn_mocap/b/pose"].way == "in"
    assert {"/odom", "/tb3_1/odom"} <= found.keys()
    assert not any("lab" in name for name in found)


def test_a_chain_has_routes_of_all_its_robots_once() -> None:
    all_routes = routes_of(load_scenario("chain5-turtlebot3"))
    assert len({route.topic for route in all_routes}) == len(all_routes)
    assert sum(route.due for route in all_routes) == 4


def test_a_message_package_that_is_not_there_is_named() -> None:
    with pytest.raises(UsageError, match="no_such_msgs has no Thing"):
        message_class("no_such_msgs/msg/Thing")


def test_the_bridge_of_the_lab_guide_carries_what_its_two_robots_need() -> None:
    """Zenoh takes its configuration, and each list has every topic of its way, and no more."""
    text = (ROOT / "docs" / "lab.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```json5\n(.*?)```", text, re.DOTALL)
    config = zenoh.Config.from_json5(block)
    assert json.loads(config.get_json("mode")) == "client"
    allowed = json.loads(config.get_json("plugins/ros2dds/allow"))
    found = routes("leader.namespace=tb3_0", "follower.namespace=tb3_1")
    needed = {way: {name for name in found if name.endswith(way)} for way in ("/odom", "/cmd_vel")}
    assert {"/odom": set(allowed["publishers"]), "/cmd_vel": set(allowed["subscribers"])} == needed


def test_the_ros_package_has_the_messages_that_we_send() -> None:
    """One source: its folder of messages is ours, and it builds every one."""
    package, ours = ROOT / "ros" / "abreast_msgs", ROOT / "hil" / "wire" / "msg" / "abreast_msgs"
    names = sorted(path.name for path in ours.glob("*.msg"))
    assert sorted(path.name for path in (package / "msg").iterdir()) == names
    assert all((package / "msg" / name).read_bytes() == (ours / name).read_bytes() for name in names)
    built = (package / "CMakeLists.txt").read_text(encoding="utf-8")
    assert all(f'"msg/{name}"' in built for name in names)
