"""Robots that are wrong in one way at a time, in rows; each is named by its check, and by no other."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from formation.pose import Motion
from hil.doctor.evidence import Asked, Evidence, Rolled
from hil.doctor.robot_checks import robot_checks
from hil.scenario.files import load_scenario
from hil.wire.key_layout import layout_of
from hil.wire.ros_tokens import Endpoint

SCENARIO = load_scenario("turtlebot3")
STAMPED = "geometry_msgs/msg/TwistStamped"
BEGIN_NS = 1_700_000_000_000_000_000
S = 1_000_000_000
Change = Callable[[Evidence, list[Endpoint]], None]


def lab() -> tuple[Evidence, list[Endpoint]]:
    """Five seconds of two robots with odometry at 20 Hz, one of them commanded at 50 Hz, all in the graph."""
    found = Evidence(SCENARIO)
    for robot in ("leader", "follower"):
        stamps = [BEGIN_NS + k * S // 20 for k in range(100)]
        found.odometry[f"{robot}/odom"] = [Rolled(at + S // 50, at, Motion(0.0, 0.0)) for at in stamps]
    stamps = [BEGIN_NS + k * S // 50 for k in range(250)]
    found.commands["follower/cmd_vel"] = [Asked(at, at) for at in stamps]
    graph = [Endpoint("controller", True, "follower/cmd_vel", STAMPED)]
    for robot in ("leader", "follower"):
        graph.append(Endpoint(robot, True, f"{robot}/odom", "nav_msgs/msg/Odometry"))
        graph.append(Endpoint(robot, False, f"{robot}/cmd_vel", STAMPED))
    return found, graph


def failed(found: Evidence, graph: list[Endpoint]) -> dict[str, str]:
    checks = list(robot_checks(found, graph, layout_of(SCENARIO)))
    assert all(bool(each.advice) != each.ok and each.expected for each in checks)
    return {each.name: each.seen for each in checks if not each.ok}


def silent(found: Evidence, _: list[Endpoint]) -> None:
    del found.odometry["follower/odom"]


def slow(found: Evidence, _: list[Endpoint]) -> None:
    found.odometry["leader/odom"] = found.odometry["leader/odom"][::4]


def ahead(found: Evidence, _: list[Endpoint]) -> None:
    rolled = found.odometry["follower/odom"]
    found.odometry["follower/odom"] = [each._replace(stamp_ns=each.stamp_ns + 3600 * S) for each in rolled]


def standing(found: Evidence, _: list[Endpoint]) -> None:
    rolled = found.odometry["follower/odom"]
    found.odometry["follower/odom"] = [each._replace(stamp_ns=rolled[-1].stamp_ns) for each in rolled]


def foreign(found: Evidence, _: list[Endpoint]) -> None:
    found.unread["follower/odom"] = 9


def deaf(_: Evidence, graph: list[Endpoint]) -> None:
    graph.remove(Endpoint("follower", False, "follower/cmd_vel", STAMPED))


def other_type(_: Evidence, graph: list[Endpoint]) -> None:
    graph[:] = [
        each
        if each.publishes or each.key != "follower/cmd_vel"
        else each._replace(typename="geometry_msgs/msg/Twist")
        for each in graph
    ]


def second_sender(_: Evidence, graph: list[Endpoint]) -> None:
    graph.append(Endpoint("joystick", True, "follower/cmd_vel", STAMPED))


def mixed_stamps(found: Evidence, _: list[Endpoint]) -> None:
    asked = found.commands["follower/cmd_vel"]
    found.commands["follower/cmd_vel"] = [
        each._replace(stamp_ns=each.stamp_ns - (k % 2) * S) for k, each in enumerate(asked)
    ]


def test_nothing_is_wrong_with_what_is_right() -> None:
    assert failed(*lab()) == {}


@pytest.mark.parametrize(
    ("change", "name", "word"),
    [
        (silent, "odometry", "follower: 0.0 samples"),
        (slow, "odometry", "leader: 5.0 samples"),
        (foreign, "odometry", "9 that are no Odometry"),
        (ahead, "odometry_clock", "-3599.980 s old"),
        (standing, "odometry_clock", "stand still"),
        (deaf, "deaf_robot", "nobody listens to /follower/cmd_vel"),
        (other_type, "command_type", "listened to as geometry_msgs/msg/Twist"),
        (second_sender, "senders", "2 senders of follower/cmd_vel"),
        (mixed_stamps, "senders", "back and forth"),
    ],
)
def test_each_thing_that_is_wrong_is_named_alone(change: Change, name: str, word: str) -> None:
    found, graph = lab()
    change(found, graph)
    wrong = failed(found, graph)
    assert list(wrong) == [name]
    assert word in wrong[name]


def test_a_robot_that_shows_in_no_graph_is_not_called_deaf() -> None:
    found, _ = lab()
    assert failed(found, []) == {}
