"""The line between the robots without angles: its length, and the directions under which either sees it."""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.arc import Course
from formation.kernel import kernel
from formation.shape import Shape


class Line(NamedTuple):
    """A :class:`~formation.shape.Shape` by pairs: rho [m], cosine and sine of alpha1, of alpha2."""

    rho: float
    cos1: float
    sin1: float
    cos2: float
    sin2: float


@kernel
def line_of(shape: Shape) -> Line:
    """Line of a shape whose bearings are finite."""
    alpha1, alpha2 = shape.alpha1, shape.alpha2
    return Line(shape.rho, math.cos(alpha1), math.sin(alpha1), math.cos(alpha2), math.sin(alpha2))


@kernel
def shape_of_line(line: Line) -> Shape:
    """Shape of a line, bearings in [-pi, pi]."""
    return Shape(line.rho, math.atan2(line.sin1, line.cos1), math.atan2(line.sin2, line.cos2))


@kernel
def line_between(leader: Course, follower: Course) -> Line:
    """Line of two courses. In one place rho is 0, and there are no directions: NaN."""
    dx, dy = follower.x - leader.x, follower.y - leader.y
    rho = math.sqrt(dx * dx + dy * dy)
    if rho == 0.0:
        return Line(0.0, math.nan, math.nan, math.nan, math.nan)
    ex, ey = dx / rho, dy / rho
    return Line(
        rho,
        ex * leader.cos + ey * leader.sin,
        ey * leader.cos - ex * leader.sin,
        -(ex * follower.cos + ey * follower.sin),
        ex * follower.sin - ey * follower.cos,
    )


@kernel
def leader_seen(line: Line) -> Course:
    """Course of the leader along the follower's axes: the inverse of :func:`line_between`."""
    cos = -(line.cos2 * line.cos1 + line.sin2 * line.sin1)
    sin = line.cos2 * line.sin1 - line.sin2 * line.cos1
    return Course(line.rho * line.cos2, line.rho * line.sin2, cos, sin)
