"""Commands in the steps that a robot's link can carry, without losing on average what lies between them.

A link that truncates every command toward zero makes the robot slower than it was told, by half a step on
average. Who knows the step sends whole steps, and adds what rounding left to the next command (first-order
error feedback): the mean of what is sent is then that of what was wanted, and the robot's inertia does the
averaging. It also knows what the robot really got, which a prediction needs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from controllers.limits import Limits
from formation.kernel import kernel
from formation.pose import STANDSTILL, Motion

NO_REMAINDER = STANDSTILL

_HAIR = 1e-6
"""Share of a step by which a command exceeds whole steps: 0.29 / 0.01 is less than 29 in binary fractions,
and a link that truncates would take a whole step off."""
_FINEST = 2.0**40
"""More steps than this within a limit are not told from none: the hair alone would be of their size."""


class Steps(NamedTuple):
    """Steps of speed v [m/s] and turn rate u [rad/s] that the robot's link carries; 0 for any value."""

    v: float
    u: float


class InSteps(NamedTuple):
    """A value in whole steps, and what that leaves of it."""

    value: float
    remainder: float


class Rounded(NamedTuple):
    """A command in whole steps, and the rounding remainder that it leaves to the next one."""

    sent: Motion
    remainder: Motion


@kernel
def in_steps(value: float, step: float, bound: float) -> InSteps:
    """Whole steps of ``step`` within ``bound`` that come nearest to ``value``, which is finite."""
    if step <= 0.0 or bound > _FINEST * step:
        return InSteps(value, 0.0)
    most = float(math.floor(bound / step + _HAIR))
    whole = value / step + 0.5
    steps = max(-most, min(most, float(math.floor(max(-most - 1.0, min(most + 1.0, whole))))))
    rest = max(-0.5 * step, min(0.5 * step, value - steps * step))
    hair = math.copysign(_HAIR, steps) if steps != 0.0 else 0.0
    return InSteps(max(-bound, min(bound, (steps + hair) * step)), rest)


@kernel
def rounded(wanted: Motion, remainder: Motion, steps: Steps, v_max: float, u_max: float) -> Rounded:
    """Command in whole steps within the limits, and what it leaves to the next one.

    ``wanted`` is finite and within the limits; ``remainder`` is what the command before left, and never more
    than half a step.
    """
    v = in_steps(wanted.v + remainder.v, steps.v, v_max)
    u = in_steps(wanted.u + remainder.u, steps.u, u_max)
    return Rounded(Motion(v.value, u.value), Motion(v.remainder, u.remainder))


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

    @property
    def steps(self) -> Steps:
        """The numbers for :func:`rounded`."""
        return Steps(self.v, self.u)

    def round(self, wanted: Motion, remainder: Motion, limits: Limits) -> Rounded:
        """Command in whole steps within the limits, as :func:`rounded` makes it."""
        return rounded(wanted, remainder, self.steps, limits.v_max, limits.u_max)
