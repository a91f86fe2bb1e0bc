"""Odometry of another moment is told from odometry of another motion."""

from __future__ import annotations

import pytest

from estimation.own_motion.odometry_check import TRACK, TWIST, source_of
from formation.pose import Motion
from tests.estimation.own_motion.judged_robot import JudgedRobot


@pytest.mark.parametrize("late_s", [0.2, 0.3, 0.45])
def test_a_delay_is_found_with_its_size(late_s: float) -> None:
    check = JudgedRobot(late_s=late_s).after(10.0)
    assert check.late == pytest.approx(late_s, abs=0.06)
    assert source_of(check) == TRACK


@pytest.mark.parametrize("late_s", [0.0, 0.03])
def test_a_few_milliseconds_are_none(late_s: float) -> None:
    robot = JudgedRobot(late_s=late_s)
    assert all(check.late == 0.0 for check in robot.run(20.0))


def test_who_never_changes_its_motion_shows_no_delay() -> None:
    robot = JudgedRobot(late_s=0.3, drive=lambda t: Motion(0.1, 0.5))
    assert source_of(robot.after(12.0)) == TWIST


def test_a_scale_is_no_delay() -> None:
    robot = JudgedRobot()
    check = robot.after(10.0, lambda t, motion, pose: (Motion(1.3 * motion.v, 1.3 * motion.u), None))
    assert check.late == 0.0


def test_a_delay_that_is_over_is_forgotten() -> None:
    robot = JudgedRobot(late_s=0.3)
    assert robot.after(10.0).late != 0.0
    robot.late_s = 0.0
    check = robot.after(22.0)
    assert check.late == 0.0
    assert source_of(check) == TWIST
