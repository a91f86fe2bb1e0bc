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
from typing import NamedTuple

from controllers.laws import Gains, LawSettings, law
from formation.kernel import kernel
from formation.line import Line
from formation.pose import Motion
from formation.spacing import lyapunov_at
from formation.station import Side, Station
from formation.wrapping import wrapped

SLACK = 0.3
"""Error [rho_0] beyond which the phase waits; from half of it on it slows down."""
PACE = 0.5
"""Speed of the place along its circle [v1]."""
CORRECTION = 0.4
"""Most that the correction may add to w [v1]: with the pace it leaves w a share ahead."""
_TAKEN_OVER_V1, _TAKEN_OVER_ANGLE = 0.5, 0.5
_TURN = 2.0 * math.pi


class SideChange(NamedTuple):
    """Where a follower is on its way: the side it goes to, the phase of its place, whether the law drives.

    ``sign``: of the side, as in :class:`~formation.station.Station`. ``phase`` [rad] in [-pi, pi].
    """

    sign: float
    phase: float
    arrived: bool

    @property
    def side(self) -> Side:
        """The side that it goes to, or is on."""
        return Side.of(self.sign)


class Led(NamedTuple):
    """State of a change after a step, and the wanted motion, not yet limited."""

    change: SideChange
    wanted: Motion


def kept(station: Station) -> SideChange:
    """State of a follower that was never told to change."""
    return SideChange(station.sign, station.alpha1, True)


@kernel
def is_gentle(v1: float, u1: float, rho_0: float) -> bool:
    """Whether a leader turns gently enough for a change: what is missing without its u1 can be outweighed."""
    return rho_0 * abs(u1) <= CORRECTION * v1


def gentle(v1: float, u1: float, gains: Gains) -> bool:
    """The same for the spacing of a follower's gains."""
    return is_gentle(v1, u1, gains.spacing.rho_0)


@kernel
def at_side(settings: LawSettings, sign: float) -> LawSettings:
    """The law's numbers at the station of the same bearing on a side."""
    if sign == settings.sign:
        return settings
    return settings._replace(sign=sign, sin_b=-settings.sin_b)


@kernel
def change_to(sign: float, line: Line) -> SideChange:
    """Begin to change to a side from the line at hand."""
    return SideChange(sign, math.atan2(line.sin1, line.cos1), False)


@kernel
def change_step(
    change: SideChange, settings: LawSettings, line: Line, v1: float, u1: float, dt: float
) -> Led:
    """State and wanted motion for the next dt [s] > 0; once arrived the motion is the law's at that side.

    ``settings``: for either side. ``u1`` is the leader's turn rate, 0 where it isn't known: what is then
    missing acts as a disturbance of rho_0 u1, which the correction meets only up to :data:`CORRECTION` v1.
    """
    there = at_side(settings, change.sign)
    if change.arrived or _may_take_over(there, line):
        return Led(change._replace(arrived=True), law(there, line, v1, u1))
    # A law of one's own may not be told a turn rate at all; on the way it is as for (8).
    return _led_round(change, there, line, v1, u1 if there.own.function == 0 else 0.0, dt)


@kernel(inline=False)
def _led_round(change: SideChange, there: LawSettings, line: Line, v1: float, u1: float, dt: float) -> Led:
    rho_0 = there.rho_0
    x, y = rho_0 * math.cos(change.phase), rho_0 * math.sin(change.phase)
    error_x, error_y = x - line.rho * line.cos1, y - line.rho * line.sin1
    error = math.sqrt(error_x * error_x + error_y * error_y)
    left = _way_left(change, there)
    # Faded out, not switched off: a bang-bang pace would make the commands chatter.
    share = min(1.0, max(0.0, 2.0 - 2.0 * error / (SLACK * rho_0)))
    pace = math.copysign(share * PACE * v1 / rho_0, left)
    moved = left if abs(left) <= abs(pace) * dt else pace * dt
    turning = u1 + moved / dt
    gain = min(there.mu1, CORRECTION * v1 / error) if error > 0.0 else 0.0
    w_x = v1 - turning * y + gain * error_x
    w_y = turning * x + gain * error_y
    # Heading of the follower, and of w, from the leader's.
    heading = math.atan2(line.sin1, line.cos1) + math.pi - math.atan2(line.sin2, line.cos2)
    aside = wrapped(heading - math.atan2(w_y, w_x))
    wanted = Motion(math.sqrt(w_x * w_x + w_y * w_y) * max(0.0, math.cos(aside)), u1 - there.mu2 * aside)
    return Led(change._replace(phase=wrapped(change.phase + moved)), wanted)


@kernel
def _way_left(change: SideChange, there: LawSettings) -> float:
    """Angle from the phase to the station's alpha1, the way round that does not pass ahead of the leader."""
    aim = math.atan2(-there.sin_b, -there.cos_b)
    return (aim if aim >= 0.0 else aim + _TURN) - (
        change.phase if change.phase >= 0.0 else change.phase + _TURN
    )


@kernel
def _may_take_over(there: LawSettings, line: Line) -> bool:
    """Whether alpha2 is near the station's, and the shape in the proved region."""
    along = line.cos2 * there.cos_b + line.sin2 * there.sin_b
    across = line.sin2 * there.cos_b - line.cos2 * there.sin_b
    if abs(math.atan2(across, along)) > _TAKEN_OVER_ANGLE:
        return False
    return lyapunov_at(line, there.cos_b, there.sin_b, there.rho_0, there.mu_rho) < _TAKEN_OVER_V1
