from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formation.angles import wrap
from formation.pose import Pose, advance

poses = st.builds(Pose, st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3))
speeds, turn_rates, times = st.floats(-2, 2), st.floats(-5, 5), st.floats(-2, 2)


def assert_same_pose(left: Pose, right: Pose, tolerance: float = 1e-12) -> None:
    assert math.hypot(left.x - right.x, left.y - right.y) <= tolerance
    assert abs(wrap(left.theta - right.theta)) <= tolerance


@given(poses, speeds, turn_rates, times, times)
@settings(deadline=None)
def test_two_steps_make_one(pose: Pose, v: float, u: float, first: float, second: float) -> None:
    assert_same_pose(advance(advance(pose, v, u, first), v, u, second), advance(pose, v, u, first + second))


@given(poses, speeds, st.one_of(st.floats(0.1, 5), st.floats(-5, -0.1)), times)
@settings(deadline=None)
def test_step_stays_on_the_circle_of_radius_v_over_u(pose: Pose, v: float, u: float, dt: float) -> None:
    def centre(at: Pose) -> tuple[float, float]:
        return at.x - v / u * math.sin(at.theta), at.y + v / u * math.cos(at.theta)

    assert centre(advance(pose, v, u, dt)) == pytest.approx(centre(pose), abs=1e-12)


@pytest.mark.parametrize("turned", [0.0, 1e-300, 1e-20, 1e-12, 1e-8, 1e-5])
def test_small_turns_keep_every_digit(turned: float) -> None:
    """Against the series of the chord and the sagitta, where the form with v/u has lost up to all digits."""
    end = advance(Pose(0.0, 0.0, 0.0), 1.0, turned, 1.0)
    assert end.x == pytest.approx(1.0 - turned**2 / 6.0, rel=3e-16)
    assert end.y == pytest.approx(turned / 2.0, rel=1e-10)
    assert end.theta == turned


def test_heading_comes_back_wrapped() -> None:
    assert advance(Pose(0.0, 0.0, 3.0), 0.0, 1.0, 1.0).theta == pytest.approx(4.0 - 2.0 * math.pi)
