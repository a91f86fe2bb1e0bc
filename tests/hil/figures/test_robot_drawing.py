from __future__ import annotations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from formation.angles import FloatArray
from hil.figures.robot_drawing import draw_pair


def line(t: FloatArray, y: float, speed: float) -> FloatArray:
    return np.column_stack([speed * t, np.full(len(t), y), np.zeros(len(t))])


def pair(t: FloatArray, speed: float = 0.1) -> Axes:
    axes = Figure().add_subplot()
    draw_pair(axes, t, line(t, 0.0, speed), line(t, -0.2, speed))
    return axes


def moments(axes: Axes) -> list[str]:
    return [text.get_text() for text in axes.texts]


@pytest.mark.parametrize(
    ("first", "last", "expected"),
    [
        (0.0, 30.0, ["0 s", "5 s", "10 s", "15 s", "20 s", "25 s", "30 s"]),
        (0.02, 20.06, ["0 s", "5 s", "10 s", "15 s", "20 s"]),
        (0.0, 3.0, ["0 s", "0.5 s", "1 s", "1.5 s", "2 s", "2.5 s", "3 s"]),
        (7.0, 7.0, ["7 s"]),
    ],
)
def test_robots_stand_at_round_moments(first: float, last: float, expected: list[str]) -> None:
    assert moments(pair(np.linspace(first, last, 301))) == expected


def test_robots_have_their_true_size_where_it_can_be_seen() -> None:
    bodies = [patch for patch in pair(np.linspace(0.0, 20.0, 201)).patches if isinstance(patch, Circle)]
    assert {body.radius for body in bodies} == {0.069}
    far = [patch for patch in pair(np.linspace(0.0, 20.0, 201), 5.0).patches if isinstance(patch, Circle)]
    assert min(body.radius for body in far) == pytest.approx(0.5 * 0.05 * 100.0)


def test_unknown_poses_are_gaps() -> None:
    t = np.linspace(0.0, 10.0, 101)
    leader = line(t, 0.0, 0.1)
    leader[:30] = np.nan
    axes = Figure().add_subplot()
    draw_pair(axes, t, leader, line(t, -0.2, 0.1))
    assert moments(axes) == ["3 s", "4 s", "5 s", "6 s", "7 s", "8 s", "9 s", "10 s"]
    for patch in axes.patches:
        assert np.all(np.isfinite(patch.get_path().vertices))
