"""The outermost motion of a pair whose alpha2 moves too, and the proof along its path, compiled.

:mod:`formation.joint_set` tells what they are for. The plane is that of rho / rho_0 and
theta = alpha1 + pi/2, in which all normals and directions are given. Motions go round counterclockwise, and
out is to their right.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.error_set_kernels import ErrorModel, bend_of
from formation.kernel import entry, kernel
from formation.records import Vector
from formation.spacing import restoring, restoring_slope

LONGEST_OUTLINE = 200_000
"""Points that an outline handed to :func:`outermost_turn` must have room for."""
APART = -1
HELD = -2

_RIM, _BETWEEN = 40, 12


class Tube(NamedTuple):
    """Where alpha2's radii stand, ``first`` [m] and each ``step`` on; error dv [m/s] of the speed driven."""

    first: float
    step: float
    dv: float


class Spot(NamedTuple):
    """A place (rho [m], theta), and how far alpha2 may be off there [rad]."""

    rho: float
    theta: float
    radius: float


class Pointing(NamedTuple):
    """A vector along rho / rho_0 and theta."""

    rho: float
    theta: float


class Outline(NamedTuple):
    """How an outline is followed: disturbed by ``spare`` [1/s] too much, in pieces of one length."""

    spare: float
    piece: float


@kernel
def radius_at(radii: Vector, tube: Tube, rho: float) -> float:
    """How far alpha2 may be off at a distance [rad]: straight between the places of the table."""
    last = len(radii) - 1
    place = min(max((rho - tube.first) / tube.step, 0.0), 1.0 * last)
    k = min(int(place), last - 1)
    before, after = float(radii[k]), float(radii[k + 1])
    return before + (place - k) * (after - before)


@kernel(inline=False)
def asked(model: ErrorModel, spot: Spot, c: float, s: float) -> float:
    """Speed [m/s] that law (8) asks for on an error of length W along (c, s)."""
    x = model.v1 * math.sin(spot.theta) + model.W * c
    y = -model.v1 * math.cos(spot.theta) + model.W * s
    v = math.sqrt(x * x + y * y)
    f: float = restoring(spot.rho, model.rho_0, model.mu_rho)
    speed: float = -y + spot.rho * (-model.mu1 * x / v + v * f)
    return speed


@kernel
def _aside(a: float, b: float, sine: float, cosine: float) -> float:
    """Largest a sin(e) + b cos(e) for |e| within the radius of that sine and cosine, below pi/2."""
    if b > 0.0 and abs(a) * cosine < b * sine:
        return math.sqrt(a * a + b * b)
    return abs(a) * sine + b * cosine


@kernel
def _drawn(model: ErrorModel, spot: Spot, normal: Pointing, v2: float) -> float:
    """The part of the outward speed that v2 makes, alpha2 at its worst."""
    a, b = normal.rho * v2 / model.rho_0, normal.theta * v2 / spot.rho
    return _aside(a, b, math.sin(spot.radius), math.cos(spot.radius))


@kernel
def _drawn_most(model: ErrorModel, spot: Spot, normal: Pointing, v2: float, dv: float) -> float:
    faster = _drawn(model, spot, normal, v2 + dv)
    return max(faster, _drawn(model, spot, normal, v2 - dv)) if dv > 0.0 else faster


@kernel(inline=False)
def largest_outward(model: ErrorModel, spot: Spot, normal: Pointing, dv: float) -> float:
    """Upper bound of the speed along a normal [1/s], over the disc of errors, steering, alpha2 and dv.

    For one alpha2 and one direction of the believed velocity it is linear in the length of that: the worst
    error lies on the rim. Between two places of a grid it rises above the higher by at most an eighth of the
    squared step times its second derivative; where that matters, the grid is refined.
    """
    sine = math.sin(spot.radius)
    bend = (abs(normal.rho) * spot.rho / model.rho_0 * sine + abs(normal.theta)) * bend_of(model, spot.rho)
    step = 2.0 * math.pi / _RIM
    turn_c, turn_s = math.cos(step), math.sin(step)
    small_c, small_s = math.cos(step / _BETWEEN), math.sin(step / _BETWEEN)
    first = _drawn_most(model, spot, normal, asked(model, spot, 1.0, 0.0), dv)
    best, c, s = first, 1.0, 0.0
    for _ in range(_RIM - 1):
        c, s = c * turn_c - s * turn_s, s * turn_c + c * turn_s
        best = max(best, _drawn_most(model, spot, normal, asked(model, spot, c, s), dv))
    slack, fine = 0.125 * step * step * bend, step / _BETWEEN
    before, c, s = first, 1.0, 0.0
    for _ in range(_RIM):
        ahead_c, ahead_s = c * turn_c - s * turn_s, s * turn_c + c * turn_s
        after = _drawn_most(model, spot, normal, asked(model, spot, ahead_c, ahead_s), dv)
        if max(before, after) + slack > best:
            for _ in range(1, _BETWEEN):
                c, s = c * small_c - s * small_s, s * small_c + c * small_s
                best = max(best, _drawn_most(model, spot, normal, asked(model, spot, c, s), dv))
        before, c, s = after, ahead_c, ahead_s
    along = -normal.rho * model.v1 * math.sin(spot.theta) / model.rho_0
    across = -normal.theta * model.v1 * math.cos(spot.theta) / spot.rho
    return along + across + abs(normal.theta) * model.k_u + best + 0.125 * fine * fine * bend


@kernel
def _changing(
    model: ErrorModel, lo: float, hi: float, sine: float, dv: float
) -> tuple[float, float, float, float]:
    """Lipschitz constants between two distances: rho_dot / rho_0 by rho / rho_0 and theta, then theta_dot."""
    f = max(abs(restoring(lo, model.rho_0, model.mu_rho)), abs(restoring(hi, model.rho_0, model.mu_rho)))
    seen = model.v1 + model.W
    pull, pull_by_rho = model.mu1 + seen * f, seen * restoring_slope(lo, model.rho_0, model.mu_rho)
    pull_by_theta = model.mu1 * model.v1 / (model.v1 - model.W) + f * model.v1
    off = 1.0 - math.sqrt(1.0 - sine * sine)
    rho_by_rho = sine * (pull + hi * pull_by_rho)
    rho_by_theta = (model.v1 + sine * (model.v1 + hi * pull_by_theta)) / model.rho_0
    theta_by_rho = model.rho_0 * ((model.W + off * seen + dv) / (lo * lo) + pull_by_rho)
    return rho_by_rho, rho_by_theta, theta_by_rho, off * model.v1 / lo + pull_by_theta


@kernel
def _outward_of(model: ErrorModel, tube: Tube, radius: float, a: Pointing, b: Pointing) -> float:
    """Upper bound of the outward speed [1/s] on the piece from a to b, places in m and rad."""
    ahead, up = (b.rho - a.rho) / model.rho_0, b.theta - a.theta
    length = math.sqrt(ahead * ahead + up * up)
    if not (length > 0.0 and min(a.rho, b.rho) >= tube.first):
        return math.inf
    normal = Pointing(up / length, -ahead / length)
    lo, hi = min(a.rho, b.rho), max(a.rho, b.rho)
    rr, rt, tr, tt = _changing(model, lo, hi, math.sin(radius), tube.dv)
    far, wide = 0.5 * abs(ahead), 0.5 * abs(up)
    slack = abs(normal.rho) * (rr * far + rt * wide) + abs(normal.theta) * (tr * far + tt * wide)
    middle = Spot(0.5 * (a.rho + b.rho), 0.5 * (a.theta + b.theta), radius)
    return largest_outward(model, middle, normal, tube.dv) + slack


@entry
def worst_across(
    rhos: Vector, thetas: Vector, count: int, radii: Vector, tube: Tube, model: ErrorModel
) -> float:
    """Upper bound of the field's outward speed [1/s] anywhere on a closed outline of ``count`` points.

    The last point is joined to the first. Negative: whatever alpha2 is within its radius, and whatever error
    and steering are, every motion crosses it inwards.
    """
    worst = -math.inf
    for k in range(count):
        j = k + 1 if k + 1 < count else 0
        a, b = Pointing(rhos[k], thetas[k]), Pointing(rhos[j], thetas[j])
        radius = radius_at(radii, tube, min(a.rho, b.rho))
        worst = max(worst, _outward_of(model, tube, radius, a, b))
    return worst


@kernel
def _velocity(model: ErrorModel, spot: Spot, v2: float, off: float, u: float) -> Pointing:
    """Velocity for a driven speed, alpha2 off by ``off`` radii and -u1 = u."""
    e = off * spot.radius
    along = -model.v1 * math.sin(spot.theta) + v2 * math.sin(e)
    across = (-model.v1 * math.cos(spot.theta) + v2 * math.cos(e)) / spot.rho
    return Pointing(along / model.rho_0, across + u)


@kernel
def _right_of(p: Pointing, q: Pointing) -> bool:
    """Whether q points to the right of p."""
    return p.rho * q.theta - p.theta * q.rho < 0.0


@kernel(inline=False)
def _rightmost(model: ErrorModel, spot: Spot, ahead: Pointing, angle: float, dv: float) -> Pointing:
    """The furthest to the right of ``ahead`` and the velocities with the error at one place of the rim."""
    v2 = asked(model, spot, math.cos(angle), math.sin(angle))
    best = ahead
    for sign in range(3):
        driven = v2 + (sign - 1.0) * dv
        for corner in range(4):
            off = 1.0 if corner % 2 == 0 else -1.0
            u = model.k_u if corner < 2 else -model.k_u
            tried = _velocity(model, spot, driven, off, u)
            if _right_of(best, tried):
                best = tried
    return best


@kernel(inline=False)
def _outermost(model: ErrorModel, spot: Spot, heading: Pointing, spare: float, dv: float) -> Pointing:
    """Direction of the outermost motion with roughly that heading, a little further out; zero if held."""
    first = Pointing(-heading.theta, heading.rho)
    best, step = first, 2.0 * math.pi / _RIM
    at = 0.0
    for k in range(_RIM):
        was = best
        best = _rightmost(model, spot, best, k * step, dv)
        if best.rho != was.rho or best.theta != was.theta:
            at = k * step
    fine = step / _BETWEEN
    for k in range(-_BETWEEN, _BETWEEN + 1):
        best = _rightmost(model, spot, best, at + k * fine, dv)
    speed = math.sqrt(best.rho * best.rho + best.theta * best.theta)
    if not speed > 1.5 * spare:
        return Pointing(0.0, 0.0)
    turned = spare / speed
    kept = math.sqrt(1.0 - turned * turned)
    c, s = best.rho / speed, best.theta / speed
    return Pointing(c * kept + s * turned, s * kept - c * turned)


@entry
def outermost_turn(
    rhos: Vector, thetas: Vector, rho: float, radii: Vector, tube: Tube, shape: Outline, model: ErrorModel
) -> int:
    """One turn of the outermost motion from (rho, theta = 0) upwards, as an outline.

    Returns the number of points, the last one just below theta = 0 again. ``APART``: it passes
    alpha1 = +pi/2, or the robots drift apart; ``HELD``: it comes to rest before it has gone round.
    """
    spare, piece = shape.spare, shape.piece
    theta, below, rests = 0.0, False, False
    heading = Pointing(0.0, 1.0)
    rhos[0], thetas[0] = rho, theta
    for n in range(1, LONGEST_OUTLINE):
        if not rests:
            spot = Spot(rho, theta, radius_at(radii, tube, rho))
            half = _outermost(model, spot, heading, spare, tube.dv)
            r, t = rho + 0.5 * piece * half.rho * model.rho_0, theta + 0.5 * piece * half.theta
            middle = Spot(r, t, radius_at(radii, tube, r))
            ahead = _outermost(model, middle, half, spare, tube.dv)
            rests = (half.rho == 0.0 and half.theta == 0.0) or (ahead.rho == 0.0 and ahead.theta == 0.0)
            # Where it creeps into its rest far out, straight on is a little further out than that.
            heading = heading if rests else ahead
        if rests and not (below and heading.theta > 0.0):
            return HELD
        rho, theta = rho + piece * heading.rho * model.rho_0, theta + piece * heading.theta
        if not (abs(theta) < math.pi and 0.2 * model.rho_0 < rho < 6.0 * model.rho_0):
            return APART
        if below and theta >= 0.0:
            return n
        below = theta < -0.02 or (below and theta < 0.0)
        rhos[n], thetas[n] = rho, theta
    return APART


@entry
def outward_at(spot: Spot, normal: Pointing, dv: float, model: ErrorModel) -> float:
    """:func:`largest_outward` at a place."""
    return largest_outward(model, spot, normal, dv)
