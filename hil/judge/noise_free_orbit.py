"""The run as it would have been without noise, delay and lag: what a real run is held against."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray, wrap
from formation.lending import lent
from formation.pose import Motion
from formation.records import Rows, columns_of, row_of, rows_of, store
from hil.judge.entries import integrate_orbit
from hil.judge.orbit_steps import DueOrder, OrbitDesk, OrbitRules, OrbitState
from hil.judge.run_data import Span
from hil.judge.side_orders import Order
from hil.judge.true_states import Stamps, TrueStates
from hil.scenario.parts import station_keeper
from hil.scenario.schema import Scenario

STEP = 1.0 / 30.0
"""Step of the integration [s]; the error of a step of fourth order at the rates of these laws is < 1e-6."""

_TURNED = 2.0
"""No robot turns so far [rad] from one truth to the next; one that begins to drive backwards does, by pi."""

Rowed = NDArray[np.void]


@dataclass(frozen=True, slots=True, eq=False)
class NoiseFreeOrbit:
    """Shape over time: ``t`` [s] from ``from_ns`` on, rho [m], alpha1 and alpha2 [rad] not wrapped; (n,)."""

    from_ns: int
    t: FloatArray
    rho: FloatArray
    alpha1: FloatArray
    alpha2: FloatArray

    def at(self, moments_ns: Stamps) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(rho, alpha1, alpha2) at other moments, angles wrapped."""
        t = (moments_ns - self.from_ns) * 1e-9
        rho, alpha1, alpha2 = (np.interp(t, self.t, each) for each in (self.rho, self.alpha1, self.alpha2))
        return rho, wrap(alpha1), wrap(alpha2)


def noise_free_orbit(
    scenario: Scenario, truth: TrueStates, run: Span, orders: Sequence[Order] = ()
) -> NoiseFreeOrbit | None:
    """Shape of a pair that starts as the run did and whose leader moves as the run's did.

    The follower drives what the scenario's law says on the true state, within the controller's limits, at
    once, and changes sides by ``orders``. Eq. (3) of the paper by the classical Runge-Kutta method on
    (ln rho, alpha1, alpha2), the leader's motion linear between the truths. None where the start or the
    leader's motion is not known, where it turns back, so that alpha1 jumps, or where the motion breaks down.
    """
    inside = (truth.capture_ns >= run.from_ns) & (truth.capture_ns <= run.to_ns)
    known = inside & np.isfinite(truth.v1) & np.isfinite(truth.u1) & np.isfinite(truth.alpha1)
    turned = _turned_round(truth.leader[known, 2], truth.v1[known])
    if np.count_nonzero(known) < 2 or turned is None:
        return None
    from_ns = int(truth.capture_ns[known][0])
    since = (truth.capture_ns[known] - from_ns) * 1e-9
    steps = max(1, math.ceil(since[-1] / STEP))
    # Twice as many moments as steps: the method looks at the middle of each, too.
    moments = np.linspace(0.0, since[-1], 2 * steps + 1)
    driven = columns_of(rows_of(Motion, len(moments)))
    driven["v"], driven["u"] = (np.interp(moments, since, each[known]) for each in (truth.v1, truth.u1))
    alpha1 = float(truth.alpha1[known][0])
    start = OrbitState(
        math.log(truth.rho[known][0]), alpha1 + math.pi if turned else alpha1, float(truth.alpha2[known][0])
    )
    due = [DueOrder((order.given_ns - from_ns) * 1e-9, order.side.sign) for order in orders]
    states = _integrate(scenario, start, driven, 2.0 * float(moments[1]), due)
    if not all(np.all(np.isfinite(states[name])) for name in OrbitState._fields):
        return None
    with np.errstate(over="ignore"):
        rho = np.exp(states["log_rho"])
    return NoiseFreeOrbit(from_ns, moments[::2], rho, states["alpha1"], states["alpha2"])


def _turned_round(direction: FloatArray, v1: FloatArray) -> bool | None:
    """Whether a leader that stands at first drives off backwards; None where one turns back on its way.

    ``direction`` of travel [rad] (n,), of one that stands its heading.
    """
    moving = direction[v1 > 0.0]
    if np.any(np.abs(wrap(np.diff(moving))) > _TURNED):
        return None
    return bool(len(moving)) and abs(float(wrap(moving[0] - direction[0]))) > _TURNED


def _integrate(
    scenario: Scenario, start: OrbitState, driven: Rowed, step: float, orders: Sequence[DueOrder]
) -> Rowed:
    """States after every step, the first included; ``driven``: the leader's motion at every half step."""
    keeper = station_keeper(scenario)
    due, states = rows_of(DueOrder, len(orders)), rows_of(OrbitState, len(driven) // 2 + 1)
    columns_of(due)[:] = list(orders)
    store(states, 0, start)
    rules = OrbitRules(keeper.settings, keeper.limits.v_max, keeper.limits.u_max, step)
    desk = OrbitDesk(row_of(rules), row_of(keeper.begin()), cast("Rows[Motion]", driven), due, states)
    integrate_orbit(lent(desk))
    return columns_of(states)
