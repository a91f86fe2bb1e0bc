"""A search for leaders that drive a pair out of its invariant set: many pairs at once, steering bang-bang."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray
from formation.invariant_set import Disturbed, InvariantSet
from formation.shape import ABREAST_ALPHA1

STEP = 0.01
SLACK = 1e-5
"""What integration and the boundary's points may be off by, in rho [m] and alpha1 [rad]."""

_SHORTEST_HOLD, _LONGEST_HOLD = 0.05, 10.0
_WIDEST_MARGIN = 0.3


@dataclass(frozen=True, slots=True)
class Excursions:
    """How far the pairs came: how many ever left the set, and the extremes of all over all time."""

    pairs: int
    left: int
    rho_min: float
    rho_max: float
    alpha1_min: float
    alpha1_max: float


class _Leaders:
    """Leaders at their limits: half switch at random, half when it hurts, after alpha1 passed a margin.

    Mean times between random switches are spread over two decades. Speeds switch with the steering.
    """

    def __init__(self, system: Disturbed, random: np.random.Generator, pairs: int) -> None:
        spread = random.uniform(math.log(_SHORTEST_HOLD), math.log(_LONGEST_HOLD), pairs)
        self._rate = 1.0 / np.exp(spread)
        self._cunning = random.random(pairs) < 0.5
        self._margin = random.uniform(0.0, _WIDEST_MARGIN, pairs) * (random.random(pairs) < 0.9)
        self._random, self._system = random, system
        self.push = system.D * random.choice(np.array([-1.0, 1.0]), pairs)
        self.v1 = random.choice(np.array([system.speeds.lowest, system.speeds.highest]), pairs)

    def decide(self, theta: FloatArray) -> None:
        """Choose d = -u1 and v1 of each for the next step."""
        system, pairs = self._system, len(theta)
        sine = np.sin(theta)
        worst = np.where(sine >= 0.0, system.D, -system.D)
        by_chance = self._random.random(pairs) < STEP * self._rate
        passed = self._cunning & (np.abs(theta) >= self._margin)
        self.push = np.where(passed, worst, np.where(by_chance & ~self._cunning, -self.push, self.push))
        slow, fast = system.speeds.lowest, system.speeds.highest
        hurting = np.where(system.mu1 * np.abs(sine) < system.D, slow, fast)
        other = np.where(self.v1 == slow, fast, slow)
        self.v1 = np.where(self._cunning, hurting, np.where(by_chance, other, self.v1))


def drive_out(
    system: Disturbed, found: InvariantSet, random: np.random.Generator, pairs: int, duration: float
) -> Excursions:
    """Let leaders try for ``duration`` [s] of the reduced system (5) under law (8), from inside the set.

    Pairs begin anywhere in the set. RK4 with steps of :data:`STEP`, in which d and v1 are constant.
    """
    rho, theta = _starts(found, random, pairs)
    leaders = _Leaders(system, random, pairs)
    left: NDArray[np.bool_] = np.zeros(pairs, dtype=np.bool_)
    extremes = [rho.copy(), rho.copy(), theta.copy(), theta.copy()]
    for _ in range(round(duration / STEP)):
        leaders.decide(theta)
        rho, theta = _step(system, rho, theta, leaders.v1, leaders.push)
        left |= ~found.contains(rho, theta + ABREAST_ALPHA1, SLACK)
        for extreme, now, choose in zip(
            extremes, (rho, rho, theta, theta), (np.minimum, np.maximum) * 2, strict=True
        ):
            choose(extreme, now, out=extreme)
    lows_highs = [float(choose(each)) for each, choose in zip(extremes, (np.min, np.max) * 2, strict=True)]
    near, far, below, above = lows_highs
    return Excursions(
        pairs, int(np.count_nonzero(left)), near, far, below + ABREAST_ALPHA1, above + ABREAST_ALPHA1
    )


def _starts(found: InvariantSet, random: np.random.Generator, pairs: int) -> tuple[FloatArray, FloatArray]:
    rho = random.uniform(found.rho_min, found.rho_max, pairs)
    lowest, highest = found.span(rho)
    return rho, random.uniform(lowest, highest) - ABREAST_ALPHA1


def _step(
    system: Disturbed, rho: FloatArray, theta: FloatArray, v1: FloatArray, push: FloatArray
) -> tuple[FloatArray, FloatArray]:
    def rates(rho: FloatArray, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        sine = np.sin(theta)
        return -v1 * sine, v1 * system.spacing.f(rho) - system.mu1 * sine + push

    r1, p1 = rates(rho, theta)
    r2, p2 = rates(rho + 0.5 * STEP * r1, theta + 0.5 * STEP * p1)
    r3, p3 = rates(rho + 0.5 * STEP * r2, theta + 0.5 * STEP * p2)
    r4, p4 = rates(rho + STEP * r3, theta + STEP * p3)
    return (
        rho + STEP / 6.0 * (r1 + 2.0 * (r2 + r3) + r4),
        theta + STEP / 6.0 * (p1 + 2.0 * (p2 + p3) + p4),
    )
