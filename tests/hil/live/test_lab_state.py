from __future__ import annotations

import pytest

from formation.pose import Motion, Pose
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.live.lab_state import LabState, told_lines
from hil.nodes.findings import named_findings
from hil.nodes.node import diagnostics
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import drive_message
from hil.wire.events import Event
from hil.wire.messages import encode

SCENARIO = load_scenario("turtlebot3", ["leader.body=1"])


def told(state: LabState, topic: str, message: msg.Message, now: float) -> None:
    state.hear(Event(topic, encode(message)), now)


def drive(v: float, u: float = 0.0) -> msg.Message:
    return drive_message(Motion(v, u), 5, "robot", stamped=True)


def test_bodies_daemons_and_robots_are_told_with_their_ages() -> None:
    state = LabState(SCENARIO)
    for k in range(200):
        pair = [("1", Pose(0.0, 0.0, 0.0)), ("ball", Pose(1.0, 0.0, 0.0))]
        told(state, topics.RIGID_BODIES, frame_message(10**9, k, pair), 10.0 + k / 100)
    values = {"status": "lost", "refused.tilted": 7, **named_findings({"axes": "y points up"})}
    told(state, topics.DIAGNOSTICS, diagnostics("estimator", 5, "waiting for mocap", values), 11.5)
    told(state, "follower/cmd_vel", drive(0.1, -0.5), 11.9)
    told(state, topics.STOP, msg.String(data="by hand"), 11.95)
    state.hear(Event("follower/cmd_vel", b"?"), 11.96)
    found = state.as_dict(12.0)
    (estimator,) = found["daemons"]
    assert (estimator["name"], estimator["ok"], estimator["says"]) == (
        "estimator",
        False,
        "waiting for mocap",
    )
    assert (estimator["age_s"], estimator["refused"]) == (0.5, {"tilted": 7})
    assert [each["name"] for each in estimator["findings"]] == ["axes"]
    assert [(each["name"], each["wanted"]) for each in found["bodies"]] == [("1", True), ("ball", False)]
    assert found["bodies"][0]["rate_hz"] == pytest.approx(100.0)
    assert found["missing_bodies"] == ["follower"]
    leader, follower = found["robots"]
    assert (leader["told"], leader["odometry"], follower["odometry"]) == (None, None, None)
    assert (follower["told"]["v"], follower["told"]["u"]) == (0.1, -0.5)
    assert (found["stops"], found["malformed"]) == (["by hand"], 1)
    lines = {what: says for what, _, says in told_lines(state, 12.0)}
    assert lines["estimator"] == "lost; waiting for mocap; refused: 7 tilted"
    assert (lines["body follower"], lines["body ball"]) == ("not seen", "nobody asks for it")


def test_a_robot_is_driven_until_nobody_has_told_it_to_move_for_a_moment() -> None:
    state = LabState(SCENARIO)
    assert state.driven(0.0) == []
    told(state, "leader/cmd_vel", drive(0.0), 0.0)
    told(state, "follower/cmd_vel", drive(0.1), 1.0)
    told(state, "follower/cmd_vel", drive(0.0), 1.01)
    assert state.driven(1.1) == ["follower"]
    assert state.driven(1.3) == []


def test_a_robot_is_driven_by_what_cannot_be_read_too() -> None:
    state = LabState(SCENARIO)
    told(state, "follower/cmd_vel", drive(0.0), 1.0)
    state.hear(Event("follower/cmd_vel", encode(drive_message(Motion(0.0, 0.0), 5, "", stamped=False))), 1.01)
    assert (state.driven(1.1), state.driven(1.3)) == (["follower"], [])


def test_a_robot_is_heard_of_by_its_odometry_or_by_what_it_is_told() -> None:
    state = LabState(SCENARIO)
    assert state.unheard() == ["leader", "follower"]
    told(state, "leader/odom", odometry_message(5, "leader", Pose(0.0, 0.0, 0.0), Motion(0.0, 0.0)), 1.0)
    assert state.unheard() == ["follower"]
    told(state, "follower/cmd_vel", drive(0.0), 1.0)
    assert state.unheard() == []


def test_odometry_is_shown_with_what_it_says() -> None:
    state = LabState(SCENARIO)
    moves = odometry_message(5, "leader", Pose(0.0, 0.0, 0.0), Motion(0.1, -0.25))
    told(state, "leader/odom", moves, 1.0)
    state.hear(Event("follower/odom", b"?"), 1.0)
    leader, follower = (robot["odometry"] for robot in state.as_dict(1.0)["robots"])
    assert (leader["v"], leader["u"], follower["v"]) == (0.1, -0.25, None)
    said = [says for _, _, says in told_lines(state, 1.0)]
    assert "odometry v +0.100 m/s, u -0.25 rad/s" in said
    assert "odometry that cannot be read" in said


def test_nodes_that_say_that_they_stopped_are_known() -> None:
    state = LabState(SCENARIO)
    said: dict[str, tuple[str, dict[str, object]]] = {
        "guard/x": ("latched (stopped): by hand", {"latched": "stopped"}),
        "guard/y": ("", {"latched": ""}),
        "controller": ("", {"decided.stopped": 12}),
        "controller/z": ("", {"decided.stopped": 0}),
        "leader": ("stopped: by hand", {}),
        "estimator": ("", {}),
    }
    for name, (problem, values) in said.items():
        told(state, topics.DIAGNOSTICS, diagnostics(name, 5, problem, values), 1.0)
    assert state.stopped_nodes() == ["controller", "guard/x", "leader"]


def test_a_count_that_is_no_number_is_not_one() -> None:
    state = LabState(SCENARIO)
    refused = {"refused.tilted": 7, "refused.late": "²", "refused.lost": "7" * 5000}
    told(state, topics.DIAGNOSTICS, diagnostics("estimator", 5, "", refused), 1.0)
    (estimator,) = state.as_dict(1.0)["daemons"]
    assert estimator["refused"] == {"tilted": 7}


def test_a_robot_that_takes_no_stamps_is_read_too() -> None:
    state = LabState(load_scenario("turtlebot3", ["controller.command_type=Twist"]))
    told(state, "follower/cmd_vel", drive_message(Motion(0.2, 0.3), 5, "robot", stamped=False), 1.0)
    assert (state.drives["follower/cmd_vel"].v, state.drives["follower/cmd_vel"].u) == (0.2, 0.3)
