"""A flock in which each agent follows the mean of its nearest neighbours, compiled: choice, rates, solver.

The laws are those of :mod:`controllers.laws` and the virtual leader that of :mod:`benchmarks.virtual_leader`,
which they are tested against; all that a kernel calls is in this one file because the cache of compiled code
looks at the file of a kernel only. Importing this module compiles the kernels or loads them from the cache.

``state`` has a row (x, y, theta) for each agent, the leader first, headings not wrapped. Agents come after
all that they may follow, so one pass in their order gives everybody's motion. ``neighbours`` has for each
agent the indices of those that it follows, -1 where there are fewer. ``setting`` is mu1, mu2, mu_rho, v_max,
u_max, tilt, and 1 if an agent is told its neighbours' turn rates, else 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import njit, types
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Indices = NDArray[np.int64]
Table = NDArray[np.bool_]

_F = TypeVar("_F", bound=Callable[..., object])

_ROW = types.float64[::1]
_ROWS = types.float64[:, ::1]
_SHEETS = types.float64[:, :, ::1]
_CHOICE = types.int64[:, ::1]
_TABLE = types.boolean[:, ::1]

_RATES = (types.float64, types.float64, _ROWS, _ROWS, _CHOICE, _ROW, _ROWS, _ROWS)
_CHOOSE = (_ROWS, _TABLE, _CHOICE)
_INTEGRATE = (
    _ROWS, types.float64, types.int64, types.int64, _ROWS, _ROWS, _TABLE, _ROW,
    _SHEETS, _SHEETS, types.int64[:, :, ::1], _ROWS,
)  # fmt: skip


def _compiled(*signature: object) -> Callable[[_F], _F]:
    """Compile for one signature now, or without one for whatever a kernel calls the function with."""
    compiler: Any = njit(signature or None, cache=True, fastmath=False, error_model="numpy")
    decorate: Callable[[_F], _F] = compiler
    return decorate


@_compiled()
def _clip(value: float, bound: float) -> float:
    if value > bound:
        return bound
    if value < -bound:
        return -bound
    return value


@_compiled(*_CHOOSE)
def choose(state: Matrix, allowed: Table, neighbours: Indices) -> None:
    """Fill ``neighbours`` with the nearest of those whom each agent may follow, nearest first."""
    agents, most = neighbours.shape
    squares = np.empty(most)
    neighbours[0, :] = -1
    for agent in range(1, agents):
        found = 0
        for other in range(agent):
            if not allowed[agent, other]:
                continue
            dx, dy = state[other, 0] - state[agent, 0], state[other, 1] - state[agent, 1]
            square = dx * dx + dy * dy
            if found == most and not square < squares[most - 1]:
                continue
            place = found if found < most else most - 1
            while place > 0 and squares[place - 1] > square:
                squares[place] = squares[place - 1]
                neighbours[agent, place] = neighbours[agent, place - 1]
                place -= 1
            squares[place], neighbours[agent, place] = square, other
            found = min(found + 1, most)
        neighbours[agent, found:] = -1


@_compiled(*_RATES)
def rates(
    v_leader: float,
    u_leader: float,
    state: Matrix,
    places: Matrix,
    neighbours: Indices,
    setting: Vector,
    change: Matrix,
    motions: Matrix,
) -> None:
    """Fill the rate of every pose, and four rows of motions with one column for each agent.

    The rows are the speed wanted, speed driven, turn rate driven, distance to the virtual leader.
    Agents that meet their virtual leader, or whose neighbours' headings cancel, get NaN.
    """
    mu1, mu2, mu_rho = setting[0], setting[1], setting[2]
    v_max, u_max, tilt, knows = setting[3], setting[4], setting[5], setting[6]
    for agent in range(len(state)):
        # The heading's cosine and sine are kept in `change` until nobody needs them any more.
        change[agent, 0], change[agent, 1] = math.cos(state[agent, 2]), math.sin(state[agent, 2])
    motions[0, 0], motions[1, 0], motions[2, 0], motions[3, 0] = v_leader, v_leader, u_leader, 0.0
    for agent in range(1, len(state)):
        count, x, y, along, across = 0, 0.0, 0.0, 0.0, 0.0
        cosine, sine, vx, vy, ux, uy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for place in range(neighbours.shape[1]):
            other = neighbours[agent, place]
            if other < 0:
                break
            c, s, v, u = change[other, 0], change[other, 1], motions[1, other], motions[2, other]
            count += 1
            x, y = x + state[other, 0], y + state[other, 1]
            along, across = along + places[other, 0], across + places[other, 1]
            cosine, sine = cosine + c, sine + s
            vx, vy, ux, uy = vx + v * c, vy + v * s, ux + u * c, uy + u * s
        share = 1.0 / count
        agreement = math.sqrt(cosine * cosine + sine * sine)
        cosine, sine = cosine / agreement, sine / agreement
        v1 = (vx * cosine + vy * sine) * share
        u1 = (ux * cosine + uy * sine) / agreement if knows != 0.0 else 0.0
        dx, dy = state[agent, 0] - x * share, state[agent, 1] - y * share
        rho = math.sqrt(dx * dx + dy * dy)
        inverse = 1.0 / rho
        dx, dy = dx * inverse, dy * inverse
        c, s = change[agent, 0], change[agent, 1]
        cos1, sin1 = cosine * dx + sine * dy, cosine * dy - sine * dx
        cos2, sin2 = -(c * dx + s * dy), s * dx - c * dy
        # The station: where the mean of the neighbours' places lies from one's own.
        along, across = along * share - places[agent, 0], across * share - places[agent, 1]
        rho_0 = math.sqrt(along * along + across * across)
        cos_b, sin_b = along / rho_0, across / rho_0
        sign = 1.0 if sin_b > 0.0 else -1.0
        pull = (rho - rho_0) * inverse * ((rho + rho_0) * inverse)
        turn = u1 + sign * v1 * mu_rho * pull - mu1 * (sin_b * cos1 - cos_b * sin1)
        wanted = (rho * turn - v1 * sin1) / sin_b
        v2 = _clip(wanted, v_max)
        away, ahead = sin2 * cos_b - cos2 * sin_b, cos2 * cos_b + sin2 * sin_b
        if wanted != v2:
            leaning = sign * tilt * ((wanted - v2) / abs(wanted)) * _clip(pull, 1.0)
            away = away * math.cos(leaning) + ahead * math.sin(leaning)
        u2 = _clip(mu2 * away + (v1 * sin1 + v2 * sin2) * inverse, u_max)
        motions[0, agent], motions[1, agent], motions[2, agent], motions[3, agent] = wanted, v2, u2, rho
    for agent in range(len(state)):
        change[agent, 0] *= motions[1, agent]
        change[agent, 1] *= motions[1, agent]
        change[agent, 2] = motions[2, agent]


@_compiled()
def _fill_clearances(state: Matrix, clearances: Vector) -> None:
    """Distance of each agent from whoever is nearest to it."""
    clearances[:] = math.inf
    for agent in range(len(state)):
        for other in range(agent):
            dx, dy = state[other, 0] - state[agent, 0], state[other, 1] - state[agent, 1]
            square = dx * dx + dy * dy
            clearances[agent] = min(clearances[agent], square)
            clearances[other] = min(clearances[other], square)
    clearances[:] = np.sqrt(clearances)


@_compiled(*_INTEGRATE)
def integrate(
    driven: Matrix,
    step: float,
    steps_per_choice: int,
    steps_per_sample: int,
    first: Matrix,
    places: Matrix,
    allowed: Table,
    setting: Vector,
    poses: Matrix,
    motions: Matrix,
    chosen: Indices,
    clearances: Matrix,
) -> bool:
    """Fill ``poses`` (n, N, 3), ``motions`` (n, 4, N), ``chosen`` (n, N, k), ``clearances`` (n, N).

    ``driven`` is the leader's speed and turn rate at each step's start, middle and next start. Neighbours
    are chosen anew every so many steps of the classical Runge-Kutta method, and kept in between. False as
    soon as a pose is not finite.
    """
    agents, steps = len(first), (len(driven) - 1) // 2
    state, trial = first.copy(), np.empty_like(first)
    changes, scratch = np.empty((4, agents, 3)), np.empty((4, agents))
    neighbours = np.empty(chosen.shape[1:], dtype=np.int64)
    for k in range(steps + 1):
        if k % steps_per_choice == 0:
            choose(state, allowed, neighbours)
        start = driven[2 * k]
        rates(start[0], start[1], state, places, neighbours, setting, changes[0], scratch)
        if k % steps_per_sample == 0:
            if not np.all(np.isfinite(state)):
                return False
            row = k // steps_per_sample
            poses[row], motions[row], chosen[row] = state, scratch, neighbours
            _fill_clearances(state, clearances[row])
        if k == steps:
            break
        for stage in range(1, 4):
            reach = step if stage == 3 else 0.5 * step
            for agent in range(agents):
                for part in range(3):
                    trial[agent, part] = state[agent, part] + reach * changes[stage - 1, agent, part]
            at = driven[2 * k + (2 if stage == 3 else 1)]
            rates(at[0], at[1], trial, places, neighbours, setting, changes[stage], scratch)
        for agent in range(agents):
            for part in range(3):
                middle = changes[1, agent, part] + changes[2, agent, part]
                total = changes[0, agent, part] + 2.0 * middle + changes[3, agent, part]
                state[agent, part] += step * total / 6.0
    return True
