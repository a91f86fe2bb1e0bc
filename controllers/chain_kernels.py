"""The chain of agents under the law and its limits, compiled: rates, and a Dormand-Prince solver.

Importing this module compiles the entries for their one signature, or loads them from the cache.

A state is one row: for each pair (rho, alpha1, alpha2), then the first agent's x, y, theta; angles are not
wrapped. ``chain`` holds the numbers of the law, and the first agent's program.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from controllers.laws import LawSettings, law
from controllers.limits import limited
from formation.kernel import entry, kernel
from formation.leader import Program, TableRow, driven
from formation.line import Line
from formation.records import Matrix, Rows, Tensor, Vector, borrowed
from formation.trig import sine_and_cosine
from formation.wrapping import wrapped

_MOST_STEPS = 20_000_000
_SAFETY, _LEAST_FACTOR, _MOST_FACTOR = 0.9, 0.2, 5.0


class Chain(NamedTuple):
    """Law of all followers, program of the first agent; whether a follower is told its predecessor's u."""

    law: LawSettings
    program: Program
    knows_turn: bool


class Solver(NamedTuple):
    """Tolerances on each state, relative and absolute, and the longest step [s]."""

    relative: float
    absolute: float
    longest_step: float


# Dormand and Prince, 5(4): nodes, stages, error; the last stage's weights are the step's own.
_C = (0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0)
_A = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
        [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
        [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
        [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
        [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
    ]
)
_E = np.array(
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0]
)
# Weights of the fourth-order interpolant that goes with the method (Hairer, Norsett, Wanner, II.6).
_D = np.array(
    [
        -12715105075.0 / 11282082432.0,
        0.0,
        87487479700.0 / 32700410799.0,
        -10690763975.0 / 1880347072.0,
        701980252875.0 / 199316789632.0,
        -1453857185.0 / 822651844.0,
        69997945.0 / 29380423.0,
    ]
)


@kernel(inline=False)
def rates(
    t: float, state: Vector, chain: Chain, table: Rows[TableRow], change: Vector, motions: Matrix
) -> None:
    """Fill the rate of every state, and for each agent the speed wanted, speed driven, turn rate driven.

    ``table``: rows of a program that is one.
    """
    settings = chain.law
    leader = driven(chain.program, table, t)
    v1, u1 = leader.v, leader.u
    motions[0, 0], motions[1, 0], motions[2, 0] = v1, v1, u1
    pairs = motions.shape[1] - 1
    heading = state[3 * pairs + 2]
    change[3 * pairs] = v1 * math.cos(heading)
    change[3 * pairs + 1] = v1 * math.sin(heading)
    change[3 * pairs + 2] = u1
    for pair in range(pairs):
        # A step that reaches across the predecessor has no rates, and is refused for that.
        rho = state[3 * pair] if state[3 * pair] > 0.0 else math.nan
        sin1, cos1 = sine_and_cosine(state[3 * pair + 1])
        sin2, cos2 = sine_and_cosine(state[3 * pair + 2])
        wanted = law(settings, Line(rho, cos1, sin1, cos2, sin2), v1, u1 if chain.knows_turn else 0.0)
        motion = limited(wanted, settings.v_max, settings.u_max)
        line_rate = (v1 * sin1 + motion.v * sin2) / rho
        change[3 * pair] = -(v1 * cos1 + motion.v * cos2)
        change[3 * pair + 1] = line_rate - u1
        change[3 * pair + 2] = line_rate - motion.u
        motions[0, pair + 1], motions[1, pair + 1], motions[2, pair + 1] = wanted.v, motion.v, motion.u
        v1, u1 = motion.v, motion.u


@kernel(inline=False)
def _interpolate(
    share: float, step: float, now: Vector, moved: Vector, stages: Matrix, result: Vector
) -> None:
    """State at a share of the step, to fourth order."""
    rest = 1.0 - share
    for k in range(len(now)):
        gap = moved[k] - now[k]
        bend = step * stages[0, k] - gap
        total = 0.0
        for stage in range(7):
            total += _D[stage] * stages[stage, k]
        twist = gap - step * stages[6, k] - bend
        result[k] = now[k] + share * (gap + rest * (bend + share * (twist + rest * step * total)))


@kernel(inline=False)
def _place(state: Vector, poses: Matrix) -> None:
    """Fill the poses of all agents, each at the end of the line from its predecessor, and wrap all angles."""
    pairs = poses.shape[0] - 1
    x, y, theta = state[3 * pairs], state[3 * pairs + 1], state[3 * pairs + 2]
    for agent in range(pairs + 1):
        poses[agent, 0], poses[agent, 1], poses[agent, 2] = x, y, wrapped(theta)
        if agent < pairs:
            line = theta + state[3 * agent + 1]
            sine, cosine = sine_and_cosine(line)
            x += state[3 * agent] * cosine
            y += state[3 * agent] * sine
            theta = line + math.pi - state[3 * agent + 2]
            state[3 * agent + 1] = wrapped(state[3 * agent + 1])
            state[3 * agent + 2] = wrapped(state[3 * agent + 2])


@kernel
def _factor(error: float) -> float:
    """Factor of the next step's length, by the error of this one > 0: for a method of fifth order."""
    return _SAFETY * math.exp(-0.2 * math.log(error))


@entry
def rates_at(
    t: float, state: Vector, chain: Chain, table: Rows[TableRow], change: Vector, motions: Matrix
) -> None:
    """Do :func:`rates`, for other solvers."""
    rates(t, state, chain, borrowed(table), change, motions)


@entry
def integrate(
    times: Vector,
    solver: Solver,
    first: Vector,
    chain: Chain,
    table: Rows[TableRow],
    states: Matrix,
    motions: Tensor,
    poses: Tensor,
) -> bool:
    """Fill ``states`` (n, m), ``motions`` (n, 3, agents) and ``poses`` (n, agents, 3) at the n times.

    False if the last time could not be reached. The angles of what is filled in are wrapped.

    Steps are as long as the largest local error of any state allows (``absolute + relative * |state|``), and
    at most ``longest_step``; between them the samples come from the method's own interpolant.
    """
    agents, size, rows = motions.shape[2], len(first), borrowed(table)
    stages = np.empty((7, size))
    moved, error = np.empty(size), 0.0
    now = first.copy()
    scratch = np.empty((3, agents))
    rates(times[0], now, chain, rows, stages[0], scratch)
    states[0] = now
    t, end, row = times[0], times[-1], 1
    step = min(solver.longest_step, 1e-3, end - t)
    for _ in range(_MOST_STEPS):
        step = min(step, solver.longest_step, end - t)
        if not step > 1e-14 * max(1.0, abs(t)):
            return False
        for stage in range(1, 7):
            moved[:] = now
            for earlier in range(stage):
                weight = step * _A[stage, earlier]
                for k in range(size):
                    moved[k] += weight * stages[earlier, k]
            rates(t + _C[stage] * step, moved, chain, rows, stages[stage], scratch)
        error = 0.0
        for k in range(size):
            total = 0.0
            for stage in range(7):
                total += _E[stage] * stages[stage, k]
            share = abs(step * total) / (solver.absolute + solver.relative * max(abs(now[k]), abs(moved[k])))
            # Not `max`: it would lose a NaN, which has to refuse the step.
            if not share <= error:
                error = share
        if not error <= 1.0:
            step *= max(_LEAST_FACTOR, _factor(error)) if math.isfinite(error) else _LEAST_FACTOR
            continue
        after = end if step == end - t else t + step
        while row < len(times) and times[row] <= after:
            _interpolate((times[row] - t) / step, step, now, moved, stages, states[row])
            row += 1
        t = after
        now[:] = moved
        stages[0] = stages[6]
        if row == len(times):
            for sample in range(row):
                rates(times[sample], states[sample], chain, rows, moved, motions[sample])
                _place(states[sample], poses[sample])
            return True
        step *= min(_MOST_FACTOR, _factor(error)) if error > 0.0 else _MOST_FACTOR
    return False
