"""Axes: wrong ones are found along the track."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.bridge.up_axis import HeightCheck, Up


def circle(up: Up, height: float = 0.1, radius: float = 0.3) -> list[tuple[float, float, float]]:
    """A robot's way round a circle on the ground."""
    angles = np.linspace(0.0, 2.0 * math.pi, 100)
    ground = [
        (radius * math.cos(a), radius * math.sin(a), height + 0.001 * math.sin(7.0 * a)) for a in angles
    ]
    return [(x, y, z) if up == "z" else (x, z, -y) for x, y, z in ground]


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
