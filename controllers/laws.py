"""The control laws of the paper: constant-bearing steering (4), speed laws (6) and (8).

All take the shape and the leader's speed as they are known to the follower, be it truth or estimate; none
asks which. There is one law, :func:`law`: (6) is (8) with the leader's turn rate, (8) is (6) with 0 in its
place. :data:`LAWS` has it by the names that scenarios use.

The paper writes it for a follower on the right, with the leader abeam. Here it holds for any
:class:`~formation.station.Station`, and gives the paper's to the last bit on its own: cos(alpha1) becomes the
sine of the angle by which alpha1 is off, the restoring term takes the sign of the side, and what the speed
has to do across the line between the robots is divided by the share of it that goes there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple, Protocol

from controllers.limits import Limits, clip
from controllers.own_law import OwnLaw, asked_law
from formation.address import NOWHERE, Address
from formation.kernel import kernel
from formation.line import Line, line_of
from formation.pose import Motion
from formation.shape import Shape
from formation.spacing import Spacing, restoring
from formation.station import ABREAST, Station


class LawSettings(NamedTuple):
    """All numbers that the law rests on, as :meth:`Gains.settings` makes them.

    Gains mu1, mu2 [rad/s], spacing rho_0 [m] and mu_rho [1/m]; ``cos_b``, ``sin_b`` and
    ``sign`` as a :class:`~formation.station.Station` has them; tilt [rad]; limits v_max [m/s] and u_max
    [rad/s], infinite for none. ``own``: where a law of one's own is, in place of (4), (6) and (8).
    """

    mu1: float
    mu2: float
    rho_0: float
    mu_rho: float
    cos_b: float
    sin_b: float
    sign: float
    tilt: float
    v_max: float
    u_max: float
    own: Address


@kernel
def law(settings: LawSettings, line: Line, v1: float, u1: float) -> Motion:
    """Wanted motion, not yet limited: speed (6), and steering (4) for the speed that the limit lets through.

    ``u1`` is the leader's turn rate [rad/s] to feed forward; 0 makes (8) of (6). Needs rho > 0 (or NaN, which
    shows in the result). A law of one's own is asked in their place, if there is one.
    """
    if settings.own.function != 0:
        return asked_law(settings.own, settings.sign, line, v1, u1)
    # The speed stays as wanted, so that whoever limits it sees that it had to; only (4) needs the driven one.
    wanted = speed(settings, line, v1, u1)
    driven = clip(wanted, settings.v_max)
    return Motion(wanted, steering(settings, line, v1, driven, lean(settings, line.rho, wanted, driven)))


@kernel
def speed(settings: LawSettings, line: Line, v1: float, u1: float) -> float:
    """Speed v2 [m/s] of (6), of (8) for u1 = 0."""
    off = settings.sin_b * line.cos1 - settings.cos_b * line.sin1
    pull = restoring(line.rho, settings.rho_0, settings.mu_rho)
    correction = settings.sign * v1 * pull - settings.mu1 * off
    return (-v1 * line.sin1 + line.rho * correction) / settings.sin_b + line.rho * u1 / settings.sin_b


@kernel
def steering(settings: LawSettings, line: Line, v1: float, v2: float, leaning: float) -> float:
    """Turn rate u2 [rad/s] of (4) while v2 is driven; see :func:`constant_bearing`."""
    line_rate = (v1 * line.sin1 + v2 * line.sin2) / line.rho
    away = line.sin2 * settings.cos_b - line.cos2 * settings.sin_b
    if leaning != 0.0:
        along = line.cos2 * settings.cos_b + line.sin2 * settings.sin_b
        away = away * math.cos(leaning) + along * math.sin(leaning)
    return settings.mu2 * away + line_rate


@kernel
def lean(settings: LawSettings, rho: float, wanted: float, driven: float) -> float:
    """Angle [rad] to turn the desired bearing by when a speed limit leaves ``driven`` of ``wanted``.

    On the station's bearing a follower's speed acts across the line between the robots only: too slow a
    follower cannot shorten the line and has to wait until the leader's own way does it. Turned by an angle
    gamma it closes in with v2 sin(gamma). Here gamma is the tilt times the share of the speed that the limit
    takes, times f/mu_rho (within 1): zero where the limit does not bind or the distance is right, so that
    the paper's law and its stability are untouched there; else the closing speed has the sign of f, and its
    part in V1_dot, -f v2 sin(gamma), is never positive.
    """
    if wanted == driven or settings.tilt == 0.0:
        return 0.0
    pull = clip(restoring(rho, settings.rho_0, settings.mu_rho) / settings.mu_rho, 1.0)
    return settings.sign * settings.tilt * ((wanted - driven) / abs(wanted)) * pull


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains mu1 [rad/s] of the bearing alpha1 and mu2 [rad/s] of alpha2, spacing functions, station, tilt.

    ``tilt`` [rad] is how far a follower that cannot drive as fast as it should may turn off the bearing of
    its station, towards a leader that is too far or away from one that is too near (see :func:`lean`);
    0, as in the paper, not at all. ``own``: a law of one's own, in place of the paper's. Raises
    :class:`ValueError` unless mu1 and mu2 are positive and finite and tilt lies in [0, pi/2).
    """

    mu1: float
    mu2: float
    spacing: Spacing
    station: Station = ABREAST
    tilt: float = 0.0
    own: OwnLaw | None = None

    def __post_init__(self) -> None:
        for name, value in (("mu1", self.mu1), ("mu2", self.mu2)):
            if not (value > 0.0 and math.isfinite(value)):
                raise ValueError(f"{name} is {value}, expected a positive finite number")
        if not 0.0 <= self.tilt < 0.5 * math.pi:
            raise ValueError(f"tilt is {self.tilt}, expected an angle from 0 to below pi/2")

    def settings(self, limits: Limits | None = None) -> LawSettings:
        """The numbers for :func:`law`, within ``limits`` if there are any."""
        spacing, station = self.spacing, self.station
        v_max, u_max = (math.inf, math.inf) if limits is None else (limits.v_max, limits.u_max)
        given = (self.mu1, self.mu2, spacing.mu_rho, spacing.rho_0, station.bearing, v_max, u_max)
        return LawSettings(
            self.mu1,
            self.mu2,
            spacing.rho_0,
            spacing.mu_rho,
            station.cos,
            station.sin,
            station.sign,
            self.tilt,
            v_max,
            u_max,
            NOWHERE if self.own is None else self.own.at(*given),
        )


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
    return steering(gains.settings(), line_of(shape), v1, v2, leaning)


def ideal_speed(shape: Shape, v1: float, u1: float, gains: Gains) -> float:
    """Speed v2 of a follower that knows the leader's turn rate u1, Eq. (6) of the paper (Prop. 1)."""
    return speed(gains.settings(), line_of(shape), v1, u1)


def independent_speed(shape: Shape, v1: float, gains: Gains) -> float:
    """Speed v2 without the leader's turn rate, Eq. (8) of the paper (Prop. 2)."""
    return speed(gains.settings(), line_of(shape), v1, 0.0)


def ideal(shape: Shape, v1: float, u1: float, gains: Gains, limits: Limits | None = None) -> Motion:
    """Prop. 1: speed (6) and steering (4)."""
    return law(gains.settings(limits), line_of(shape), v1, u1)


def independent(shape: Shape, v1: float, u1: float, gains: Gains, limits: Limits | None = None) -> Motion:
    """Prop. 2: speed (8) and steering (4). ``u1`` is not looked at."""
    return law(gains.settings(limits), line_of(shape), v1, 0.0)


LAWS: Mapping[str, Law] = MappingProxyType(
    {"independent": independent, "ideal": ideal, "feedforward": ideal, "faded": ideal}
)
"""Laws by name. The last three differ in where u1 is from: :mod:`estimation.tracking.turn_prediction`."""
