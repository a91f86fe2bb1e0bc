"""The judge's own robot against an integration in small steps, and against a TurtleBot3's habits."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.faults.robot import LAG_S, Robot

speeds = st.floats(-0.22, 0.22)
turns = st.floats(-2.8, 2.8)


@given(v=speeds, u=turns, told_v=speeds, told_u=turns)
def test_it_moves_as_small_steps_of_a_first_order_lag_do(
    v: float, u: float, told_v: float, told_u: float
) -> None:
    robot = Robot(v=v, u=u)
    robot.tell(told_v, told_u)
    goal_v, goal_u = robot.told_v, robot.told_u
    for _ in range(50):
        robot.move(0.01)
    x = y = theta = rolled = 0.0
    step_s = 1e-4
    for _ in range(5000):
        v += step_s / LAG_S * (goal_v - v)
        u += step_s / LAG_S * (goal_u - u)
        theta += u * step_s
        x += v * step_s * math.cos(theta)
        y += v * step_s * math.sin(theta)
        rolled += abs(v) * step_s
    assert (robot.v, robot.u) == pytest.approx((v, u), abs=2e-3)
    assert (robot.x, robot.y) == pytest.approx((x, y), abs=1e-3)
    assert math.remainder(robot.theta - theta, math.tau) == pytest.approx(0.0, abs=2e-3)
    assert robot.rolled == pytest.approx(rolled, abs=1e-3)


def test_it_keeps_its_last_command_for_ever() -> None:
    robot = Robot()
    robot.tell(0.1, 0.0)
    for _ in range(3600):
        robot.move(1.0)
    assert robot.rolled == pytest.approx(360.0, abs=0.02)


def test_a_command_of_thousandths_moves_nothing() -> None:
    robot = Robot()
    robot.tell(0.0099, -0.0099)
    robot.move(10.0)
    assert (robot.rolled, robot.theta) == (0.0, 0.0)
