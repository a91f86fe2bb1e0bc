"""Odometry that lies is found out within two seconds, and odometry that does not never is."""

from __future__ import annotations

import math

import pytest

from estimation.models.coordinated_turn import FollowerMotion
from estimation.own_motion.judged_odometry import contradicts
from estimation.own_motion.odometry_check import (
    POSE,
    TRACK,
    TWIST,
    UNCHECKED,
    OdometryCheck,
    OdometrySample,
    WayEntry,
    source_of,
    way_between,
    with_sample,
)
from estimation.own_motion.own_track import OwnPoint, own_begun, own_point
from formation.pose import Motion, Pose, advance
from formation.records import plain_rows_of
from tests.estimation.own_motion.judged_robot import EPOCH_NS, MS, NOISE, JudgedRobot, Lie, honest


def scaled(v: float, u: float) -> Lie:
    """A twist of another scale, without a pose."""
    return lambda t, motion, pose: (Motion(v * motion.v, u * motion.u), None)


def standing(t: float) -> Motion:
    return Motion(0.0, 0.0)


@pytest.mark.parametrize("seed", range(1, 6))
def test_healthy_odometry_is_believed_all_the_way(seed: int) -> None:
    robot = JudgedRobot(seed=seed)
    assert all(source_of(check) == TWIST for check in robot.run(20.0))
    assert robot.check.by_twist.borne_out > 0


@pytest.mark.parametrize("scale", [0.97, 1.03])
def test_wheels_that_are_a_little_off_are_believed(scale: float) -> None:
    robot = JudgedRobot()
    assert all(check.by_twist.trusted for check in robot.run(15.0, scaled(scale, scale)))


@pytest.mark.parametrize(
    "lie",
    [scaled(0.0, 0.0), scaled(1e-6, 1e-6), scaled(-1.0, -1.0), scaled(1.0, -1.0), scaled(-1.0, 1.0)],
    ids=["zero", "tiny", "reversed", "turns the other way", "drives the other way"],
)
def test_what_contradicts_is_refuted_within_two_seconds(lie: Lie) -> None:
    robot = JudgedRobot()
    robot.after(5.0)
    assert source_of(robot.after(7.0, lie)) == TRACK


@pytest.mark.parametrize("scale", [1.3, 0.7])
def test_another_scale_is_refuted_within_five_seconds_and_known(scale: float) -> None:
    robot = JudgedRobot()
    robot.after(5.0)
    check = robot.after(10.0, scaled(scale, scale))
    assert source_of(check) == TRACK
    assert check.v.both / check.v.shown == pytest.approx(scale, abs=0.07)


def test_a_right_pose_stands_in_for_a_wrong_twist() -> None:
    robot = JudgedRobot()
    check = robot.after(8.0, lambda t, motion, pose: (Motion(0.0, 0.0), pose))
    assert not check.by_twist.trusted
    assert source_of(check) == POSE


def test_what_agrees_again_for_a_while_is_believed_again() -> None:
    robot = JudgedRobot()
    assert source_of(robot.after(6.0, scaled(0.0, 0.0))) == TRACK
    assert source_of(robot.after(7.0, scaled(1.0, 1.0))) == TRACK
    assert source_of(robot.after(10.0, scaled(1.0, 1.0))) == TWIST


def test_a_robot_that_stands_proves_nothing() -> None:
    robot = JudgedRobot()
    robot.after(6.0, scaled(0.0, 0.0))
    robot.drive = standing
    assert source_of(robot.after(16.0)) == TRACK


def test_a_pose_that_jumps_is_a_reset_and_harms_nobody() -> None:
    robot = JudgedRobot()
    robot.after(5.0)
    check = robot.after(15.0, lambda t, motion, pose: (motion, Pose(pose.x - 0.4, pose.y, pose.theta)))
    assert check.resets == 1
    assert check.by_twist.trusted
    assert check.by_pose.trusted


def test_one_window_alone_refutes_nothing() -> None:
    robot = JudgedRobot()
    robot.after(5.0)
    wild: Lie = lambda t, motion, pose: (Motion(9.0, 90.0) if t < 5.1 else motion, None)  # noqa: E731
    assert all(check.by_twist.trusted for check in robot.run(15.0, wild))


def test_silence_leaves_no_window_across_it() -> None:
    robot = JudgedRobot()
    robot.after(4.0)
    robot.after(8.0, lambda t, motion, pose: None)
    check = robot.after(16.0, honest)
    assert check.by_twist.trusted
    assert check.by_twist.excess == 0.0


def test_a_sample_that_is_not_newer_tells_nothing() -> None:
    ways = plain_rows_of(WayEntry, 8)

    def heard(check: OdometryCheck, at_ms: int) -> OdometryCheck:
        return with_sample(
            check, ways, OdometrySample(EPOCH_NS + at_ms * MS, 0.1, 0.2, False, Pose(0, 0, 0)), NOISE
        )

    check = heard(heard(UNCHECKED, 0), 30)
    assert heard(check, 30) == check
    assert heard(check, 10) == check


@pytest.mark.parametrize(("v", "u"), [(0.1, 0.0), (-0.1, 0.7), (0.2, -2.5), (0.0, 1.0)])
def test_the_way_of_an_arc_is_that_of_its_motion(v: float, u: float) -> None:
    start = Pose(0.3, -0.7, 3.0)
    way = way_between(start, advance(start, v, u, 0.5))
    assert way.v == pytest.approx(0.5 * v, abs=1e-12)
    assert way.u == pytest.approx(math.remainder(0.5 * u, 2.0 * math.pi), abs=1e-12)


@pytest.mark.parametrize("factor", [3.0, 10.0])
def test_noise_that_nobody_told_refutes_no_odometry(factor: float) -> None:
    robot = JudgedRobot(noise=factor)
    assert all(check.by_twist.trusted for check in robot.run(20.0))
    assert robot.check.heading_noise == pytest.approx(factor * factor, rel=0.6)


def told(v: float, u: float) -> FollowerMotion:
    return FollowerMotion(v, u, 5e-3, 3e-2)


def tracked(v: float, u: float, rejected: int = 0) -> OwnPoint:
    """Point of a track that knows its motion to 0.03 m/s and 0.3 rad/s, as one at 120 Hz does."""
    pose, nothing = Pose(0.0, 0.0, 0.0), FollowerMotion(0.0, 0.0, 0.0, 0.0)
    point = own_begun(EPOCH_NS, pose, False, nothing, NOISE)
    spread = point.spread._replace(v_v=0.03**2, u_u=0.3**2)
    return point._replace(state=point.state._replace(v=v, u=u), spread=spread, rejected=rejected)


def test_what_poses_rule_out_is_known_before_it_is_refuted() -> None:
    assert contradicts(told(-0.1, -0.5), tracked(0.1, 0.5))
    assert contradicts(told(0.1, -1.0), tracked(0.1, 1.0))
    for v, u in ((0.1, 0.5), (0.11, 0.55), (0.05, 0.2), (0.15, 1.0)):
        assert not contradicts(told(v, u), tracked(0.1, 0.5))
    # A track whose poses are outliers has no say.
    assert not contradicts(told(-0.1, -0.5), tracked(0.1, 0.5, rejected=1))


def test_healthy_odometry_is_ruled_out_at_no_pose() -> None:
    robot, ruled_out, counted = JudgedRobot(), 0, 0
    for _ in robot.run(20.0):
        if robot.ring.length:
            point = own_point(robot.own, robot.ring, robot.ring.length - 1)
            motion = robot.drive((point.capture_ns - EPOCH_NS) * 1e-9)
            ruled_out += contradicts(told(motion.v, motion.u), point)
            counted += 1
    assert counted > 500
    assert ruled_out == 0
