"""Lines by pairs say the same as shapes by angles."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from formation.arc import Course
from formation.kernel import entry, interpreted
from formation.line import Line, leader_seen, line_between, line_of, shape_of_line
from formation.pose import Pose
from formation.shape import Shape, shape_of
from tests.bits import same_bits

angles = st.floats(-math.pi, math.pi, exclude_min=True)
shapes = st.builds(Shape, st.floats(0.05, 5.0), angles, angles)
poses = st.builds(Pose, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), angles)


@entry
def seen_again(shape: Shape) -> Line:
    return line_between(leader_seen(line_of(shape)), Course(0.0, 0.0, 1.0, 0.0))


def course(pose: Pose) -> Course:
    return Course(pose.x, pose.y, math.cos(pose.theta), math.sin(pose.theta))


@given(shapes)
def test_a_line_is_its_shape(shape: Shape) -> None:
    assert shape_of_line(line_of(shape)) == pytest.approx(shape, abs=1e-14)


@given(poses, poses)
def test_the_line_of_two_courses_is_the_shape_of_their_poses(leader: Pose, follower: Pose) -> None:
    assume(math.hypot(leader.x - follower.x, leader.y - follower.y) > 0.05)
    line = line_between(course(leader), course(follower))
    assert line == pytest.approx(line_of(shape_of(leader, follower)), abs=1e-13)


@given(shapes)
def test_the_leader_is_where_its_line_says_compiled_and_interpreted(shape: Shape) -> None:
    assert seen_again(shape) == pytest.approx(line_of(shape), abs=1e-13)
    same_bits(seen_again(shape), interpreted(seen_again)(shape))


def test_in_one_place_there_are_no_directions() -> None:
    line = line_between(Course(1.0, 2.0, 1.0, 0.0), Course(1.0, 2.0, 0.0, 1.0))
    assert line.rho == 0.0
    assert all(math.isnan(part) for part in line[1:])
