"""The periodic orbit that a pair settles on when its leader's turning is periodic (Prop. 3 of the paper)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import root

from formation.angles import FloatArray, wrap
from formation.closed_loop import FollowerLaw, integrate
from formation.leader import LeaderProgram
from formation.pose import Motion
from formation.shape import Shape, shape_rates
from formation.station import ABREAST, Station

RELAXING_PERIODS = 10
SAMPLES_PER_PERIOD = 2000
_CLOSED = 1e-9
# A pair that drifts apart for ever nearly closes in ln(rho) too, far out: there a multiplier is next to 1,
# while near a true fixed point the gap after a period divided by this bounds the distance to it.
_ISOLATED = 1e-4
# Between the integrator's error divided by the step and the step's square: about 1e-7 and 1e-10 here.
_DIFFERENCE_STEP = 1e-5

PeriodMap = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class PeriodicOrbit:
    """One period of the reduced system (5), that is on the manifold alpha2 = pi/2 (or the station's).

    Arrays of shape (n,) over one period, first and last row the same state: ``t`` from 0 to ``period``,
    ``rho``, ``alpha1`` (wrapped), ``v2``. ``multipliers``: the two Floquet multipliers, largest modulus
    first; the orbit is exponentially stable if both lie inside the unit circle. The full system (3) under
    steering (4) has the same orbit and one more multiplier, exp(-mu2 * period).
    """

    period: float
    t: FloatArray
    rho: FloatArray
    alpha1: FloatArray
    v2: FloatArray
    multipliers: tuple[complex, complex]

    @property
    def largest_multiplier(self) -> float:
        """Largest modulus of the Floquet multipliers."""
        return abs(self.multipliers[0])


def find_orbit(
    program: LeaderProgram, law: FollowerLaw, rho_guess: float, station: Station = ABREAST
) -> PeriodicOrbit | None:
    """Find the periodic orbit near the station at distance ``rho_guess``, by shooting.

    The period map of the reduced system is followed for a few periods from (rho_guess, -pi/2), or the
    station's alpha1, then its
    fixed point is solved for in (ln rho, alpha1), in which rho stays positive. The multipliers are the
    eigenvalues of the map's derivative there, by central differences. None if the program has no period or no
    fixed point is found, as for a leader that turns harder on average than the law can hold.
    """
    period = program.period
    if period is None:
        return None
    ends = np.array([0.0, period])

    def period_map(point: FloatArray) -> FloatArray:
        end: FloatArray = _follow(program, law, station, point, ends)[-1]
        return end

    try:
        fixed = _fixed_point(period_map, np.array([math.log(rho_guess), station.alpha1]))
        if fixed is None:
            return None
        multipliers = _multipliers(period_map, fixed)
        if min(abs(1.0 - multiplier) for multiplier in multipliers) < _ISOLATED:
            return None
        return _orbit(program, law, station, fixed, period, multipliers)
    except ArithmeticError:
        return None


def _fixed_point(period_map: PeriodMap, point: FloatArray) -> FloatArray | None:
    def displacement(at: FloatArray) -> list[float]:
        return [float(moved) for moved in period_map(at) - at]

    for _ in range(RELAXING_PERIODS):
        point = period_map(point)
    fixed: FloatArray = root(displacement, point.tolist(), method="hybr", tol=1e-12).x
    return fixed if max(map(abs, displacement(fixed))) <= _CLOSED else None


def _follow(
    program: LeaderProgram, law: FollowerLaw, station: Station, point: FloatArray, times: FloatArray
) -> FloatArray:
    """States (ln rho, alpha1) of the reduced system at the given times."""

    def state_rates(t: float, state: FloatArray) -> tuple[float, ...]:
        driven = program(t)
        shape = _on_manifold(state, station)
        rates = shape_rates(shape, driven, Motion(law(shape, driven.v, driven.u).v, 0.0))
        return rates.rho_dot / shape.rho, rates.alpha1_dot

    return integrate(state_rates, point, times, program.longest_step)


def _on_manifold(state: FloatArray, station: Station) -> Shape:
    return Shape(math.exp(state[0]), wrap(float(state[1])), station.alpha2)


def _multipliers(period_map: PeriodMap, fixed: FloatArray) -> tuple[complex, complex]:
    columns = [period_map(fixed + step) - period_map(fixed - step) for step in _DIFFERENCE_STEP * np.eye(2)]
    monodromy = np.column_stack(columns) / (2.0 * _DIFFERENCE_STEP)
    first, second = sorted(np.linalg.eigvals(monodromy), key=abs, reverse=True)
    return complex(first), complex(second)


def _orbit(
    program: LeaderProgram,
    law: FollowerLaw,
    station: Station,
    fixed: FloatArray,
    period: float,
    multipliers: tuple[complex, complex],
) -> PeriodicOrbit:
    times = np.linspace(0.0, period, SAMPLES_PER_PERIOD + 1)
    states = _follow(program, law, station, fixed, times)
    speeds = [
        law(_on_manifold(state, station), driven.v, driven.u).v
        for state, driven in zip(states, map(program, times.tolist()), strict=True)
    ]
    return PeriodicOrbit(
        period=period,
        t=times,
        rho=np.exp(states[:, 0]),
        alpha1=wrap(states[:, 1]),
        v2=np.array(speeds),
        multipliers=multipliers,
    )
