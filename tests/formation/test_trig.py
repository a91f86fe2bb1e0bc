"""Sine and cosine together against the C library's."""

from __future__ import annotations

import math

from hypothesis import example, given
from hypothesis import strategies as st

from formation.kernel import entry, interpreted, kernel
from formation.pose import Motion
from formation.trig import sine_and_cosine
from tests.bits import same_bits


@kernel
def both(angle: float) -> Motion:
    sine, cosine = sine_and_cosine(angle)
    return Motion(sine, cosine)


@entry
def compiled(angle: float) -> Motion:
    return both(angle)


@given(st.one_of(st.floats(-8.0, 8.0), st.floats(-9e5, 9e5)))
@example(0.25 * math.pi)
@example(-0.5 * math.pi)
@example(math.pi)
@example(9e5)
def test_both_are_good_to_the_last_bit_but_one(angle: float) -> None:
    sine, cosine = sine_and_cosine(angle)
    assert abs(sine - math.sin(angle)) <= 2.3e-16
    assert abs(cosine - math.cos(angle)) <= 2.3e-16


@given(st.floats())
def test_compiled_and_interpreted_are_the_same(angle: float) -> None:
    same_bits(compiled(angle), interpreted(compiled)(angle))


@given(st.one_of(st.just(math.nan), st.floats(min_value=1e6), st.floats(max_value=-1e6)))
def test_what_is_too_far_round_has_none(angle: float) -> None:
    assert all(map(math.isnan, sine_and_cosine(angle)))
