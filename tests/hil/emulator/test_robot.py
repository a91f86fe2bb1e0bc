from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from formation.angles import FloatArray, wrap
from formation.pose import STANDSTILL, Motion, Pose, advance
from hil.emulator.robot import Actuators, Robot, arcs_of, drive, pose_of, standing, travelling

TURTLEBOT = Actuators(lag=0.1, v_max=0.22, u_max=2.84, v_resolution=0.01, u_resolution=0.01)
speeds, turns = st.floats(-0.22, 0.22), st.floats(-2.84, 2.84)
motions = st.builds(Motion, speeds, turns)


def driven(pose: Pose, motion: Motion, goal: Motion, actuators: Actuators, dt: float) -> Robot:
    return drive(standing(pose)._replace(motion=motion, goal=goal), arcs_of(dt, actuators.lag))


@given(motions, motions, st.floats(0.02, 0.5), st.floats(0.001, 0.5))
@settings(deadline=None, max_examples=40)
def test_a_robot_follows_its_command_as_first_order_actuators_do(
    motion: Motion, command: Motion, lag: float, dt: float
) -> None:
    def rates(_: float, x: FloatArray) -> list[float]:
        speed = [x[3] * math.cos(x[2]), x[3] * math.sin(x[2]), x[4]]
        return [*speed, (command.v - x[3]) / lag, (command.u - x[4]) / lag]

    start = np.array([0.3, -0.2, 2.9, motion.v, motion.u])
    end = solve_ivp(rates, (0.0, dt), start, method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    actuators = Actuators(lag, 1.0, 3.0, 0.0, 0.0)
    moved = driven(Pose(0.3, -0.2, 2.9), motion, command, actuators, dt)
    assert (moved.motion.v, moved.motion.u) == pytest.approx((end[3], end[4]), abs=1e-9)
    pose = pose_of(moved)
    assert abs(wrap(pose.theta - float(end[2]))) < 1e-9
    assert (moved.at.cos, moved.at.sin) == pytest.approx((math.cos(end[2]), math.sin(end[2])), abs=1e-9)
    # Arcs of 10 ms at the mean motion: micrometres, where mocap resolves a tenth of a millimetre.
    assert (pose.x, pose.y) == pytest.approx((end[0], end[1]), abs=2e-5)
    assert moved.goal == command


def test_without_lag_a_command_is_driven_at_once() -> None:
    actuators = Actuators(0.0, 1.0, 3.0, 0.0, 0.0)
    moved = driven(Pose(0.0, 0.0, 0.0), STANDSTILL, Motion(0.2, 0.5), actuators, 0.01)
    assert moved.motion == Motion(0.2, 0.5)
    assert pose_of(moved) == pytest.approx(advance(Pose(0.0, 0.0, 0.0), 0.2, 0.5, 0.01), abs=1e-17)


@given(motions, motions, st.floats(0.01, 0.5), st.lists(st.floats(0.0, 0.3), min_size=1, max_size=20))
@settings(deadline=None)
def test_the_motion_is_the_closed_form_of_the_lag_and_the_path_that_of_its_arcs(
    motion: Motion, goal: Motion, lag: float, spans: list[float]
) -> None:
    pose, robot = Pose(1.0, -2.0, 3.0), standing(Pose(1.0, -2.0, 3.0))._replace(motion=motion, goal=goal)
    turned = 0.0
    for span in spans:
        arcs = arcs_of(span, lag)
        for _ in range(arcs.pieces):
            v = goal.v + (robot.motion.v - goal.v) * arcs.share
            u = goal.u + (robot.motion.u - goal.u) * arcs.share
            pose = advance(pose, v, u, arcs.step)
            turned += u * arcs.step
            robot = drive(robot, arcs._replace(pieces=1))
    left = math.exp(-sum(spans) / lag)
    closed = Motion(goal.v + (motion.v - goal.v) * left, goal.u + (motion.u - goal.u) * left)
    assert robot.motion == pytest.approx(closed, abs=1e-12)
    found = pose_of(robot)
    assert (found.x, found.y) == pytest.approx((pose.x, pose.y), abs=1e-12)
    assert abs(wrap(found.theta - pose.theta)) < 1e-12
    assert robot.heading == pytest.approx(3.0 + turned, abs=1e-12)
    assert math.hypot(robot.at.cos, robot.at.sin) == pytest.approx(1.0, abs=1e-13)


def test_no_time_moves_nothing() -> None:
    robot = standing(Pose(1.0, 2.0, 3.0))._replace(motion=Motion(0.1, 0.2), goal=Motion(0.2, -1.0))
    still = drive(robot, arcs_of(0.0, TURTLEBOT.lag))
    assert (still.at, still.heading, still.goal) == (robot.at, robot.heading, robot.goal)
    assert (still.motion.v, still.motion.u) == pytest.approx((0.1, 0.2), abs=1e-15)


@pytest.mark.parametrize(
    ("wanted", "accepted"),
    [
        (Motion(0.199, 0.999), Motion(0.19, 0.99)),
        (Motion(-0.199, -0.999), Motion(-0.19, -0.99)),
        (Motion(0.009, -0.009), Motion(0.0, 0.0)),
        (Motion(0.08, 0.7), Motion(0.08, 0.7)),  # whole steps, in spite of 0.08 / 0.01 < 8 in binary
        (Motion(0.5, -9.0), Motion(0.22, -2.84)),
        (Motion(math.nan, 1.0), STANDSTILL),
        (Motion(0.1, math.inf), STANDSTILL),
        (Motion(1e308, -1e308), Motion(0.22, -2.84)),
    ],
)
def test_the_firmware_limits_and_truncates_toward_zero(wanted: Motion, accepted: Motion) -> None:
    found = TURTLEBOT.accept(wanted)
    assert (found.v, found.u) == pytest.approx((accepted.v, accepted.u), abs=1e-12)


@given(st.floats(), st.floats(), st.sampled_from([0.0, 0.01, 0.05, 5e-324]))
@settings(deadline=None)
def test_whatever_is_commanded_the_wheels_get_no_more(v: float, u: float, resolution: float) -> None:
    actuators = Actuators(0.1, 0.22, 2.84, resolution, resolution)
    found = actuators.accept(Motion(v, u))
    assert abs(found.v) <= 0.22 + 1e-12
    assert abs(found.u) <= 2.84 + 1e-12
    if math.isfinite(v) and math.isfinite(u):
        assert abs(found.v) <= abs(v) + 1e-9 * resolution
        assert found.v * v >= 0.0
        assert abs(found.v - max(-0.22, min(0.22, v))) <= resolution + 1e-12


@given(motions, st.floats(-3.1, 3.1))
def test_a_robot_is_known_by_the_way_it_travels(motion: Motion, theta: float) -> None:
    robot = standing(Pose(0.2, -0.1, theta))._replace(motion=motion)
    pose, ahead = travelling(robot)
    assert ahead == Motion(abs(motion.v), motion.u)
    assert (pose.x, pose.y) == (0.2, -0.1)
    velocity = ahead.v * math.cos(pose.theta), ahead.v * math.sin(pose.theta)
    assert velocity == pytest.approx((motion.v * math.cos(theta), motion.v * math.sin(theta)), abs=1e-15)
