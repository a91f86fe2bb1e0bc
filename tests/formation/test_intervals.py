from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.intervals import Interval, Slope, constant, exactly

NUMBERS = st.floats(-1e3, 1e3).filter(lambda x: x == 0.0 or abs(x) > 1e-6)
SHARES = st.floats(0.0, 1.0)


@st.composite
def within(draw: st.DrawFn, least: float = -1e3) -> tuple[Interval, Fraction]:
    """An interval, and a number in it that need not be a float."""
    a, b = sorted(max(draw(NUMBERS), least) for _ in range(2))
    part = Fraction(draw(SHARES))
    return Interval(np.array([a]), np.array([b])), Fraction(a) + part * (Fraction(b) - Fraction(a))


def holds(interval: Interval, number: Fraction) -> bool:
    return Fraction(float(interval.lo[0])) <= number <= Fraction(float(interval.hi[0]))


@given(within(), within())
def test_exact_results_lie_within(one: tuple[Interval, Fraction], other: tuple[Interval, Fraction]) -> None:
    (a, x), (b, y) = one, other
    assert holds(a + b, x + y)
    assert holds(a - b, x - y)
    assert holds(a * b, x * y)
    assert holds(-a, -x)


@given(within(), within(least=1e-3))
def test_an_exact_quotient_lies_within(
    one: tuple[Interval, Fraction], other: tuple[Interval, Fraction]
) -> None:
    (a, x), (b, y) = one, other
    assert holds(a / b, x / y)


@pytest.mark.parametrize("x", [0.1, 1.0 / 3.0, 12345.678])
def test_single_numbers_give_bounds_that_are_next_to_each_other(x: float) -> None:
    for found, number in (
        (exactly(x) + exactly(0.2), Fraction(x) + Fraction(0.2)),
        (exactly(x) * exactly(0.7), Fraction(x) * Fraction(0.7)),
        (exactly(x) / exactly(0.7), Fraction(x) / Fraction(0.7)),
    ):
        lo, hi = float(found.lo), float(found.hi)
        assert Fraction(lo) < number < Fraction(hi)
        assert hi - lo <= 6.0 * math.ulp(hi)


def test_a_divisor_that_may_be_zero_is_refused() -> None:
    with pytest.raises(ZeroDivisionError, match="positive"):
        exactly(1.0) / Interval(np.array([0.0]), np.array([1.0]))


@given(st.floats(-9.0, 9.0), st.floats(0.0, 7.0))
def test_sine_and_cosine_hold_all_values_and_little_more(lo: float, width: float) -> None:
    angles: np.ndarray = np.linspace(lo, lo + width, 2001)
    turning = 0.5 * math.pi * np.arange(-6, 13)
    angles = np.append(angles, turning[(turning > lo) & (turning < lo + width)])
    interval = Interval(np.array([lo]), np.array([lo + width]))
    for found, values in ((interval.sin(), np.sin(angles)), (interval.cos(), np.cos(angles))):
        assert found.lo[0] < values.min() or found.lo[0] == -1.0
        assert found.hi[0] > values.max() or found.hi[0] == 1.0
        # A turning point a hair's breadth beyond an end may count as within.
        assert found.lo[0] > values.min() - 1e-11
        assert found.hi[0] < values.max() + 1e-11


def test_slopes_follow_the_rules_of_derivatives() -> None:
    """Against complex steps, at points; and over a box the derivatives at its points lie within."""

    def by_complex(p: complex, q: complex) -> complex:
        return complex(np.sin(p * q) * p - np.cos(q) * (p + q * p))

    def by_slopes(p: Slope, q: Slope) -> Slope:
        return (p * q).sin() * p - q.cos() * (p + q * p)

    zero, one, random = exactly(0.0), exactly(1.0), np.random.default_rng(2)
    for p, q in random.uniform(-2.0, 2.0, (50, 2)).tolist():
        here = by_slopes(Slope(exactly(p), one, zero), Slope(exactly(q), zero, one))
        box = [Interval(np.array(x - 0.01), np.array(x + 0.01)) for x in (p, q)]
        over = by_slopes(Slope(box[0], one, zero), Slope(box[1], zero, one))
        wanted = (
            by_complex(p, q).real,
            by_complex(p + 1e-30j, q).imag / 1e-30,
            by_complex(p, q + 1e-30j).imag / 1e-30,
        )
        for part, value in zip((here.value, here.d1, here.d2), wanted, strict=True):
            assert float(part.lo) - 1e-12 <= value <= float(part.hi) + 1e-12
            assert float(part.hi) - float(part.lo) < 1e-12
        for part, value in zip((over.value, over.d1, over.d2), wanted, strict=True):
            assert float(part.lo) < value < float(part.hi)


def test_a_constant_has_no_slope() -> None:
    found = constant(exactly(3.0))
    assert [float(part.lo) for part in (found.value, found.d1, found.d2)] == [3.0, 0.0, 0.0]
