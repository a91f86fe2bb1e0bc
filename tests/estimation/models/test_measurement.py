from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import (
    PoseNoise,
    from_sensor,
    measure_body,
    measure_body_from_mocap,
    measure_world,
    seen_in_range,
)
from formation.pose import Pose
from formation.shape import Shape, follower_pose

STANDING = FollowerMotion(0.0, 0.0, 0.005, 0.03)
angles = st.floats(-math.pi, math.pi, exclude_min=True)


def test_mocap_in_the_world_frame_is_taken_as_it_is() -> None:
    pose, noise = Pose(0.4, 0.5, 0.6), PoseNoise(0.002, 0.01)
    measured = measure_world(7, (1.0, -2.0), pose, noise, STANDING)
    assert measured.position.tolist() == [1.0, -2.0]
    assert measured.covariance.tolist() == [[4e-6, 0.0], [0.0, 4e-6]]
    assert (measured.capture_ns, measured.pose, measured.pose_noise) == (7, pose, noise)


@given(st.floats(0.05, 5.0), angles)
@settings(deadline=None)
def test_a_sighting_lies_at_its_range_and_bearing_with_noise_along_and_across(
    rho: float, alpha2: float
) -> None:
    measured = measure_body(0, rho, alpha2, 0.01, 0.02, STANDING)
    assert complex(*measured.position) == pytest.approx(rho * np.exp(1j * alpha2), abs=1e-14)
    along = np.array([math.cos(alpha2), math.sin(alpha2)])
    across = np.array([-along[1], along[0]])
    assert along @ measured.covariance @ along == pytest.approx(0.01**2)
    assert across @ measured.covariance @ across == pytest.approx((rho * 0.02) ** 2)
    assert abs(along @ measured.covariance @ across) < 1e-15
    assert measured.pose is None


@given(st.floats(0.05, 5.0), angles, angles)
@settings(deadline=None)
def test_mocap_seen_from_the_body_has_the_bearing_of_the_shape(
    rho: float, alpha2: float, theta: float
) -> None:
    leader = Pose(0.3, -0.7, theta)
    follower = follower_pose(Shape(rho, -1.0, alpha2), leader)
    measured = measure_body_from_mocap(0, (leader.x, leader.y), follower, PoseNoise(0.001, 0.003), STANDING)
    assert complex(*measured.position) == pytest.approx(rho * np.exp(1j * alpha2), abs=1e-13)


def test_mocap_noise_seen_from_the_body_is_what_drawing_it_gives() -> None:
    # A difference of two noisy positions, turned by a noisy heading: the spread grows across, not along.
    generator = np.random.default_rng(3)
    leader, follower, noise = (0.9, 0.4), Pose(0.1, -0.2, 0.7), PoseNoise(0.002, 0.01)
    draws = 40_000
    shaking = noise.position * (generator.standard_normal((2, draws, 2)) @ [1.0, 1j])
    line = complex(*leader) - complex(follower.x, follower.y) + shaking[0] - shaking[1]
    seen = line * np.exp(-1j * (follower.theta + noise.heading * generator.standard_normal(draws)))
    drawn = np.cov(seen.real, seen.imag)
    claimed = measure_body_from_mocap(0, leader, follower, noise, STANDING).covariance
    # The relative standard error of a variance from so many draws is 0.7 %.
    assert claimed == pytest.approx(drawn, abs=0.03 * float(np.trace(drawn)))


@given(
    rho=st.floats(0.1, 5.0),
    alpha2=st.floats(-math.pi, math.pi),
    x=st.floats(-0.3, 0.3),
    y=st.floats(-0.3, 0.3),
)
def test_what_a_sensor_sees_is_told_from_the_wheel_axis(
    rho: float, alpha2: float, x: float, y: float
) -> None:
    seen = from_sensor(rho, alpha2, (x, y))
    leader = cmath.rect(rho, alpha2) + complex(x, y)
    assert cmath.rect(*seen) == pytest.approx(leader, abs=1e-12)
    assert seen[0] >= 0.0
    assert from_sensor(rho, 0.0, (x, 0.0))[0] == pytest.approx(abs(rho + x))


@given(st.floats(0.05, 5.0), angles)
@settings(deadline=None)
def test_of_what_is_seen_in_range_the_bearing_may_be_a_radian_off(rho: float, alpha2: float) -> None:
    seen = measure_body(0, rho, alpha2, 0.01, 0.02, STANDING)
    ranged = seen_in_range(seen)
    along = np.array([math.cos(alpha2), math.sin(alpha2)])
    across = np.array([-along[1], along[0]])
    assert ranged.position.tolist() == seen.position.tolist()
    assert along @ ranged.covariance @ along == pytest.approx(0.01**2)
    assert across @ ranged.covariance @ across == pytest.approx(rho**2 * (1.0 + 0.02**2))
