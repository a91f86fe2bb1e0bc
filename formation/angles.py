"""Angles on the circle, represented in (-pi, pi]."""

from __future__ import annotations

import math
from typing import overload

import numpy as np
from numpy.typing import NDArray

from formation.wrapping import wrapped

FloatArray = NDArray[np.float64]

_TURN = 2.0 * math.pi


@overload
def wrap(angle: float) -> float: ...
@overload
def wrap(angle: FloatArray) -> FloatArray: ...
def wrap(angle: float | FloatArray) -> float | FloatArray:
    """Return the angle [rad] that differs from ``angle`` by whole turns and lies in (-pi, pi].

    Takes a float or an array of any shape. The reduction is exact for the floating-point turn (no error that
    grows with the number of turns), and an angle that is already in range comes back bit for bit. NaN and
    infinities give NaN.
    """
    if isinstance(angle, np.ndarray):
        return _wrap_array(angle)
    return wrapped(angle)


def _wrap_array(angle: FloatArray) -> FloatArray:
    largest = np.abs(angle).max(initial=0.0)
    if largest < math.pi:
        return angle.copy()
    turned = angle
    if not largest < _TURN:  # else the remainder would change nothing, and takes its time
        with np.errstate(invalid="ignore"):
            turned = np.fmod(angle, _TURN)
    # Both shifts are exact: the operands are within a factor of two of each other (Sterbenz).
    turned = np.where(turned > math.pi, turned - _TURN, turned)
    return np.where(turned <= -math.pi, turned + _TURN, turned)
