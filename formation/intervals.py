"""Interval arithmetic on arrays: bounds that rounding cannot get past.

Every result is widened to the next number outwards, so that what holds of the bounds holds of the exact
values.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray

# numpy promises sin and cos to 4 units in the last place, which is at most 2^-52 near 1.
_TRIG = 2.0**-49
_TURN = 2.0 * math.pi
# By how much multiples of pi in floating point may be off, for angles of a few turns.
_PLACE = 1e-12


def _down(values: FloatArray) -> FloatArray:
    return np.nextafter(values, -np.inf)


def _up(values: FloatArray) -> FloatArray:
    return np.nextafter(values, np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class Interval:
    """All numbers from ``lo`` to ``hi``, element by element; arrays of one shape, or that broadcast."""

    lo: FloatArray
    hi: FloatArray

    def __add__(self, other: Interval) -> Interval:
        return Interval(_down(self.lo + other.lo), _up(self.hi + other.hi))

    def __sub__(self, other: Interval) -> Interval:
        return Interval(_down(self.lo - other.hi), _up(self.hi - other.lo))

    def __neg__(self) -> Interval:
        return Interval(-self.hi, -self.lo)

    def __mul__(self, other: Interval) -> Interval:
        a, b = self.lo * other.lo, self.lo * other.hi
        c, d = self.hi * other.lo, self.hi * other.hi
        lowest = np.minimum(np.minimum(a, b), np.minimum(c, d))
        highest = np.maximum(np.maximum(a, b), np.maximum(c, d))
        return Interval(_down(lowest), _up(highest))

    def __truediv__(self, other: Interval) -> Interval:
        """Needs a divisor that is positive throughout."""
        if np.any(other.lo <= 0.0):
            raise ZeroDivisionError("the divisor must be positive throughout")
        return self * Interval(_down(1.0 / other.hi), _up(1.0 / other.lo))

    def sin(self) -> Interval:
        """The sine, for angles of a few turns."""
        at_lo, at_hi = np.sin(self.lo), np.sin(self.hi)
        lowest, highest = np.minimum(at_lo, at_hi) - _TRIG, np.maximum(at_lo, at_hi) + _TRIG
        lowest = np.where(self._meets(-0.25 * _TURN), -1.0, lowest)
        highest = np.where(self._meets(0.25 * _TURN), 1.0, highest)
        return Interval(np.maximum(lowest, -1.0), np.minimum(highest, 1.0))

    def cos(self) -> Interval:
        """The cosine, for angles of a few turns."""
        at_lo, at_hi = np.cos(self.lo), np.cos(self.hi)
        lowest, highest = np.minimum(at_lo, at_hi) - _TRIG, np.maximum(at_lo, at_hi) + _TRIG
        lowest = np.where(self._meets(0.5 * _TURN), -1.0, lowest)
        highest = np.where(self._meets(0.0), 1.0, highest)
        return Interval(np.maximum(lowest, -1.0), np.minimum(highest, 1.0))

    def _meets(self, angle: float) -> NDArray[np.bool_]:
        """Whether the angle, or one some turns from it, may lie within."""
        first = np.ceil((self.lo - _PLACE - angle) / _TURN)
        met: NDArray[np.bool_] = first * _TURN + angle <= self.hi + _PLACE
        return met


def exactly(value: float | FloatArray) -> Interval:
    """The interval of one number, or of one number each."""
    array = np.asarray(value, dtype=np.float64)
    return Interval(array, array)


@dataclass(frozen=True, slots=True, eq=False)
class Slope:
    """A function of two variables and its derivatives ``d1``, ``d2`` by them, each within an interval."""

    value: Interval
    d1: Interval
    d2: Interval

    def __add__(self, other: Slope) -> Slope:
        return Slope(self.value + other.value, self.d1 + other.d1, self.d2 + other.d2)

    def __sub__(self, other: Slope) -> Slope:
        return Slope(self.value - other.value, self.d1 - other.d1, self.d2 - other.d2)

    def __mul__(self, other: Slope) -> Slope:
        return Slope(
            self.value * other.value,
            self.value * other.d1 + self.d1 * other.value,
            self.value * other.d2 + self.d2 * other.value,
        )

    def sin(self) -> Slope:
        """The sine."""
        cosine = self.value.cos()
        return Slope(self.value.sin(), cosine * self.d1, cosine * self.d2)

    def cos(self) -> Slope:
        """The cosine."""
        sine = -self.value.sin()
        return Slope(self.value.cos(), sine * self.d1, sine * self.d2)


def constant(value: Interval) -> Slope:
    """A function that depends on neither variable."""
    zero = exactly(0.0)
    return Slope(value, zero, zero)
