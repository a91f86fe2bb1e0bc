"""A flock in which each agent follows the mean of its nearest neighbours, compiled: choice, rates, solver.

The law is that of :mod:`controllers.laws`; the virtual leader is the mean of an agent's neighbours: of their
places and of the unit vectors along their headings; its speed is the mean velocity's part along that heading,
and its turn rate the rate of that heading. Importing this module compiles its entry or loads it from the
cache.

``state`` has a row (x, y, theta) for each agent, the leader first, headings not wrapped. Agents come after
all that they may follow, so one pass in their order gives everybody's motion. ``neighbours`` has for each
agent the indices of those that it follows, -1 where there are fewer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers.laws import LawSettings, law
from controllers.limits import limited
from formation.kernel import entry, kernel
from formation.line import Line
from formation.pose import Motion
from formation.records import FlagMatrix, IndexMatrix, IndexTensor, Matrix, Tensor, Vector


class Flock(NamedTuple):
    """The law's numbers, its station and distance replaced by each agent's own; whether u1 is told."""

    law: LawSettings
    knows_turn: bool


class Timing(NamedTuple):
    """Step [s] of the integration, and how many steps lie between two choices, and between two samples."""

    step: float
    steps_per_choice: int
    steps_per_sample: int


@kernel(inline=False)
def choose(state: Matrix, allowed: FlagMatrix, neighbours: IndexMatrix) -> None:
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


class _Mean(NamedTuple):
    """The virtual leader: its place, heading and motion; and the mean of the neighbours' places."""

    x: float
    y: float
    cos: float
    sin: float
    motion: Motion
    ahead: float
    left: float


@kernel
def _mean_of(
    agent: int, state: Matrix, places: Matrix, neighbours: IndexMatrix, change: Matrix, motions: Matrix
) -> _Mean:
    """Virtual leader of an agent, NaN if there is none; ``change``: cosines and sines of the headings."""
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
    agreement = math.sqrt(cosine * cosine + sine * sine)
    share = 1.0 / count if count > 0 else math.nan
    sharper = 1.0 / agreement if agreement > 0.0 else math.nan
    cosine, sine = cosine * sharper, sine * sharper
    motion = Motion((vx * cosine + vy * sine) * share, (ux * cosine + uy * sine) * sharper)
    return _Mean(x * share, y * share, cosine, sine, motion, along * share, across * share)


@kernel(inline=False)
def rates(
    leader: Motion,
    state: Matrix,
    places: Matrix,
    neighbours: IndexMatrix,
    flock: Flock,
    change: Matrix,
    motions: Matrix,
) -> None:
    """Fill the rate of every pose, and four rows of motions with one column for each agent.

    The rows are the speed wanted, speed driven, turn rate driven, distance to the virtual leader.
    Agents that meet their virtual leader, or whose neighbours' headings cancel, get NaN.
    """
    for agent in range(len(state)):
        # The heading's cosine and sine are kept in `change` until nobody needs them any more.
        change[agent, 0], change[agent, 1] = math.cos(state[agent, 2]), math.sin(state[agent, 2])
    motions[0, 0], motions[1, 0], motions[2, 0], motions[3, 0] = leader.v, leader.v, leader.u, 0.0
    for agent in range(1, len(state)):
        mean = _mean_of(agent, state, places, neighbours, change, motions)
        dx, dy = state[agent, 0] - mean.x, state[agent, 1] - mean.y
        rho = math.sqrt(dx * dx + dy * dy)
        inverse = 1.0 / rho if rho > 0.0 else math.nan
        dx, dy = dx * inverse, dy * inverse
        c, s = change[agent, 0], change[agent, 1]
        line = Line(
            rho if rho > 0.0 else math.nan,
            mean.cos * dx + mean.sin * dy,
            mean.cos * dy - mean.sin * dx,
            -(c * dx + s * dy),
            s * dx - c * dy,
        )
        # The station: where the mean of the neighbours' places lies from one's own.
        ahead, left = mean.ahead - places[agent, 0], mean.left - places[agent, 1]
        rho_0 = math.sqrt(ahead * ahead + left * left)
        settings = flock.law._replace(
            rho_0=rho_0, cos_b=ahead / rho_0, sin_b=left / rho_0, sign=1.0 if left > 0.0 else -1.0
        )
        wanted = law(settings, line, mean.motion.v, mean.motion.u if flock.knows_turn else 0.0)
        motion = limited(wanted, settings.v_max, settings.u_max)
        motions[0, agent], motions[1, agent] = wanted.v, motion.v
        motions[2, agent], motions[3, agent] = motion.u, rho
    for agent in range(len(state)):
        change[agent, 0] *= motions[1, agent]
        change[agent, 1] *= motions[1, agent]
        change[agent, 2] = motions[2, agent]


@kernel(inline=False)
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


@entry
def integrate(
    driven: Matrix,
    timing: Timing,
    first: Matrix,
    places: Matrix,
    allowed: FlagMatrix,
    flock: Flock,
    poses: Tensor,
    motions: Tensor,
    chosen: IndexTensor,
    clearances: Matrix,
) -> bool:
    """Fill ``poses`` (n, N, 3), ``motions`` (n, 4, N), ``chosen`` (n, N, k), ``clearances`` (n, N).

    ``driven`` is the leader's speed and turn rate at each step's start, middle and next start. Neighbours
    are chosen anew every so many steps of the classical Runge-Kutta method, and kept in between. False as
    soon as a pose is not finite.
    """
    agents, steps, step = len(first), (len(driven) - 1) // 2, timing.step
    state, trial = first.copy(), np.empty_like(first)
    changes, scratch = np.empty((4, agents, 3)), np.empty((4, agents))
    neighbours = np.empty(chosen.shape[1:], dtype=np.int64)
    for k in range(steps + 1):
        if k % timing.steps_per_choice == 0:
            choose(state, allowed, neighbours)
        start = Motion(driven[2 * k, 0], driven[2 * k, 1])
        rates(start, state, places, neighbours, flock, changes[0], scratch)
        if k % timing.steps_per_sample == 0:
            if not np.all(np.isfinite(state)):
                return False
            row = k // timing.steps_per_sample
            poses[row], motions[row], chosen[row] = state, scratch, neighbours
            _fill_clearances(state, clearances[row])
        if k == steps:
            break
        for stage in range(1, 4):
            reach = step if stage == 3 else 0.5 * step
            for agent in range(agents):
                for part in range(3):
                    trial[agent, part] = state[agent, part] + reach * changes[stage - 1, agent, part]
            at = 2 * k + (2 if stage == 3 else 1)
            leader = Motion(driven[at, 0], driven[at, 1])
            rates(leader, trial, places, neighbours, flock, changes[stage], scratch)
        for agent in range(agents):
            for part in range(3):
                middle = changes[1, agent, part] + changes[2, agent, part]
                total = changes[0, agent, part] + 2.0 * middle + changes[3, agent, part]
                state[agent, part] += step * total / 6.0
    return True
