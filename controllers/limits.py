"""Speed and turn-rate limits of a robot."""

from __future__ import annotations

import math
from dataclasses import dataclass

from formation.kernel import kernel
from formation.pose import Motion


@kernel
def clip(value: float, bound: float) -> float:
    """Nearest value to ``value`` in [-bound, bound]. NaN stays NaN: it must not turn into a limit."""
    if value > bound:
        return bound
    if value < -bound:
        return -bound
    return value


@kernel
def limited(wanted: Motion, v_max: float, u_max: float) -> Motion:
    """Speed and turn rate clipped, each on its own."""
    return Motion(clip(wanted.v, v_max), clip(wanted.u, u_max))


@kernel
def is_beyond(wanted: Motion, v_max: float, u_max: float) -> bool:
    """Whether speed or turn rate is beyond its limit."""
    return abs(wanted.v) > v_max or abs(wanted.u) > u_max


@kernel
def approached(wanted: Motion, before: Motion, v_step: float, u_step: float) -> Motion:
    """Wanted motion, but no further from the one before than a step of speed [m/s] and of turn rate [rad/s].

    Steps are not negative; an infinite one limits nothing.

    >>> approached(Motion(0.2, -1.0), Motion(0.1, 0.0), 0.05, math.inf)
    Motion(v=0.15000000000000002, u=-1.0)
    """
    return Motion(before.v + clip(wanted.v - before.v, v_step), before.u + clip(wanted.u - before.u, u_step))


@dataclass(frozen=True, slots=True)
class Limits:
    """Symmetric limits |v| <= v_max [m/s] and |u| <= u_max [rad/s].

    Raises :class:`ValueError` unless both are positive and finite.
    """

    v_max: float
    u_max: float

    def __post_init__(self) -> None:
        for name, value in (("v_max", self.v_max), ("u_max", self.u_max)):
            if not (value > 0.0 and math.isfinite(value)):
                raise ValueError(f"{name} is {value}, expected a positive finite number")

    def apply(self, wanted: Motion) -> tuple[Motion, bool]:
        """Clip speed and turn rate, each on its own; the flag says whether one was beyond its limit.

        An infinite value is clipped like any that is too large; NaN is passed on as NaN, for
        :func:`controllers.guard.decide` to refuse.
        """
        return limited(wanted, self.v_max, self.u_max), is_beyond(wanted, self.v_max, self.u_max)
