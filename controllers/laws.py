"""The control laws of the paper: constant-bearing steering (4), speed laws (6) and (8).

All take the shape and the leader's speed as they are known to the follower, be it truth or estimate, and none
asks which. A law by name, :data:`LAWS`, pairs a speed law with the steering.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

from controllers.limits import Limits, clip
from formation.pose import Motion
from formation.shape import Shape
from formation.spacing import Spacing


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains mu1 [rad/s] of the bearing alpha1 and mu2 [rad/s] of alpha2, and the spacing functions.

    Raises :class:`ValueError` unless mu1 and mu2 are positive and finite.
    """

    mu1: float
    mu2: float
    spacing: Spacing

    def __post_init__(self) -> None:
        for name, value in (("mu1", self.mu1), ("mu2", self.mu2)):
            if not (value > 0.0 and math.isfinite(value)):
                raise ValueError(f"{name} is {value}, expected a positive finite number")


class Law(Protocol):
    """A named law: what the follower should drive."""

    def __call__(
        self, shape: Shape, v1: float, u1: float, gains: Gains, limits: Limits | None = None
    ) -> Motion:
        """Wanted motion, not yet limited; its turn rate suits the speed that ``limits`` will let through."""
        ...


def constant_bearing(shape: Shape, v1: float, v2: float, gains: Gains) -> float:
    """Turn rate u2 that gives alpha2_dot = mu2 cos(alpha2), Eq. (4) of the paper.

    It cancels the turning of the line between the robots, so v2 must be the speed that is really driven. The
    closed form is sin(alpha2(t)) = tanh(mu2 t + artanh(sin(alpha2(0)))). Needs rho > 0.
    """
    line_rate = (v1 * math.sin(shape.alpha1) + v2 * math.sin(shape.alpha2)) / shape.rho
    return -gains.mu2 * math.cos(shape.alpha2) + line_rate


def ideal_speed(shape: Shape, v1: float, u1: float, gains: Gains) -> float:
    """Speed v2 of a follower that knows the leader's turn rate u1, Eq. (6) of the paper (Prop. 1)."""
    return independent_speed(shape, v1, gains) + shape.rho * u1


def independent_speed(shape: Shape, v1: float, gains: Gains) -> float:
    """Speed v2 without the leader's turn rate, Eq. (8) of the paper (Prop. 2)."""
    correction = v1 * gains.spacing.f(shape.rho) - gains.mu1 * math.cos(shape.alpha1)
    return -v1 * math.sin(shape.alpha1) + shape.rho * correction


def ideal(shape: Shape, v1: float, u1: float, gains: Gains, limits: Limits | None = None) -> Motion:
    """Prop. 1: speed (6) and steering (4)."""
    return _steered(shape, v1, ideal_speed(shape, v1, u1, gains), gains, limits)


def independent(shape: Shape, v1: float, u1: float, gains: Gains, limits: Limits | None = None) -> Motion:
    """Prop. 2: speed (8) and steering (4). ``u1`` is not looked at."""
    return _steered(shape, v1, independent_speed(shape, v1, gains), gains, limits)


LAWS: Mapping[str, Law] = MappingProxyType({"independent": independent, "ideal": ideal})


def _steered(shape: Shape, v1: float, v2: float, gains: Gains, limits: Limits | None) -> Motion:
    # The speed stays as wanted, so that whoever limits it sees that it had to; only (4) needs the driven one.
    driven = v2 if limits is None else clip(v2, limits.v_max)
    return Motion(v2, constant_bearing(shape, v1, driven, gains))
