"""The spacing functions g and f that hold the distance, and the Lyapunov function built on g."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

from formation.angles import FloatArray
from formation.kernel import kernel
from formation.line import Line, line_of
from formation.shape import Shape
from formation.station import ABREAST, Station

Number = TypeVar("Number", float, FloatArray)


@kernel
def restoring(rho: Number, rho_0: float, mu_rho: float) -> Number:
    """Restoring term f(rho) [1/m] of Sec. IV-A of the paper. Needs rho > 0."""
    # Factored, so that the zero at rho_0 is exact and its surroundings lose no digits.
    return mu_rho * ((rho - rho_0) / rho) * ((rho + rho_0) / rho)


@kernel
def potential(rho: Number, rho_0: float, mu_rho: float) -> Number:
    """Potential g(rho), whose derivative f is. Needs rho > 0."""
    offset = rho - rho_0
    return mu_rho * offset * (offset / rho)


@kernel
def restoring_slope(rho: Number, rho_0: float, mu_rho: float) -> Number:
    """Slope f'(rho) [1/m^2]. Needs rho > 0."""
    ratio = rho_0 / rho
    return 2.0 * mu_rho * ratio * ratio / rho


@dataclass(frozen=True, slots=True)
class Spacing:
    """Spacing functions of Sec. IV-A of the paper for a desired distance rho_0 [m] and a gain mu_rho [1/m].

    f(rho) = mu_rho (rho^2 - rho_0^2) / rho^2 is the derivative of g, and g(rho_0) = 0. Both take rho > 0 as a
    float or an array. f grows with rho and stays below mu_rho, so that it can hold against a constant turn of
    the leader only up to mu_rho * v1. Raises :class:`ValueError` unless both constants are positive and
    finite.
    """

    rho_0: float
    mu_rho: float

    def __post_init__(self) -> None:
        for name, value in (("rho_0", self.rho_0), ("mu_rho", self.mu_rho)):
            if not (value > 0.0 and math.isfinite(value)):
                raise ValueError(f"{name} is {value}, expected a positive finite number")

    def f(self, rho: Number) -> Number:
        """Restoring term f [1/m]: negative when too close, positive when too far."""
        return restoring(rho, self.rho_0, self.mu_rho)

    def distance(self, pull: float) -> float:
        """Distance [m] at which f has the value ``pull`` [1/m], below mu_rho: the inverse of f.

        Behind a leader that turns at a constant u1 a pair under law (8) rests at alpha1 = -pi/2 and
        f(rho) = u1 / v1: with a follower on the right, the further out the harder it turns left.
        """
        return self.rho_0 / math.sqrt(1.0 - pull / self.mu_rho)

    def g(self, rho: Number) -> Number:
        """Potential g >= 0, without unit: g' = f, zero at rho_0 only, infinite at 0 and at infinity."""
        return potential(rho, self.rho_0, self.mu_rho)

    def f_prime(self, rho: Number) -> Number:
        """Slope of f [1/m^2]; positive everywhere."""
        return restoring_slope(rho, self.rho_0, self.mu_rho)


def lyapunov(shape: Shape, spacing: Spacing, station: Station = ABREAST) -> float:
    """V1 = 1 + sin(alpha1) + g(rho) of the proof of Prop. 1: zero only abreast at rho_0 on the right.

    V1 < 2 is the region of attraction that the proof covers; the true one is larger. For another station
    1 - cos of the angle by which alpha1 is off, and g weighted with the sine of the bearing.
    """
    return lyapunov_at(line_of(shape), station.cos, station.sin, spacing.rho_0, spacing.mu_rho)


@kernel
def lyapunov_at(line: Line, cos_b: float, sin_b: float, rho_0: float, mu_rho: float) -> float:
    """The same of a line, for the station of cosine and sine ``cos_b``, ``sin_b``."""
    aligned = line.cos1 * cos_b + line.sin1 * sin_b
    return 1.0 + aligned + abs(sin_b) * potential(line.rho, rho_0, mu_rho)
