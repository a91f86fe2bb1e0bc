"""The bridge to ROS 2 against robots and a motion capture in rclpy."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from hil.nodes.findings import findings_in
from hil.wire import message_types as msg
from hil.wire.messages import decode_as, encode, header
from hil.wire.pubsub import Wire
from tests.real.ros_lab import HERE, Lab, bridge, peer, standing
from tests.routers import router

pytestmark = pytest.mark.slow


def twist(v: float, u: float) -> msg.Twist:
    return msg.Twist(linear=msg.Vector3(x=v, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=u))


def drive(lab: Lab, wire: Wire, topic: str, seconds: float) -> dict[str, list[bytes]]:
    """Tell the follower to drive, twenty times a second, and take down what comes."""
    heard: dict[str, list[bytes]] = {}
    due = time.monotonic()
    until = due + seconds
    while due < until:
        asked: msg.Message = twist(0.1, 0.2)
        if lab.command_types[1] == "TwistStamped":
            asked = msg.TwistStamped(header=header(time.time_ns(), "follower"), twist=twist(0.1, 0.2))
        wire.publish(topic, encode(asked))
        due += 0.05
        while (left := due - time.monotonic()) > 0.0:
            if (event := wire.inbox.take(left)) is not None:
                heard.setdefault(event.topic, []).append(event.payload)
    return heard


@pytest.mark.parametrize(
    "lab",
    [
        Lab(domain=91),
        Lab(domain=92, namespaces=("tb3_1", ""), command_types=("Twist", "Twist")),
    ],
    ids=["namespaced TwistStamped", "follower without namespace, Twist"],
)
def test_frames_and_odometry_come_in_and_commands_go_out(lab: Lab, peers: Path) -> None:
    leader, follower = (f"{name}/" if name else "" for name in lab.namespaces)
    with router() as (endpoint, wire), standing(lab, peers) as (robots, _), bridge(lab, endpoint, peers):
        wire.subscribe([lab.topic, f"{leader}odom", f"{follower}odom", "diagnostics"])
        heard = drive(lab, wire, f"{follower}cmd_vel", 6.0)
        robots.finish()
    frame = decode_as(heard[lab.topic][-1], msg.RigidBodies)
    assert tuple(body.rigid_body_name for body in frame.rigidbodies) == lab.bodies
    assert len(heard[lab.topic]) > 200
    own = decode_as(heard[f"{follower}odom"][-1], msg.Odometry)
    assert own.twist.twist.linear.x == pytest.approx(0.1, abs=0.01)
    assert own.twist.twist.angular.z == pytest.approx(0.2, abs=0.01)
    assert f"{leader}odom" in heard
    report = decode_as(heard["diagnostics"][-1], msg.DiagnosticArray)
    assert findings_in(report) == {"bridge/ros2": {}}


def test_a_bridge_that_ends_leaves_the_robot_standing(peers: Path) -> None:
    """It keeps its last command for ever, and nobody reaches it any more."""
    lab = Lab(domain=96)
    with router() as (endpoint, wire), standing(lab, peers) as (robots, _):
        with bridge(lab, endpoint, peers):
            drive(lab, wire, "follower/cmd_vel", 4.0)
        time.sleep(1.5)
        follower = json.loads(robots.finish()[-1])["/follower"]
    assert follower["heard"] > 10
    assert max(map(abs, follower["speed"])) < 0.001


@pytest.mark.parametrize(
    ("lab", "finding"),
    [
        (Lab(domain=93, listens=(True, False)), "deaf_robot"),
        (Lab(domain=94, command_types=("TwistStamped", "Twist")), "command_type"),
    ],
    ids=["deaf", "another type"],
)
def test_a_robot_that_does_not_listen_is_named(lab: Lab, finding: str, peers: Path) -> None:
    takes_stamped = Lab(domain=lab.domain)
    with router() as (endpoint, wire), standing(lab, peers), bridge(takes_stamped, endpoint, peers) as ours:
        wire.subscribe(["diagnostics"])
        said = ours.wait_for(f"finds {finding}")
        assert "/follower/cmd_vel" in said
        until = time.monotonic() + 10.0
        found: dict[str, str] = {}
        while finding not in found and time.monotonic() < until:
            if (event := wire.inbox.take(1.0)) is not None:
                found = findings_in(decode_as(event.payload, msg.DiagnosticArray))["bridge/ros2"]
        assert set(found) == {finding}


def test_a_stop_goes_both_ways_once(peers: Path) -> None:
    """An operator's stop in ROS reaches our daemons, and ours reaches ROS; neither goes in a circle."""
    lab = Lab(domain=95)
    operator = [str(HERE / "rclpy_operator.py"), json.dumps({"domain": lab.domain})]
    with (
        router() as (endpoint, wire),
        bridge(lab, endpoint, peers),
        peer("operator", operator, peers) as theirs,
    ):
        theirs.wait_for("ready")
        wire.subscribe(["stop"])
        theirs.say("by them")
        assert stops_within(wire, 3.0) == ["by them"]
        wire.publish("stop", encode(msg.String(data="by us")))
        assert stops_within(wire, 3.0) == ["by us"]
        assert [line for line in theirs.finish() if "by" in line] == ["by them", "by us"]


def stops_within(wire: Wire, seconds: float) -> list[str]:
    """Reasons of the stops that come."""
    stops, until = list[str](), time.monotonic() + seconds
    while (left := until - time.monotonic()) > 0.0:
        if (event := wire.inbox.take(left)) is not None and event.topic == "stop":
            stops.append(decode_as(event.payload, msg.String).data)
    return stops
