"""What is drawn of a follower and its leader: both robots, what is estimated and how well, the station."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from formation.angles import wrap
from formation.pose import Pose
from formation.station import Station
from hil.scene.markers import Brush, Colour, Marker, Point, circle, ellipse, on_ray, sector
from hil.scene.robot_size import BODY_DIAMETER, HEIGHT, WHEEL_DIAMETER, WHEEL_OFFSET, WHEEL_WIDTH, WIDTH

LEADER, FOLLOWER = Colour(0.12, 0.37, 0.66), Colour(0.85, 0.45, 0.10)
_WHEEL, _LINE, _NOSE = Colour(0.2, 0.2, 0.2), Colour(0.55, 0.55, 0.55), Colour(1.0, 1.0, 1.0)
_GOOD, _BOUND, _BAD = Colour(0.13, 0.55, 0.25), Colour(0.55, 0.25, 0.65), Colour(0.80, 0.15, 0.15)

_NOSE_Z, _ABOVE, _TEXT_Z = HEIGHT + 0.01, HEIGHT + 0.02, HEIGHT + 0.05
AHEAD_S = 1.0
"""The estimated velocity is drawn as the way of so many seconds."""

SDS = 3.0
"""Ellipses reach so many standard deviations."""

_STATION_RADIUS = 0.5 * WIDTH + 0.01  # around a robot that stands on it
_STATION = Colour(0.93, 0.72, 0.10)
_TEXT, _TEXT_ASIDE = 0.03, 0.17
_MOST = 5.0  # m; nothing that is less certain than this is drawn


@dataclass(frozen=True, slots=True)
class Believed:
    """What a follower believes of its leader, as it is drawn.

    ``theta`` [rad]: the leader's heading in the world. ``sd_v1`` [m/s], ``sd_alpha1`` [rad], ``bound_v1``,
    ``bound_alpha1``: NaN where not known. ``trusted``: whether it may move a robot; ``says``: its status.
    ``sd_along``, ``sd_across`` [m]: deviations of the leader's position along the line of sight and across.
    """

    theta: float
    alpha1: float
    v1: float
    sd_v1: float
    sd_alpha1: float
    bound_v1: float
    bound_alpha1: float
    sd_along: float
    sd_across: float
    trusted: bool
    says: str


@dataclass(frozen=True, slots=True)
class SeenPair:
    """A follower and its leader at a time, in the world frame.

    ``leader``: where it is, as measured, and its heading if the motion capture tells that, else NaN.
    ``commanded``: v2 [m/s] and u2 [rad/s], None before the first command; ``stop``: why it stands.
    """

    stamp_ns: int
    names: tuple[str, str]
    leader: Pose
    follower: Pose
    rho_0: float
    station: Station
    believed: Believed | None
    commanded: tuple[float, float] | None
    stop: str


def robot_markers(brush: Brush, colour: Colour) -> Iterator[Marker]:
    """A robot in its true size, in its own frame."""
    yield brush.cylinder(0, (0.0, 0.0), HEIGHT, (BODY_DIAMETER, BODY_DIAMETER), colour.faint(0.85))
    for number, y in enumerate((WHEEL_OFFSET, -WHEEL_OFFSET), 1):
        yield brush.wheel(number, (0.0, y), WHEEL_DIAMETER, WHEEL_WIDTH, _WHEEL)
    yield brush.arrow(
        3, (-0.3 * BODY_DIAMETER, 0.0), (0.45 * BODY_DIAMETER, 0.0), _NOSE_Z, 0.018, Colour(1.0, 1.0, 1.0)
    )


def pair_markers(brush: Brush, seen: SeenPair) -> Iterator[Marker]:
    """The line between the robots, the station, what is believed of the leader, and texts; in the world."""
    leader, follower = seen.leader[:2], seen.follower[:2]
    yield brush.line(0, (follower, leader), 0.005, 0.004, _LINE)
    believed = seen.believed
    if believed is not None:
        yield from _position(brush, leader, follower, believed)
        if believed.trusted:
            yield from _motion(brush, leader, believed)
            yield from _station(brush, seen, believed)
        colour = _GOOD if believed.trusted else _BAD
        beside = _beyond(follower, leader)
        yield brush.text(20, beside, _TEXT_Z, _TEXT, _leader_text(seen.names[0], believed), colour)
    beside, colour = _beyond(leader, follower), _BAD if seen.stop else FOLLOWER
    yield brush.text(21, beside, _TEXT_Z, _TEXT, _follower_text(seen), colour)


def _beyond(other: Point, robot: Point) -> Point:
    """Beside a robot, away from the other one: where neither is under a text, seen from above too."""
    return on_ray(robot, math.atan2(robot[1] - other[1], robot[0] - other[0]), _TEXT_ASIDE)


def _position(brush: Brush, leader: Point, follower: Point, believed: Believed) -> Iterator[Marker]:
    line = math.atan2(leader[1] - follower[1], leader[0] - follower[0])
    radii = SDS * believed.sd_along, SDS * believed.sd_across
    if all(0.0 < radius < _MOST for radius in radii):
        yield brush.line(1, ellipse(leader, radii, line), _ABOVE, 0.002, _GOOD)


def _motion(brush: Brush, leader: Point, believed: Believed) -> Iterator[Marker]:
    """The way of the next second, the ellipse of where it ends, and outside it what bounds allow."""
    reach = AHEAD_S * believed.v1
    tip = on_ray(leader, believed.theta, reach)
    yield brush.arrow(2, leader, tip, _ABOVE, 0.012, _GOOD)
    along, across = SDS * AHEAD_S * believed.sd_v1, SDS * believed.sd_alpha1 * reach
    if 0.0 < along < _MOST and 0.0 < across < _MOST:
        yield brush.line(3, ellipse(tip, (along, across), believed.theta), _ABOVE, 0.003, _GOOD)
    half = min(math.pi, believed.bound_alpha1)
    radii = max(0.0, reach - AHEAD_S * believed.bound_v1), reach + AHEAD_S * believed.bound_v1
    if half > 0.0 and radii[1] < _MOST:
        yield brush.line(4, sector(leader, radii, believed.theta, half), _ABOVE, 0.002, _BOUND)


def _station(brush: Brush, seen: SeenPair, believed: Believed) -> Iterator[Marker]:
    """Where the follower is to be: at rho_0 from the leader, at the station's alpha1 from its heading."""
    alpha2 = math.atan2(seen.station.sin, seen.station.cos)
    line = believed.theta + float(wrap(alpha2 - math.pi))
    place = on_ray(seen.leader[:2], line, seen.rho_0)
    yield brush.line(5, circle(place, _STATION_RADIUS), 0.005, 0.005, _STATION)
    yield brush.line(6, (place, seen.follower[:2]), _ABOVE, 0.004, _STATION)


def _leader_text(name: str, believed: Believed) -> str:
    if not believed.trusted:
        return f"{name}: {believed.says}"
    degrees = math.degrees(believed.alpha1)
    return (
        f"{name}: {believed.says}\n"
        f"v1 {1e3 * believed.v1:.1f} mm/s{_within(1e3 * believed.bound_v1, 'mm/s')}\n"
        f"alpha1 {degrees:.1f} deg{_within(math.degrees(believed.bound_alpha1), 'deg')}"
    )


def _within(bound: float, unit: str) -> str:
    return f", bound {bound:.1f} {unit}" if math.isfinite(bound) else ""


def _follower_text(seen: SeenPair) -> str:
    name = seen.names[1]
    if seen.stop:
        return f"{name} stands: {seen.stop}"
    if seen.commanded is None:
        return name
    v2, u2 = seen.commanded
    return f"{name}\nv2 {1e3 * v2:.0f} mm/s, u2 {u2:.2f} rad/s"
