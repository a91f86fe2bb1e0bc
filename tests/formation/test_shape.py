from __future__ import annotations

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from formation.angles import wrap
from formation.pose import Motion, Pose, advance
from formation.shape import (
    ABREAST_ALPHA1,
    ABREAST_ALPHA2,
    Shape,
    follower_pose,
    leader_velocity,
    polar_velocity,
    shape_of,
    shape_rates,
)
from tests.formation.shape_rates import reduced_rates, relative_rates

angles = st.floats(-math.pi, math.pi, exclude_min=True)
poses = st.builds(Pose, st.floats(-5, 5), st.floats(-5, 5), angles)
shapes = st.builds(Shape, st.floats(0.05, 5), angles, angles)
motions = st.builds(Motion, st.floats(-2, 2), st.floats(-3, 3))


def mirrored(pose: Pose) -> Pose:
    return Pose(pose.x, -pose.y, wrap(-pose.theta))


def assert_same_shape(left: Shape, right: Shape, tolerance: float) -> None:
    assert left.rho == pytest.approx(right.rho, abs=tolerance)
    assert abs(wrap(left.alpha1 - right.alpha1)) <= tolerance
    assert abs(wrap(left.alpha2 - right.alpha2)) <= tolerance


def test_follower_on_the_right_has_the_papers_signs() -> None:
    shape = shape_of(Pose(0.0, 0.0, 0.0), Pose(0.0, -0.5, 0.0))
    assert shape == Shape(0.5, ABREAST_ALPHA1, ABREAST_ALPHA2)


def test_start_of_the_papers_simulation() -> None:
    shape = shape_of(Pose(0.0, 0.0, math.pi / 4), Pose(0.0, 1.0, math.pi))
    assert_same_shape(shape, Shape(1.0, math.pi / 4, math.pi / 2), 1e-15)


@given(shapes, poses)
@settings(deadline=None)
def test_pose_and_shape_are_inverse(shape: Shape, leader: Pose) -> None:
    assert_same_shape(shape_of(leader, follower_pose(shape, leader)), shape, 1e-12)


@given(poses, poses, poses)
@settings(deadline=None)
def test_shape_does_not_depend_on_the_world_frame(leader: Pose, follower: Pose, frame: Pose) -> None:
    assume(math.hypot(leader.x - follower.x, leader.y - follower.y) > 0.05)

    def seen_from_frame(pose: Pose) -> Pose:
        dx, dy = pose.x - frame.x, pose.y - frame.y
        cos, sin = math.cos(frame.theta), math.sin(frame.theta)
        return Pose(cos * dx + sin * dy, cos * dy - sin * dx, pose.theta - frame.theta)

    moved = shape_of(seen_from_frame(leader), seen_from_frame(follower))
    assert_same_shape(moved, shape_of(leader, follower), 1e-12)


@given(poses, poses)
@settings(deadline=None)
def test_mirror_image_flips_the_bearings(leader: Pose, follower: Pose) -> None:
    assume(math.hypot(leader.x - follower.x, leader.y - follower.y) > 0.05)
    shape = shape_of(leader, follower)
    image = shape_of(mirrored(leader), mirrored(follower))
    assert_same_shape(image, Shape(shape.rho, -shape.alpha1, -shape.alpha2), 1e-12)


@given(shapes, poses, motions, motions)
@settings(deadline=None)
def test_rates_are_those_of_two_robots_on_arcs(
    shape: Shape, leader: Pose, leading: Motion, following: Motion
) -> None:
    """Eq. (3) against central differences of the shape of two exactly driven poses."""
    follower, h = follower_pose(shape, leader), 1e-5

    def later(dt: float) -> Shape:
        return shape_of(
            advance(leader, leading.v, leading.u, dt), advance(follower, following.v, following.u, dt)
        )

    before, after, rates = later(-h), later(h), shape_rates(shape, leading, following)
    # The third derivatives that the difference leaves out grow as (relative speed / rho)^3.
    tolerance = 1e-8 + h**2 * (10.0 + 5.0 / shape.rho) ** 3
    assert (after.rho - before.rho) / (2 * h) == pytest.approx(rates.rho_dot, abs=tolerance)
    assert wrap(after.alpha1 - before.alpha1) / (2 * h) == pytest.approx(rates.alpha1_dot, abs=tolerance)
    assert wrap(after.alpha2 - before.alpha2) / (2 * h) == pytest.approx(rates.alpha2_dot, abs=tolerance)


@given(st.floats(0.05, 5), angles, motions, st.floats(-2, 2))
@settings(deadline=None)
def test_reduced_rates_are_the_full_ones_on_the_manifold(
    rho: float, alpha1: float, leading: Motion, v2: float
) -> None:
    full = shape_rates(Shape(rho, alpha1, math.pi / 2), leading, Motion(v2, 0.0))
    expected = pytest.approx((full.rho_dot, full.alpha1_dot), abs=1e-12)
    assert reduced_rates(rho, alpha1, leading, v2) == expected


@given(shapes, st.floats(0.01, 2), st.floats(-3, 3), motions)
@settings(deadline=None)
def test_leader_is_recovered_from_the_rates(shape: Shape, v1: float, u1: float, following: Motion) -> None:
    rates = shape_rates(shape, Motion(v1, u1), following)
    x, y = leader_velocity(shape.rho, shape.alpha2, rates.rho_dot, rates.alpha2_dot, following)
    speed, alpha1 = polar_velocity(x, y)
    assert speed == pytest.approx(v1, abs=1e-12)
    assert abs(wrap(alpha1 - shape.alpha1)) <= 1e-12
    again = relative_rates(shape.rho, shape.alpha2, speed, alpha1, following)
    assert again == pytest.approx((rates.rho_dot, rates.alpha2_dot), abs=1e-10)


def test_bearing_of_the_leader_is_smooth_at_the_operating_point() -> None:
    """Where arctan(Y/X) jumps by pi."""
    left, right = polar_velocity(-1e-9, -0.08)[1], polar_velocity(1e-9, -0.08)[1]
    assert left == pytest.approx(-math.pi / 2, abs=1e-7)
    assert right == pytest.approx(-math.pi / 2, abs=1e-7)


def test_robots_in_one_place_are_refused() -> None:
    with pytest.raises(ValueError, match="both at"):
        shape_of(Pose(1.0, 2.0, 0.0), Pose(1.0, 2.0, 1.0))
