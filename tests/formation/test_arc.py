from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.angles import wrap
from formation.arc import Course, Swing, along, small_turn, swing
from formation.kernel import entry, interpreted
from formation.pose import Pose, advance
from tests.bits import same_bits

SWITCH = 0.125
# Both sides of the switch to the series, and the switch itself, deserve as much attention as the rest.
angles = st.one_of(
    st.floats(-10.0, 10.0),
    st.floats(-0.2, 0.2),
    st.floats(0.999 * SWITCH, 1.001 * SWITCH),
    st.sampled_from([0.0, -0.0, SWITCH, -SWITCH, math.nextafter(SWITCH, 1.0), 1e-9, 1e-300]),
)
turns = st.one_of(st.floats(-3.0, 3.0), st.floats(-1e-2, 1e-2), st.sampled_from([0.0, 1e-9, -1e-5, 0.25]))
steps = st.floats(1e-3, 0.5)
speeds = st.floats(-2.0, 2.0)
headings = st.floats(-math.pi, math.pi)


@entry
def drive(x: float, y: float, theta: float, v: float, u: float, dt: float) -> Course:
    return along(Course(x, y, math.cos(theta), math.sin(theta)), v, u, dt)


@entry
def turn_by(u: float, dt: float) -> Swing:
    return swing(u, dt)


@given(angles)
def test_sine_and_cosine_of_a_turn_are_right_to_rounding(x: float) -> None:
    found = small_turn(x)
    assert found.sinc == pytest.approx(math.sin(x) / x if abs(x) > 1e-200 else 1.0, abs=3e-16)
    assert found.cos == pytest.approx(math.cos(x), abs=5e-16)


@given(speeds, speeds, headings, speeds, turns, st.floats(-0.5, 2.0))
def test_a_course_is_a_pose_that_drives_its_arc(
    x: float, y: float, theta: float, v: float, u: float, dt: float
) -> None:
    there = advance(Pose(x, y, theta), v, u, dt)
    found = drive(x, y, theta, v, u, dt)
    assert (found.x, found.y) == pytest.approx((there.x, there.y), abs=1e-14)
    assert abs(wrap(math.atan2(found.sin, found.cos) - there.theta)) < 1e-14
    same_bits(found, interpreted(drive)(x, y, theta, v, u, dt))


def test_a_direction_keeps_its_length_over_many_steps() -> None:
    course = Course(0.0, 0.0, 1.0, 0.0)
    for _ in range(100_000):
        course = along(course, 0.1, 0.7, 1.0 / 120.0)
    # A rounding error a step.
    assert course.cos * course.cos + course.sin * course.sin == pytest.approx(1.0, abs=3e-11)
    assert (course.x, course.y) == pytest.approx((0.1 / 0.7 * course.sin, 0.1 / 0.7 * (1.0 - course.cos)))


@given(turns, steps)
def test_a_swing_is_made_of_the_integrals_of_cosine_and_sine(u: float, dt: float) -> None:
    nodes, weights = np.polynomial.legendre.leggauss(30)
    t = 0.5 * dt * (nodes + 1.0)
    integrands = (np.cos(u * t), np.sin(u * t), -t * np.sin(u * t), t * np.cos(u * t))
    expected = [float(0.5 * dt * weights @ integrand) for integrand in integrands]
    found = turn_by(u, dt)
    assert (found.cos, found.sin) == pytest.approx((math.cos(u * dt), math.sin(u * dt)), abs=5e-16)
    assert (found.s, found.c) == pytest.approx(expected[:2], abs=2e-15)
    # The series of the derivatives leave out two parts in 1e13.
    assert (found.s_by_u, found.c_by_u) == pytest.approx(expected[2:], abs=1e-12)
    same_bits(found, interpreted(turn_by)(u, dt))


@given(turns, st.floats(-0.5, -1e-3))
def test_a_swing_back_in_time_is_the_mirror_of_one_ahead(u: float, dt: float) -> None:
    back, ahead = swing(u, dt), swing(u, -dt)
    assert back == pytest.approx(
        (ahead.cos, -ahead.sin, -ahead.s, ahead.c, -ahead.s_by_u, ahead.c_by_u), abs=1e-15
    )
