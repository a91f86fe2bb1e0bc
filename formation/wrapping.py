"""One angle, wrapped into (-pi, pi]."""

from __future__ import annotations

import math

from formation.kernel import kernel

_TURN = 2.0 * math.pi


@kernel
def wrapped(angle: float) -> float:
    """Angle [rad] in (-pi, pi] that differs by whole turns, exactly; NaN for NaN and infinities."""
    if not math.isfinite(angle):
        return math.nan
    # Of a positive number the remainder is exact, as fmod's is, which compiled code does not have.
    turned = angle if abs(angle) < _TURN else math.copysign(abs(angle) % _TURN, angle)
    # Both shifts are exact: the operands are within a factor of two of each other (Sterbenz).
    if turned > math.pi:
        turned = turned - _TURN
    return turned + _TURN if turned <= -math.pi else turned
