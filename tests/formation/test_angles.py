from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from formation.angles import wrap

angles = st.floats(-1e12, 1e12)


@given(angles)
@example(math.pi)
@example(-math.pi)
@example(3.0 * math.pi)
@example(math.nextafter(math.pi, 4.0))
@example(-1e-300)
@settings(deadline=None)
def test_wrapped_angle_is_in_range_and_whole_turns_away(angle: float) -> None:
    wrapped = wrap(angle)
    assert -math.pi < wrapped <= math.pi
    turns = (Fraction(angle) - Fraction(wrapped)) / Fraction(2.0 * math.pi)
    assert turns.denominator == 1


@given(st.floats(-math.pi, math.pi, exclude_min=True))
@settings(deadline=None)
def test_angle_in_range_is_not_touched(angle: float) -> None:
    assert wrap(angle) == angle


@given(st.lists(st.one_of(angles, st.sampled_from([math.pi, -math.pi, math.inf, -math.inf, math.nan]))))
@settings(deadline=None)
def test_arrays_and_floats_agree_to_the_bit(values: list[float]) -> None:
    np.testing.assert_array_equal(wrap(np.array(values)), np.array([wrap(value) for value in values]))


def test_arrays_keep_their_shape() -> None:
    assert wrap(np.full((2, 3), 7.0)).shape == (2, 3)


@pytest.mark.parametrize("angle", [math.nan, math.inf, -math.inf])
def test_what_is_no_angle_gives_nan(angle: float) -> None:
    assert math.isnan(wrap(angle))


def test_angles_that_are_in_range_come_back_as_another_array() -> None:
    angles = np.array([0.5, -3.0])
    found = wrap(angles)
    found += 1.0
    assert angles.tolist() == [0.5, -3.0]
