from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from formation.pose import Pose
from formation.shape import Shape, follower_pose
from hil.nodes.node import Outgoing
from hil.scenario.files import load_scenario
from hil.scene.lab_scene import SCENE, TF, WORLD, LabScene
from hil.scene.markers import Marker, MarkerArray
from hil.scene.robot_size import HEIGHT, WIDTH
from hil.wire.message_types import (
    Command,
    Header,
    LeaderEstimate,
    Message,
    Odometry,
    Point,
    PoseWithCovariance,
    Quaternion,
    RigidBodies,
    RigidBody,
    Time,
    Twist,
    TwistWithCovariance,
    Vector3,
)
from hil.wire.message_types import (
    Pose as PoseMessage,
)
from hil.wire.messages import decode_as, encode, header, to_time
from hil.wire.pose_sources import TFMessage

NOW = 1_700_000_000_000_000_000
SHAPE = Shape(0.2, -0.5 * math.pi, 0.5 * math.pi)
LEADS = Pose(1.0, 2.0, 0.7)
FOLLOWS = follower_pose(SHAPE, LEADS)
STILL = Twist(linear=Vector3(x=0.0, y=0.0, z=0.0), angular=Vector3(x=0.0, y=0.0, z=0.0))


def placed(pose: Pose) -> PoseMessage:
    half = 0.5 * pose.theta
    turned = Quaternion(x=0.0, y=0.0, z=math.sin(half), w=math.cos(half))
    return PoseMessage(position=Point(x=pose.x, y=pose.y, z=0.0), orientation=turned)


def frame(leader: Pose = LEADS, follower: Pose = FOLLOWS) -> RigidBodies:
    bodies = [RigidBody("leader", [], placed(leader)), RigidBody("follower", [], placed(follower))]
    return RigidBodies(header(NOW, "mocap"), 1, bodies)


ODOMETRY = Odometry(
    header=header(NOW, "odom"),
    child_frame_id="base",
    pose=PoseWithCovariance(pose=placed(FOLLOWS), covariance=np.zeros(36)),
    twist=TwistWithCovariance(twist=STILL, covariance=np.zeros(36)),
)


def estimate(**changes: object) -> LeaderEstimate:
    told = {
        "rho": SHAPE.rho, "alpha2": SHAPE.alpha2, "rho_dot": 0.0, "alpha2_dot": 0.0, "v1": 0.1,
        "alpha1": SHAPE.alpha1, "u1": 0.0, "v2": 0.1, "u2": 0.0,
        "covariance": np.diag([0.0, 0.0, 0.01**2, 0.05**2, 0.0]).reshape(25), "nis": 1.0, "status": 1,
        "reason": "", "bound_v1": 0.02, "bound_alpha1": 0.3, "bound_h": 1.0, "consumed": [],
    }  # fmt: skip
    return LeaderEstimate(header(NOW, "follower"), to_time(NOW), to_time(NOW), **(told | changes))  # type: ignore[arg-type]


def command(stop: str = "") -> Command:
    at = to_time(NOW)
    return Command(header(NOW, "follower"), at, at, 0.1, 0.2, 0.1, 0.2, False, stop, True, [])


def shown(messages: Iterable[tuple[str, Message]], *settings: str) -> tuple[TFMessage, list[Marker]]:
    """What is shown at last of messages that come a tenth of a second apart."""
    scene, told = LabScene(load_scenario("turtlebot3", settings)), dict[str, Outgoing]()
    for number, (topic, message) in enumerate(messages):
        told |= {each.topic: each for each in scene.hear(topic, encode(message), NOW + number * 10**8)}
    transforms, markers = decode_as(told[TF].payload, TFMessage), decode_as(told[SCENE].payload, MarkerArray)
    found: list[Any] = list(markers.markers)
    return transforms, found


EVERYTHING: list[tuple[str, Message]] = [
    ("rigid_bodies", frame()),
    ("follower/leader_estimate", estimate()),
    ("follower/command", command()),
]


def of(markers: list[Marker], number: int) -> Marker:
    (found,) = (each for each in markers if (each.ns, each.id) == ("follower/estimate", number))
    return found


def points(marker: Marker) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.array([(each.x, each.y) for each in marker.points])


def test_robots_stand_where_the_motion_capture_has_them_in_true_size() -> None:
    transforms, markers = shown(EVERYTHING)
    by_name = {each.child_frame_id: each for each in transforms.transforms}
    assert by_name.keys() == {"leader", "follower"}
    for name, pose in (("leader", LEADS), ("follower", FOLLOWS)):
        at = by_name[name].transform
        assert by_name[name].header.frame_id == WORLD
        turned = 2.0 * math.atan2(at.rotation.z, at.rotation.w)
        assert (at.translation.x, at.translation.y, turned) == pytest.approx(pose)
        robot = [each for each in markers if each.header.frame_id == name]
        body, left, right, _ = robot
        assert body.scale.z == HEIGHT == 0.192
        assert left.pose.position.y + 0.5 * left.scale.z == pytest.approx(0.5 * 0.178) == 0.5 * WIDTH
        assert right.pose.position.y == -left.pose.position.y
        assert left.pose.position.z == 0.5 * left.scale.x


def test_a_body_that_sits_askew_is_not_taken_for_the_robot() -> None:
    seen = Pose(
        LEADS.x - 0.05 * math.sin(LEADS.theta), LEADS.y + 0.05 * math.cos(LEADS.theta), LEADS.theta + 0.2
    )
    messages = [("rigid_bodies", frame(leader=seen))]
    transforms, _ = shown(messages, "leader.mount=[0.0, 0.05, 0.2]")
    at = next(each.transform for each in transforms.transforms if each.child_frame_id == "leader")
    assert (at.translation.x, at.translation.y) == pytest.approx(LEADS[:2])


def test_what_is_believed_points_along_the_leaders_heading() -> None:
    _, markers = shown(EVERYTHING)
    begin, tip = points(of(markers, 2))
    assert begin == pytest.approx(LEADS[:2])
    along = np.array([math.cos(LEADS.theta), math.sin(LEADS.theta)])
    assert tip - begin == pytest.approx(0.1 * along)
    offsets = points(of(markers, 3)) - tip
    assert np.abs(offsets @ along).max() == pytest.approx(3.0 * 0.01)
    assert np.linalg.norm(offsets, axis=1).min() == pytest.approx(3.0 * 0.05 * 0.1, rel=0.02)
    reach = np.linalg.norm(points(of(markers, 4)) - begin, axis=1)
    assert (reach.min(), reach.max()) == pytest.approx((0.08, 0.12))
    ends = points(of(markers, 4))[0] - begin
    assert math.atan2(along[0] * ends[1] - along[1] * ends[0], along @ ends) == pytest.approx(-0.3)


def test_three_deviations_of_the_leaders_position_are_those_that_the_estimator_reports() -> None:
    _, markers = shown(EVERYTHING)
    ellipse = points(of(markers, 1)) - np.array(LEADS[:2])
    assert np.linalg.norm(ellipse, axis=1) == pytest.approx(np.full(len(ellipse), 3.0 * 0.0003))


def test_the_station_is_where_a_follower_abreast_stands() -> None:
    _, markers = shown(EVERYTHING)
    assert points(of(markers, 5))[:-1].mean(axis=0) == pytest.approx(FOLLOWS[:2])
    _, other = shown(EVERYTHING, 'formation.side="left"')
    mirrored = 2.0 * np.array(LEADS[:2]) - np.array(FOLLOWS[:2])
    assert points(of(other, 5))[:-1].mean(axis=0) == pytest.approx(mirrored)


def test_texts_say_bounds_and_why_a_robot_stands() -> None:
    _, markers = shown([*EVERYTHING, ("follower/command", command("no estimate"))])
    assert "v1 100.0 mm/s, bound 20.0 mm/s" in of(markers, 20).text
    assert "alpha1 -90.0 deg, bound 17.2 deg" in of(markers, 20).text
    assert "stands: no estimate" in of(markers, 21).text


def test_what_is_not_trusted_is_not_drawn() -> None:
    _, markers = shown([*EVERYTHING[:1], ("follower/leader_estimate", estimate(status=4, reason="lost"))])
    assert {each.id for each in markers if each.ns == "follower/estimate"} == {0, 1, 20, 21}
    assert "lost" in of(markers, 20).text
    _, markers = shown([*EVERYTHING[:1], ("follower/leader_estimate", estimate(bound_v1=math.nan))])
    assert 4 not in {each.id for each in markers if each.ns == "follower/estimate"}


def test_without_motion_capture_the_leader_is_where_the_estimate_has_it_from_the_odometry() -> None:
    transforms, _ = shown([("follower/leader_estimate", estimate()), ("follower/odom", ODOMETRY)])
    at = {each.child_frame_id: each.transform for each in transforms.transforms}["leader"]
    assert (at.translation.x, at.translation.y) == pytest.approx(LEADS[:2])
    assert 2.0 * math.atan2(at.rotation.z, at.rotation.w) % math.tau == pytest.approx(LEADS.theta)


def test_it_is_told_as_often_as_eyes_can_follow_and_again_after_a_jump_back() -> None:
    scene, payload = LabScene(load_scenario("turtlebot3")), encode(frame())
    told = [
        each.topic
        for number in range(240)
        for each in scene.hear("rigid_bodies", payload, NOW + number * 4_166_667)
    ]
    assert 50 <= told.count(TF) <= 63
    assert 15 <= told.count(SCENE) <= 20
    assert list(scene.hear("rigid_bodies", payload, NOW))


@pytest.mark.parametrize("topic", ["rigid_bodies", "follower/leader_estimate", "diagnostics", "elsewhere"])
def test_what_cannot_be_read_is_passed_over(topic: str) -> None:
    assert not list(LabScene(load_scenario("turtlebot3")).hear(topic, b"\0\1\0\0nothing", NOW))


@pytest.mark.parametrize("field", ["status", "stamp"])
def test_an_estimate_that_is_none_is_passed_over_and_not_kept(field: str) -> None:
    odd = estimate(status=200) if field == "status" else estimate()
    if field == "stamp":
        odd = dataclasses.replace(odd, header=Header(Time(sec=-1, nanosec=0), "follower"))
    odd_ones: list[tuple[str, Message]] = [("follower/leader_estimate", odd), ("rigid_bodies", frame())]
    _, markers = shown([*EVERYTHING, *odd_ones])
    assert "tracking" in of(markers, 20).text, "by the estimate before"


@pytest.mark.parametrize("framed", [True, False])
def test_angles_that_are_none_are_not_drawn(framed: bool) -> None:
    wild = ("follower/leader_estimate", estimate(alpha2=1.7e308, alpha1=-1.7e308))
    place: tuple[str, Message] = ("rigid_bodies", frame()) if framed else ("follower/odom", ODOMETRY)
    transforms, markers = shown([wild, place])
    assert {each.child_frame_id for each in transforms.transforms} == (
        {"leader", "follower"} if framed else {"follower"}
    )
    assert 20 not in {each.id for each in markers}


def test_a_robot_that_the_motion_capture_has_lost_is_shown_no_longer() -> None:
    alone = RigidBodies(header(NOW, "mocap"), 1, frame().rigidbodies[1:])
    later: list[tuple[str, Message]] = [("rigid_bodies", alone)] * 12
    transforms, markers = shown([*EVERYTHING, *later[:7]])
    assert {each.child_frame_id for each in transforms.transforms} == {"leader", "follower"}
    transforms, markers = shown([*EVERYTHING, *later])
    assert [each.child_frame_id for each in transforms.transforms] == ["follower"]
    assert {each.header.frame_id for each in markers} == {"follower"}


def test_an_estimate_and_a_command_of_nodes_that_are_gone_are_shown_no_longer() -> None:
    later: list[tuple[str, Message]] = [("rigid_bodies", frame())] * 12
    _, markers = shown([*EVERYTHING[:2], ("follower/command", command("no estimate")), *later])
    assert {each.id for each in markers if each.ns == "follower/estimate"} == {0, 21}
    assert "no estimate" not in of(markers, 21).text
