"""The run as it would have been without noise, delay and lag: what a real run is held against."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from controllers.station_keeper import StationKeeper, StationState
from formation.angles import FloatArray, wrap
from formation.pose import Motion
from formation.shape import Shape, shape_rates
from formation.station import Side
from hil.judge.run_data import Span
from hil.judge.side_orders import Order
from hil.judge.true_states import Stamps, TrueStates
from hil.scenario.parts import station_keeper
from hil.scenario.schema import Scenario

STEP = 1.0 / 30.0
"""Step of the integration [s]; the error of a step of fourth order at the rates of these laws is < 1e-6."""

_State = tuple[float, float, float]


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
    leader's motion is not known, or where the motion breaks down.
    """
    inside = (truth.capture_ns >= run.from_ns) & (truth.capture_ns <= run.to_ns)
    known = inside & np.isfinite(truth.v1) & np.isfinite(truth.u1) & np.isfinite(truth.alpha1)
    if np.count_nonzero(known) < 2:
        return None
    from_ns = int(truth.capture_ns[known][0])
    since = (truth.capture_ns[known] - from_ns) * 1e-9
    steps = max(1, math.ceil(since[-1] / STEP))
    # Twice as many moments as steps: the method looks at the middle of each, too.
    moments = np.linspace(0.0, since[-1], 2 * steps + 1)
    driven = list(
        map(
            Motion,
            np.interp(moments, since, truth.v1[known]).tolist(),
            np.interp(moments, since, truth.u1[known]).tolist(),
        )
    )
    start = (
        math.log(truth.rho[known][0]),
        float(truth.alpha1[known][0]),
        float(truth.alpha2[known][0]),
    )
    try:
        due = [((order.given_ns - from_ns) * 1e-9, order.side) for order in orders]
        states = np.array(_integrate(scenario, start, driven, 2.0 * float(moments[1]), due))
    except (ArithmeticError, ValueError):
        return None
    return NoiseFreeOrbit(from_ns, moments[::2], np.exp(states[:, 0]), states[:, 1], states[:, 2])


def _integrate(
    scenario: Scenario,
    start: _State,
    driven: list[Motion],
    step: float,
    orders: list[tuple[float, Side]],
) -> list[_State]:
    """States after every step, the first included; ``driven``: the leader's motion at every half step."""
    keeper = station_keeper(scenario)
    station, states, waiting = keeper.begin(), [start], deque(orders)
    for k in range(0, len(driven) - 1, 2):
        while waiting and waiting[0][0] <= 0.5 * k * step:
            station = keeper.order(station, waiting.popleft()[1]) or station
        state, leader = states[-1], driven[k]
        held = None
        if station.waits or not station.change.arrived:
            station, wanted = keeper.drive(station, _shape(state), leader, leader.u, step)
            held = None if station.change.arrived else keeper.limits.apply(wanted)[0]
        rates = partial(_rates, keeper, station, held)
        states.append(_stepped(rates, state, driven[k : k + 3], step))
    return states


def _rates(
    keeper: StationKeeper, station: StationState, held: Motion | None, state: _State, leader: Motion
) -> _State:
    """Rates under the law at its station, or under a motion that is held on the way to one."""
    shape = _shape(state)
    if held is None:
        held, _ = keeper.limits.apply(keeper.by_law(station, shape, leader))
    change = shape_rates(shape, leader, held)
    return change.rho_dot / shape.rho, change.alpha1_dot, change.alpha2_dot


def _stepped(
    rates: Callable[[_State, Motion], _State], state: _State, driven: list[Motion], step: float
) -> _State:
    """State after a step of the Runge-Kutta method with the leader's motion at its begin, middle and end."""
    before, middle, after = driven
    k1 = rates(state, before)
    k2 = rates(_moved(state, k1, 0.5 * step), middle)
    k3 = rates(_moved(state, k2, 0.5 * step), middle)
    k4 = rates(_moved(state, k3, step), after)
    mean = tuple((a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in zip(k1, k2, k3, k4, strict=True))
    return _moved(state, (mean[0], mean[1], mean[2]), step)


def _shape(state: _State) -> Shape:
    return Shape(math.exp(state[0]), state[1], state[2])


def _moved(state: _State, rate: _State, dt: float) -> _State:
    return state[0] + rate[0] * dt, state[1] + rate[1] * dt, state[2] + rate[2] * dt
