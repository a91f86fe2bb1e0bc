from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.bounds.certified import Failed, Interval, certain_alpha1, certain_motion, window_ns
from formation.angles import FloatArray

EPS, A, SPEEDS = 1.5e-3, 0.07, (0.04, 0.1)


def moved(*rows: tuple[float, float]) -> FloatArray:
    return np.array(rows)


def test_the_worst_noise_and_turn_come_to_the_edge() -> None:
    """Straight positions that a difference over the best window misjudges as much as it ever can."""
    window = 2.0 * math.sqrt(EPS / A)
    found = certain_motion(
        np.array([window]), moved((0.08 * window, 0.0)), np.array([2.0 * EPS]), A, (0.0, 1.0)
    )
    assert not isinstance(found, Failed)
    assert found.speed.half == pytest.approx(2.0 * math.sqrt(EPS * A))
    assert found.direction.half == pytest.approx(math.asin(found.speed.half / 0.08))


@pytest.mark.parametrize(
    ("back", "rows", "expected"),
    [
        ([], np.empty((0, 2)), Failed.GAP),
        ([0.1], moved((0.5, 0.0)), Failed.NOISE),
        ([0.4], moved((0.0, 0.001)), Failed.SLOW),
        # Within 0.6 s the leader cannot have turned round.
        ([0.2, 0.6], moved((0.018, 0.0), (-0.05, 0.0)), Failed.ACCELERATION),
    ],
)
def test_it_is_told_which_assumption_fails(back: list[float], rows: FloatArray, expected: Failed) -> None:
    assert certain_motion(np.array(back), rows, np.full(len(back), 2.0 * EPS), A, SPEEDS) is expected


def test_a_displacement_of_nothing_has_no_direction() -> None:
    """Positions in whole millimetres repeat; what shows where the leader drives are then the older ones."""
    back, rows = np.array([0.5, 0.1]), moved((-0.006, 0.008), (0.0, 0.0))
    found = certain_motion(back, rows, np.full(2, 1e-3), 0.05, (0.001, 0.3))
    assert not isinstance(found, Failed)
    assert found.direction.centre == pytest.approx(math.atan2(0.8, -0.6))
    assert found.direction.half < 0.5 * math.pi


def test_radius_is_the_distance_to_the_farthest_possible_value() -> None:
    assert Interval(1.0, 0.5).radius(2.0) == pytest.approx(1.5)
    assert Interval(3.1, 0.1).radius(-3.1, on_circle=True) == pytest.approx(0.1 + 2.0 * math.pi - 6.2)
    assert Interval(0.0, math.pi).radius(1.0, on_circle=True) == math.pi


def test_alpha1_is_as_uncertain_as_direction_and_line_together() -> None:
    found = certain_alpha1(Interval(3.0, 0.2), Interval(-3.0, 0.1))
    assert found.centre == pytest.approx(2.0 * math.pi - 6.0)
    assert found.half == pytest.approx(0.3)
    assert certain_alpha1(Interval(0.0, 2.0), Interval(0.0, 2.0)).half == math.pi


def test_a_window_holds_a_few_steps_of_a_slow_sensor() -> None:
    assert window_ns(0.2, 0.01) == 300_000_000
    assert window_ns(0.2, 0.5) == 1_500_000_000
