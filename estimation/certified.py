"""A guaranteed, not a statistical, error radius for an estimate: set membership over a window of positions.

Two positions known within eps, a time T apart, of a body that accelerates by no more than A: its velocity now
lies in the disc around their difference quotient of radius 2 eps / T + A T / 2. All discs of a window hold at
once. What they leave of speed and direction is certain; how far an estimate can be from it at most is its
certified radius, whatever filter made it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from formation.angles import FloatArray, wrap


@dataclass(frozen=True, slots=True)
class Interval:
    """Centre and half width of what is possible; an infinite half width if anything is."""

    centre: float
    half: float

    def radius(self, estimate: float, *, on_circle: bool = False) -> float:
        """Distance from an estimate to the farthest possible value; at most pi on the circle."""
        gap = estimate - self.centre
        farthest = abs(wrap(gap) if on_circle else gap) + self.half
        return min(farthest, math.pi) if on_circle else farthest


@dataclass(frozen=True, slots=True)
class CertainMotion:
    """What is certain of a leader at its newest position: speed [m/s], direction of motion [rad, world]."""

    speed: Interval
    direction: Interval


def certain_motion(
    times: FloatArray, positions: FloatArray, eps: float, A: float, speeds: tuple[float, float]
) -> CertainMotion | None:
    """From positions (n, 2) [m] at increasing times (n,) [s]; None for fewer than two, or if they contradict.

    ``speeds``: least and largest speed that is known beforehand. They contradict each other if the noise or
    the acceleration exceeds its bound.
    """
    if len(times) < 2:
        return None
    back = times[-1] - times[:-1]
    quotient = (positions[-1] - positions[:-1]) / back[:, np.newaxis]
    radius = 2.0 * eps / back + 0.5 * A * back
    length = np.hypot(quotient[:, 0], quotient[:, 1])
    low = max(speeds[0], float(np.max(length - radius)))
    high = min(speeds[1], float(np.min(length + radius)))
    if low > high:
        return None
    best = int(np.argmin(radius))
    direction = math.atan2(quotient[best, 1], quotient[best, 0])
    # A disc is seen from the origin under arcsin(radius / length); a known least speed helps as much.
    farther = np.maximum(length, low)
    half = np.where(radius < farther, np.arcsin(np.minimum(radius / farther, 1.0)), math.pi)
    offset = np.asarray(wrap(np.arctan2(quotient[:, 1], quotient[:, 0]) - direction))
    # Beyond half a turn about the best direction, intervals on the circle could meet twice.
    useful = np.abs(offset) + half < math.pi
    if not np.any(useful):
        return CertainMotion(_between(low, high), Interval(direction, math.pi))
    left, right = float(np.max((offset - half)[useful])), float(np.min((offset + half)[useful]))
    if left > right:
        return None
    turned = _between(left, right)
    return CertainMotion(_between(low, high), Interval(wrap(direction + turned.centre), turned.half))


def certain_alpha1(motion: CertainMotion, leader: FloatArray, follower: FloatArray, eps: float) -> Interval:
    """Bearing alpha1 [rad] from the measured positions (2,) of both robots, each within eps [m]."""
    line = follower - leader
    rho = float(np.hypot(*line))
    blur = math.asin(2.0 * eps / rho) if rho > 2.0 * eps else math.pi
    centre = wrap(math.atan2(line[1], line[0]) - motion.direction.centre)
    return Interval(centre, min(motion.direction.half + blur, math.pi))


def _between(low: float, high: float) -> Interval:
    return Interval(0.5 * (low + high), 0.5 * (high - low))
