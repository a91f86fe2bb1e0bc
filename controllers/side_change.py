"""Changing sides while driving: from one station behind the leader's back to the other, then the law again.

Under the law of the other side the formation at hand is the saddle (V1 = 2), and alpha2 is where its steering
stands still: a bare switch of signs hangs there, or crosses the leader's bow. So the follower is led round.
In the leader's frame its place is q = rho (cos alpha1, sin alpha1), and the place it is led to moves along
the circle of radius rho_0 behind the leader, q* = rho_0 (cos phase, sin phase). With the velocity

    w = leader's velocity + u1 x q* + q*_dot + k (q* - q),

kept to, the error obeys (q* - q)_dot = -k (q* - q). The phase waits while the error exceeds :data:`SLACK`
rho_0, so the follower never comes closer than (1 - SLACK) rho_0 once it has been within that of its place.
Heading and speed go after w; the law takes over inside its proved region of attraction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from controllers.laws import Gains, Law
from controllers.limits import Limits
from formation.angles import wrap
from formation.pose import Motion
from formation.shape import Shape
from formation.spacing import lyapunov
from formation.station import Side, Station

SLACK = 0.3
"""Error [rho_0] beyond which the phase waits; from half of it on it slows down."""
PACE = 0.5
"""Speed of the place along its circle [v1]."""
CORRECTION = 0.4
"""Most that the correction may add to w [v1]: with the pace it leaves w a share ahead."""
_TAKEN_OVER_V1, _TAKEN_OVER_ANGLE = 0.5, 0.5


@dataclass(frozen=True, slots=True)
class SideChange:
    """Where a follower is on its way: its aim, the phase [rad] of its place, and whether the law drives."""

    station: Station
    phase: float
    arrived: bool = False


def gentle(v1: float, u1: float, gains: Gains) -> bool:
    """Whether a leader turns gently enough for a change: what is missing without its u1 can be outweighed."""
    return gains.spacing.rho_0 * abs(u1) <= CORRECTION * v1


def kept(gains: Gains) -> SideChange:
    """State of a follower that was never told to change: it is where its gains have it."""
    return SideChange(gains.station, gains.station.alpha1, arrived=True)


def change_to(side: Side, shape: Shape, gains: Gains) -> SideChange:
    """Begin to change to a side from the shape at hand, at the bearing of the station so far."""
    return SideChange(Station(side, gains.station.bearing), shape.alpha1)


def change_step(
    change: SideChange,
    shape: Shape,
    v1: float,
    u1: float,
    law: Law,
    gains: Gains,
    limits: Limits,
    dt: float,
) -> tuple[SideChange, Motion]:
    """State and wanted motion for the next dt [s]; once arrived the motion is the law's at the new station.

    The motion is not yet limited, as a law's.

    ``u1`` is the leader's turn rate, 0 where it isn't known: what is then missing acts as a disturbance of
    rho_0 u1, which the correction meets only up to :data:`CORRECTION` v1.
    """
    there = replace(gains, station=change.station)
    if change.arrived or _may_take_over(change, shape, gains):
        return replace(change, arrived=True), law(shape, v1, u1, there, limits)
    rho_0 = gains.spacing.rho_0
    place = (rho_0 * math.cos(change.phase), rho_0 * math.sin(change.phase))
    error_x = place[0] - shape.rho * math.cos(shape.alpha1)
    error_y = place[1] - shape.rho * math.sin(shape.alpha1)
    error = math.hypot(error_x, error_y)
    left = _way_left(change)
    # Faded out, not switched off: a bang-bang pace would make the commands chatter.
    share = min(1.0, max(0.0, 2.0 - 2.0 * error / (SLACK * rho_0)))
    pace = math.copysign(share * PACE * v1 / rho_0, left)
    moved = left if abs(left) <= abs(pace) * dt else pace * dt
    turning = u1 + moved / dt
    gain = min(gains.mu1, CORRECTION * v1 / error) if error > 0.0 else 0.0
    w_x = v1 - turning * place[1] + gain * error_x
    w_y = turning * place[0] + gain * error_y
    # Heading of the follower, and of w, from the leader's.
    heading = shape.alpha1 + math.pi - shape.alpha2
    aside = wrap(heading - math.atan2(w_y, w_x))
    wanted = Motion(math.hypot(w_x, w_y) * max(0.0, math.cos(aside)), u1 - gains.mu2 * aside)
    return replace(change, phase=wrap(change.phase + moved)), wanted


def _way_left(change: SideChange) -> float:
    """Angle from the phase to the station's alpha1, the way round that does not pass ahead of the leader."""
    phase, aim = change.phase % (2.0 * math.pi), change.station.alpha1 % (2.0 * math.pi)
    return aim - phase


def _may_take_over(change: SideChange, shape: Shape, gains: Gains) -> bool:
    if abs(wrap(shape.alpha2 - change.station.alpha2)) > _TAKEN_OVER_ANGLE:
        return False
    return lyapunov(shape, gains.spacing, change.station) < _TAKEN_OVER_V1
