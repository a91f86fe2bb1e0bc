"""From where a pair settles: the true region of attraction, as a map of settling times over starts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from controllers.chain import simulate_chain
from controllers.laws import Gains
from controllers.limits import Limits
from formation.angles import FloatArray
from formation.closed_loop import IntegrationError
from formation.leader import Constant
from formation.pose import Pose
from formation.shape import Shape

_LOOSE = 1e-6
_ORIGIN = Pose(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class SettlingMap:
    """Settling time [s] by start, nan where a pair hasn't settled or broke down.

    ``rho`` [m], ``alpha1`` [rad]: the starts, all with one ``alpha2`` [rad]; ``settled_s`` has a row for each
    rho and a column for each alpha1.
    """

    rho: FloatArray
    alpha1: FloatArray
    alpha2: float
    settled_s: FloatArray

    @property
    def share(self) -> float:
        """Share of the starts from which the pair settles."""
        return float(np.mean(np.isfinite(self.settled_s)))


def settling_map(
    gains: Gains,
    limits: Limits,
    v1: float,
    rho: FloatArray,
    alpha1: FloatArray,
    alpha2: float,
    horizon: float,
    *,
    within: float = 0.02,
) -> SettlingMap:
    """Follow every start behind a leader that drives straight on at v1, for the given time [s].

    The whole system (3), not only the reduced one, and within the limits. A pair has settled from when on
    its distance stays within a share ``within`` of rho_0 and both bearings stay within the same in radians.
    """
    times = np.linspace(0.0, horizon, max(2, round(horizon * 10.0) + 1))
    settled = np.full((len(rho), len(alpha1)), math.nan)
    for row, distance in enumerate(rho.tolist()):
        for column, bearing in enumerate(alpha1.tolist()):
            start = Shape(distance, bearing, alpha2)
            settled[row, column] = _settled(start, gains, limits, v1, times, within)
    return SettlingMap(rho, alpha1, alpha2, settled)


def _settled(
    start: Shape, gains: Gains, limits: Limits, v1: float, times: FloatArray, within: float
) -> float:
    try:
        run = simulate_chain(
            _ORIGIN,
            [start],
            Constant(v1, 0.0),
            gains,
            limits,
            times,
            knows_turn=False,
            relative=_LOOSE,
            absolute=_LOOSE,
        )
    except IntegrationError:
        return math.nan
    station = gains.station
    off = np.abs(run.rho[:, 0] / gains.spacing.rho_0 - 1.0) > within
    off |= np.cos(run.alpha1[:, 0] - station.alpha1) < math.cos(within)
    off |= np.cos(run.alpha2[:, 0] - station.alpha2) < math.cos(within)
    rows = np.flatnonzero(off)
    after = int(rows[-1]) + 1 if len(rows) else 0
    return float(times[after]) if after < len(times) else math.nan
