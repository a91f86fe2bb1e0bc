"""The control laws of the paper: constant-bearing steering (4), speed laws (6) and (8).

All take the shape and the leader's speed as they are known to the follower, be it truth or estimate, and none
asks which. A law by name, :data:`LAWS`, pairs a speed law with the steering.

The paper writes them for a follower on the right, with the leader abeam. Here they hold for any
:class:`~formation.station.Station`, and give the paper's to the last bit on its own: cos(alpha1) becomes the
sine of the angle by which alpha1 is off, the restoring term takes the sign of the side, and what the speed
has to do across the line between the robots is divided by the share of it that goes there.
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
from formation.station import ABREAST, Station


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains mu1 [rad/s] of the bearing alpha1 and mu2 [rad/s] of alpha2, spacing functions, station, tilt.

    ``tilt`` [rad] is how far a follower that cannot drive as fast as it should may turn off the bearing of
    its station, towards a leader that is too far or away from one that is too near (see :func:`leaning`);
    0, as in the paper, not at all. Raises :class:`ValueError` unless mu1 and mu2 are positive and finite and
    tilt lies in [0, pi/2).
    """

    mu1: float
    mu2: float
    spacing: Spacing
    station: Station = ABREAST
    tilt: float = 0.0

    def __post_init__(self) -> None:
        for name, value in (("mu1", self.mu1), ("mu2", self.mu2)):
            if not (value > 0.0 and math.isfinite(value)):
                raise ValueError(f"{name} is {value}, expected a positive finite number")
        if not 0.0 <= self.tilt < 0.5 * math.pi:
            raise ValueError(f"tilt is {self.tilt}, expected an angle from 0 to below pi/2")


class Law(Protocol):
    """A named law: what the follower should drive."""

    def __call__(
        self, shape: Shape, v1: float, u1: float, gains: Gains, limits: Limits | None = None
    ) -> Motion:
        """Wanted motion, not yet limited; its turn rate suits the speed that ``limits`` will let through."""
        ...


def constant_bearing(shape: Shape, v1: float, v2: float, gains: Gains, leaning: float = 0.0) -> float:
    """Turn rate u2 that gives alpha2_dot = -mu2 sin(alpha2 - desired), Eq. (4) of the paper.

    The desired bearing is the station's less ``leaning`` [rad, towards the leader on the right-hand side];
    abreast on the right and without it, alpha2_dot = mu2 cos(alpha2). The law cancels the turning of the
    line between the robots, so v2 must be the speed that is really driven. The closed form is
    sin(alpha2(t)) = tanh(mu2 t + artanh(sin(alpha2(0)))) there. Needs rho > 0.
    """
    sin2, station = math.sin(shape.alpha2), gains.station
    line_rate = (v1 * math.sin(shape.alpha1) + v2 * sin2) / shape.rho
    cos2 = math.cos(shape.alpha2)
    away = sin2 * station.cos - cos2 * station.sin
    if leaning:
        away = away * math.cos(leaning) + (cos2 * station.cos + sin2 * station.sin) * math.sin(leaning)
    return gains.mu2 * away + line_rate


def ideal_speed(shape: Shape, v1: float, u1: float, gains: Gains) -> float:
    """Speed v2 of a follower that knows the leader's turn rate u1, Eq. (6) of the paper (Prop. 1)."""
    return independent_speed(shape, v1, gains) + shape.rho * u1 / gains.station.sin


def independent_speed(shape: Shape, v1: float, gains: Gains) -> float:
    """Speed v2 without the leader's turn rate, Eq. (8) of the paper (Prop. 2)."""
    station, sin1 = gains.station, math.sin(shape.alpha1)
    off = station.sin * math.cos(shape.alpha1) - station.cos * sin1
    correction = station.sign * v1 * gains.spacing.f(shape.rho) - gains.mu1 * off
    return (-v1 * sin1 + shape.rho * correction) / station.sin


def leaning(rho: float, wanted: float, driven: float, gains: Gains) -> float:
    """Angle [rad] to turn the desired bearing by when a speed limit leaves ``driven`` of ``wanted``.

    On the station's bearing a follower's speed acts across the line between the robots only: too slow a
    follower cannot shorten the line and has to wait until the leader's own way does it. Turned by an angle
    gamma it closes in with v2 sin(gamma). Here gamma is the tilt times the share of the speed that the limit
    takes, times f/mu_rho (within 1): zero where the limit does not bind or the distance is right, so that
    the paper's law and its stability are untouched there; else the closing speed has the sign of f, and its
    part in V1_dot, -f v2 sin(gamma), is never positive.
    """
    if wanted == driven or gains.tilt == 0.0:
        return 0.0
    pull = clip(gains.spacing.f(rho) / gains.spacing.mu_rho, 1.0)
    return gains.station.sign * gains.tilt * ((wanted - driven) / abs(wanted)) * pull


def ideal(shape: Shape, v1: float, u1: float, gains: Gains, limits: Limits | None = None) -> Motion:
    """Prop. 1: speed (6) and steering (4)."""
    return _steered(shape, v1, ideal_speed(shape, v1, u1, gains), gains, limits)


def independent(shape: Shape, v1: float, u1: float, gains: Gains, limits: Limits | None = None) -> Motion:
    """Prop. 2: speed (8) and steering (4). ``u1`` is not looked at."""
    return _steered(shape, v1, independent_speed(shape, v1, gains), gains, limits)


LAWS: Mapping[str, Law] = MappingProxyType(
    {"independent": independent, "ideal": ideal, "feedforward": ideal, "faded": ideal}
)
"""Laws by name. The last three are one, but for where u1 is from (:mod:`estimation.tracking.foresight`)."""


def _steered(shape: Shape, v1: float, v2: float, gains: Gains, limits: Limits | None) -> Motion:
    # The speed stays as wanted, so that whoever limits it sees that it had to; only (4) needs the driven one.
    driven = v2 if limits is None else clip(v2, limits.v_max)
    return Motion(v2, constant_bearing(shape, v1, driven, gains, leaning(shape.rho, v2, driven, gains)))
