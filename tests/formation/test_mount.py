"""Mounts: the pose of a body on its robot, and of the robot under a body."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.mount import NO_MOUNT, Mount, body_pose, robot_pose
from formation.pose import Pose
from formation.wrapping import wrapped
from tests.bits import same_bits

lengths = st.floats(-3.0, 3.0)
angles = st.floats(-math.pi, math.pi)
poses = st.builds(Pose, lengths, lengths, angles)
mounts = st.builds(Mount, lengths, lengths, angles)


def test_a_body_ahead_of_a_robot_that_faces_left_is_left_of_it() -> None:
    seen = body_pose(Pose(1.0, 2.0, 0.5 * math.pi), Mount(0.1, 0.02, 0.3))
    assert tuple(seen) == pytest.approx((0.98, 2.1, 0.5 * math.pi + 0.3))


@given(poses, mounts)
def test_the_robot_under_its_own_body_is_that_robot(pose: Pose, mount: Mount) -> None:
    back = robot_pose(body_pose(pose, mount), mount)
    assert (back.x, back.y) == pytest.approx((pose.x, pose.y), abs=1e-14)
    assert wrapped(back.theta - pose.theta) == pytest.approx(0.0, abs=1e-14)


@given(poses)
def test_without_a_mount_not_a_bit_changes(pose: Pose) -> None:
    same_bits(body_pose(pose, NO_MOUNT), pose)
    same_bits(robot_pose(pose, NO_MOUNT), pose)
