"""Commands in the steps that a robot's link can carry, without losing on average what lies between them.

A link that truncates every command toward zero makes the robot slower than it was told, by half a step on
average. Who knows the step sends whole steps, and adds what rounding left to the next command (first-order
error feedback): the mean of what is sent is then that of what was wanted, and the robot's inertia does the
averaging. It also knows what the robot really got, which a prediction needs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from controllers.limits import Limits
from formation.pose import STANDSTILL, Motion

_HAIR = 1e-6
"""Share of a step by which a command exceeds whole steps: 0.29 / 0.01 is less than 29 in binary fractions,
and a link that truncates would take a whole step off."""


@dataclass(frozen=True, slots=True)
class Resolution:
    """Steps of speed v [m/s] and turn rate u [rad/s] that the robot's link carries; 0 for any value.

    Raises :class:`ValueError` unless both are finite and not negative.
    """

    v: float = 0.0
    u: float = 0.0

    def __post_init__(self) -> None:
        for name, value in (("v", self.v), ("u", self.u)):
            if not (value >= 0.0 and math.isfinite(value)):
                raise ValueError(f"{name} is {value}, expected a finite number of 0 or more")

    def round(self, wanted: Motion, owed: Motion, limits: Limits) -> tuple[Motion, Motion]:
        """Command in whole steps within the limits, and what it owes to the next one.

        ``wanted`` is finite and within the limits; ``owed`` is what the command before left, and never more
        than half a step.
        """
        v, rest_v = _in_steps(wanted.v + owed.v, self.v, limits.v_max)
        u, rest_u = _in_steps(wanted.u + owed.u, self.u, limits.u_max)
        return Motion(v, u), Motion(rest_v, rest_u)


NOTHING_OWED = STANDSTILL


def _in_steps(value: float, step: float, bound: float) -> tuple[float, float]:
    if step <= 0.0:
        return value, 0.0
    most = math.floor(bound / step + _HAIR)
    steps = max(-most, min(most, math.floor(value / step + 0.5)))
    rest = max(-0.5 * step, min(0.5 * step, value - steps * step))
    hair = math.copysign(_HAIR, steps) if steps else 0.0
    return max(-bound, min(bound, (steps + hair) * step)), rest
