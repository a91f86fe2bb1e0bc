"""Axes: turned there and back, as a rotation turns them, and wrong ones found along the track."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hil.bridge.up_axis import HeightCheck, Up, turned_orientation, turned_position

NUMBER = st.floats(-10.0, 10.0)
UNIT = st.tuples(NUMBER, NUMBER, NUMBER, NUMBER).filter(lambda q: math.hypot(*q) > 0.1)
TO_Z_UP = Rotation.from_euler("x", 90, degrees=True)


@given(st.tuples(NUMBER, NUMBER, NUMBER), UNIT)
def test_y_up_becomes_z_up_by_a_quarter_turn_about_x(
    position: tuple[float, float, float], quaternion: tuple[float, float, float, float]
) -> None:
    assert np.allclose(turned_position(position, "y", "z"), TO_Z_UP.apply(position))
    expected = TO_Z_UP * Rotation.from_quat(quaternion) * TO_Z_UP.inv()
    turned = Rotation.from_quat(turned_orientation(quaternion, "y", "z"))
    assert (turned * expected.inv()).magnitude() < 1e-6


@given(st.tuples(NUMBER, NUMBER, NUMBER), UNIT, st.sampled_from([("y", "z"), ("z", "y"), ("z", "z")]))
def test_there_and_back_is_where_it_was(
    position: tuple[float, float, float], quaternion: tuple[float, float, float, float], axes: tuple[Up, Up]
) -> None:
    given_up, wanted = axes
    assert turned_position(turned_position(position, given_up, wanted), wanted, given_up) == position
    there = turned_orientation(quaternion, given_up, wanted)
    assert turned_orientation(there, wanted, given_up) == quaternion


def circle(up: Up, height: float = 0.1, radius: float = 0.3) -> list[tuple[float, float, float]]:
    """A robot's way round a circle on the ground."""
    angles = np.linspace(0.0, 2.0 * math.pi, 100)
    ground = [
        (radius * math.cos(a), radius * math.sin(a), height + 0.001 * math.sin(7.0 * a)) for a in angles
    ]
    return [turned_position(point, "z", up) for point in ground]


@pytest.mark.parametrize("streamed", ["y", "z"])
@pytest.mark.parametrize("told", ["y", "z"])
def test_a_robot_that_climbs_tells_that_the_axis_is_wrong(streamed: Up, told: Up) -> None:
    check = HeightCheck(told)
    for point in circle(streamed):
        check.see("leader", point)
    assert bool(check.wrong) == (streamed != told)
    if check.wrong:
        assert f"along {told}, which is to point up" in check.wrong


def test_what_stands_is_lifted_or_drives_along_x_tells_nothing() -> None:
    for move in (
        lambda t: (0.0, 0.0, 0.1),
        lambda t: (0.3 * t, 0.5 * t, 0.4 * t),
        lambda t: (2.0 * t, 0.0, 0.1),
    ):
        check = HeightCheck("z")
        for t in np.linspace(0.0, 3.0, 50):
            check.see("leader", move(float(t)))
        assert check.wrong == ""


def test_what_was_wrong_is_so_until_a_track_shows_otherwise() -> None:
    check = HeightCheck("z")
    for point in circle("y"):
        check.see("leader", point)
    assert check.wrong
    for point in circle("z"):
        check.see("follower", point)
    assert check.wrong == ""
