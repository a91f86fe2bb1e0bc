"""The pair without noise, delay and lag: its law and Eq. (3) of the paper, step by step."""

from __future__ import annotations

import math
from typing import NamedTuple

from controllers.laws import law
from controllers.limits import limited
from controllers.side_change import at_side
from controllers.station_keeper import KeeperSettings, StationState, keep, order_side
from formation.kernel import kernel
from formation.line import line_of
from formation.pose import Motion
from formation.records import Rows, load, size, store
from formation.shape import Shape, shape_rates


class OrbitState(NamedTuple):
    """Where the pair is: ln rho, alpha1, alpha2; or how fast these change."""

    log_rho: float
    alpha1: float
    alpha2: float


class OrbitRules(NamedTuple):
    """The law at its station, the follower's limits, and the length of a step [s]."""

    keeper: KeeperSettings
    v_max: float
    u_max: float
    step: float


class DueOrder(NamedTuple):
    """An order to change sides: when [s], and the sign of the side."""

    at_s: float
    sign: float


class OrbitDesk(NamedTuple):
    """Rows to work in: the leader's motion at every half step, and states after every step, the first given.

    ``station``: the state of the law at the begin.
    """

    rules: Rows[OrbitRules]
    station: Rows[StationState]
    driven: Rows[Motion]
    orders: Rows[DueOrder]
    states: Rows[OrbitState]


class _Held(NamedTuple):
    """The station, and the motion that is held on the way to another one, if there is one."""

    station: StationState
    holds: bool
    motion: Motion


@kernel
def orbit_integrated(desk: OrbitDesk) -> None:
    """Integrate by the classical Runge-Kutta method; where the motion breaks down, states are not finite."""
    rules, station = load(OrbitRules, desk.rules, 0), load(StationState, desk.station, 0)
    given = 0
    for k in range(size(desk.states) - 1):
        while given < size(desk.orders) and load(DueOrder, desk.orders, given).at_s <= k * rules.step:
            ordered = order_side(station, rules.keeper, load(DueOrder, desk.orders, given).sign)
            if ordered.taken:
                station = ordered.state
            given += 1
        state, leader = load(OrbitState, desk.states, k), load(Motion, desk.driven, 2 * k)
        held = _held(rules, station, state, leader)
        station = held.station
        middle, after = load(Motion, desk.driven, 2 * k + 1), load(Motion, desk.driven, 2 * k + 2)
        store(desk.states, k + 1, _stepped(rules, held, state, leader, middle, after))


@kernel(inline=False)
def _held(rules: OrbitRules, station: StationState, state: OrbitState, leader: Motion) -> _Held:
    waits = station.ordered_sign != station.change.sign
    if not waits and station.change.arrived:
        return _Held(station, False, leader)
    led = keep(station, rules.keeper, line_of(_shape(state)), leader, leader.u, rules.step)
    return _Held(led.state, not led.state.change.arrived, limited(led.wanted, rules.v_max, rules.u_max))


@kernel(inline=False)
def _rates(rules: OrbitRules, held: _Held, state: OrbitState, leader: Motion) -> OrbitState:
    """Rates under the law at its station, or under a motion that is held on the way to one."""
    shape, driven = _shape(state), held.motion
    if not held.holds:
        there = at_side(rules.keeper.law, held.station.change.sign)
        u1 = leader.u if rules.keeper.knows_turn else 0.0
        driven = limited(law(there, line_of(shape), leader.v, u1), rules.v_max, rules.u_max)
    change = shape_rates(shape, leader, driven)
    return OrbitState(change.rho_dot / shape.rho, change.alpha1_dot, change.alpha2_dot)


@kernel
def _stepped(
    rules: OrbitRules, held: _Held, state: OrbitState, before: Motion, middle: Motion, after: Motion
) -> OrbitState:
    """State after a step, by the leader's motion at its begin, middle and end."""
    step = rules.step
    k1 = _rates(rules, held, state, before)
    k2 = _rates(rules, held, _moved(state, k1, 0.5 * step), middle)
    k3 = _rates(rules, held, _moved(state, k2, 0.5 * step), middle)
    k4 = _rates(rules, held, _moved(state, k3, step), after)
    mean = OrbitState(
        (k1.log_rho + 2.0 * k2.log_rho + 2.0 * k3.log_rho + k4.log_rho) / 6.0,
        (k1.alpha1 + 2.0 * k2.alpha1 + 2.0 * k3.alpha1 + k4.alpha1) / 6.0,
        (k1.alpha2 + 2.0 * k2.alpha2 + 2.0 * k3.alpha2 + k4.alpha2) / 6.0,
    )
    return _moved(state, mean, step)


@kernel
def _shape(state: OrbitState) -> Shape:
    return Shape(math.exp(state.log_rho), state.alpha1, state.alpha2)


@kernel
def _moved(state: OrbitState, rate: OrbitState, dt: float) -> OrbitState:
    return OrbitState(
        state.log_rho + rate.log_rho * dt, state.alpha1 + rate.alpha1 * dt, state.alpha2 + rate.alpha2 * dt
    )
