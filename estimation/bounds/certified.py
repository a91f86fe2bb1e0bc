"""A guaranteed, not a statistical, error radius for an estimate: set membership over a window of positions.

Two positions known within eps, a time T apart, of a body that accelerates by no more than A: its velocity now
lies in the disc around their difference quotient of radius 2 eps / T + A T / 2. All discs of a window hold at
once. What they leave of speed and direction is certain; how far an estimate can be from it at most is its
certified radius, whatever filter made it.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from enum import Enum
from types import ModuleType

import numpy as np

from formation.angles import FloatArray, wrap

_LONGEST = 1.5
"""Pairs further apart than so many best windows tell next to nothing more."""
_FEWEST_STEPS = 3.0
"""Where measurements are rare, so many steps between them fit in, and one that is lost leaves no gap."""


class Failed(Enum):
    """Which assumption of a certificate is seen to fail; the value is the word for it on the wire.

    GAP: too few measurements of late. UNSEEN: the newest measurement was not believed.
    NOISE: two positions are further apart than their errors and the leader's speed allow. SLOW: the leader is
    slower than it should be. ACCELERATION: the velocities that the positions allow have nothing in common,
    be it that the leader accelerated too hard or that their errors are too large.
    """

    GAP = "gap"
    UNSEEN = "unseen"
    NOISE = "noise"
    SLOW = "slow"
    ACCELERATION = "acceleration"


@functools.cache
def load() -> ModuleType:
    """Load what is compiled, for those who ask for certificates alone; the first need not wait then."""
    from estimation.bounds import certified_kernels

    return certified_kernels


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
    """What is certain of how a leader moves now: speed [m/s], direction of motion [rad]."""

    speed: Interval
    direction: Interval


@dataclass(frozen=True, slots=True)
class Certain:
    """What is certain of a leader at a moment: v1 [m/s], alpha1 [rad], and from how many measurements."""

    v1: Interval
    alpha1: Interval
    measurements: int


def certain_motion(
    back: FloatArray, moved: FloatArray, blur: FloatArray, A: float, speeds: tuple[float, float]
) -> CertainMotion | Failed:
    """From the leader's displacement (n, 2) [m] since ``back`` (n,) [s] > 0 ago.

    ``blur``: bound of each displacement's error (n,) [m]. ``A``: bound of the
    acceleration [m/s^2]. ``speeds``: least and largest speed [m/s] that is known beforehand. The direction is
    in the frame of the displacements. Fails if they contradict what is assumed.
    """
    if len(back) == 0:
        return Failed.GAP
    ranges = np.empty(4)
    slowest, fastest = speeds
    seen = [np.array(values, dtype=np.float64, order="C") for values in (back, moved, blur)]
    kernels = load()
    outcome = kernels.intersect(seen[0], seen[1], seen[2], A, slowest, fastest, ranges)
    if outcome != kernels.CERTAIN:
        failed = (Failed.NOISE, Failed.SLOW, Failed.ACCELERATION)
        return failed[(kernels.NOISE, kernels.SLOW, kernels.ACCELERATION).index(outcome)]
    low, high, direction, half = ranges.tolist()
    speed = Interval(0.5 * (low + high), 0.5 * (high - low))
    return CertainMotion(speed, Interval(wrap(direction), half))


def certain_alpha1(direction: Interval, line: Interval) -> Interval:
    """Bearing alpha1 [rad] from the leader's direction of motion and that of the line to the follower."""
    return Interval(wrap(line.centre - direction.centre), min(direction.half + line.half, math.pi))


def window_ns(best: float, step: float) -> int:
    """How far back to look [ns], from the window [s] that is best and the time [s] between measurements."""
    return round(1e9 * max(_LONGEST * best, _FEWEST_STEPS * step))
