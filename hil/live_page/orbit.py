"""What a scenario's pair does without noise, delay and limits: drawn behind what it does."""

from __future__ import annotations

import math

import numpy as np

from formation.angles import FloatArray
from formation.closed_loop import IntegrationError, Trajectory
from formation.station import Side
from hil.errors import AbreastError
from hil.scenario.links import chain_of
from hil.scenario.ordered_sides import ordered_sides
from hil.scenario.schema import Scenario

_STEP_S = 1.0 / 30.0
_LONGEST_S = 600.0
"""What comes later is not drawn."""

_REPORTED_S = 1.5
"""Within this time [s] an order shows in its follower's reports."""


class Orbit:
    """Shape by the time since the leader set off."""

    def __init__(self, run: Trajectory) -> None:
        self._t = run.t
        # Unwrapped, as what lies between two of them is asked for.
        self._shape = (run.rho, np.unwrap(run.alpha1), np.unwrap(run.alpha2))

    def at(self, since_s: float) -> tuple[float, float, float] | None:
        """(rho, alpha1, alpha2) then, angles wrapped; None before the start and after the end."""
        if not 0.0 <= since_s <= self._t[-1]:
            return None
        rho, alpha1, alpha2 = (float(np.interp(since_s, self._t, each)) for each in self._shape)
        return rho, math.remainder(alpha1, math.tau), math.remainder(alpha2, math.tau)


def orbit_of(scenario: Scenario) -> Orbit | None:
    """The orbit of a scenario; None for a chain, and where its motion breaks down."""
    from hil.scenario.noise_free_runs import noise_free_run

    if chain_of(scenario) is not None:
        return None
    times: FloatArray = np.arange(0.0, min(scenario.run.duration_s, _LONGEST_S) + _STEP_S, _STEP_S)
    try:
        return Orbit(noise_free_run(scenario, times))
    except (IntegrationError, AbreastError):
        return None


def is_due(scenario: Scenario, side: str, since_s: float) -> bool:
    """Whether a follower is on a side by its scenario, at a time [s] since the leader set off.

    If not, somebody else has sent it there, and it does not go on as the orbit does.
    """
    orders = [(-math.inf, Side(scenario.formation.side)), *ordered_sides(scenario)]
    # An order and its report take their time.
    known = [place for place, (at_s, _) in enumerate(orders) if at_s <= since_s - _REPORTED_S]
    return side in {each.value for at_s, each in orders[known[-1] :] if at_s <= since_s + _REPORTED_S}
