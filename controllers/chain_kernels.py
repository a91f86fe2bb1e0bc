"""The chain of agents under the paper's laws and their limits, compiled: rates, and a Dormand-Prince solver.

The laws are those of :mod:`controllers.laws`, which they are tested against; all that a kernel calls is in
this one file because the cache of compiled code looks at the file of a kernel only. Importing this module
compiles the kernels for their one signature, or loads them from the cache.

A state is one row: for each pair (rho, alpha1, alpha2), then the first agent's x, y, theta; angles are not
wrapped. ``setting`` is mu1, mu2, rho_0, mu_rho, v_max, u_max, tilt, the station's cosine and sine, and 1 if a
follower knows its predecessor's turn rate, else 0. ``program`` is the first agent's: a kind and its numbers.
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

_F = TypeVar("_F", bound=Callable[..., object])

CONSTANT, SINUSOID, IMPULSE, TABLE = range(4)
"""Kinds of program. Numbers: v, u; v, mean, amplitude, omega; v, amplitude, centre, width; rows t, v, u."""

_MOST_STEPS = 20_000_000
_SAFETY, _LEAST_FACTOR, _MOST_FACTOR = 0.9, 0.2, 5.0
_ROW = types.float64[::1]
_ROWS = types.float64[:, ::1]

_INTEGRATE = (
    _ROW, types.float64, types.float64, types.float64, _ROW, _ROW, types.int64, _ROWS, _ROWS,
    types.float64[:, :, ::1], types.float64[:, :, ::1],
)  # fmt: skip

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

_QUARTERS = 2.0 / math.pi
_PI_HALF = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
_S = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
_COS = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)


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


@_compiled()
def _sine_and_cosine(angle: float) -> tuple[float, float]:
    """Both to the last bit but one, at a third of the cost of the two from the C library.

    The quarter turns are taken off with pi/2 in three parts, then both series (minimax, as in fdlibm) run on
    what is left. Angles of a chain stay far below the 2^20 quarter turns up to which this is exact.
    """
    quarters = math.floor(angle * _QUARTERS + 0.5)
    rest = ((angle - quarters * _PI_HALF[0]) - quarters * _PI_HALF[1]) - quarters * _PI_HALF[2]
    square = rest * rest
    sine = _S[5]
    for k in range(4, -1, -1):
        sine = _S[k] + square * sine
    cosine = _COS[5]
    for k in range(4, -1, -1):
        cosine = _COS[k] + square * cosine
    sine = rest + rest * square * sine
    cosine = 1.0 - 0.5 * square + square * square * cosine
    turned = quarters - 4.0 * math.floor(0.25 * quarters)
    if turned == 1.0:
        return cosine, -sine
    if turned == 2.0:
        return -sine, -cosine
    if turned == 3.0:
        return -cosine, sine
    return sine, cosine


@_compiled()
def _driven_by_program(t: float, kind: int, program: Matrix) -> tuple[float, float]:
    """Speed and turn rate of the first agent at time t."""
    if kind == CONSTANT:
        return program[0, 0], program[0, 1]
    if kind == SINUSOID:
        return program[0, 0], program[0, 1] + program[0, 2] * math.sin(program[0, 3] * t)
    if kind == IMPULSE:
        widths = (t - program[0, 2]) / program[0, 3]
        return program[0, 0], program[0, 1] * math.exp(-0.5 * widths * widths)
    after = np.searchsorted(program[0], t, side="right")
    if after == 0:
        return program[1, 0], program[2, 0]
    if after == program.shape[1]:
        return program[1, -1], program[2, -1]
    share = (t - program[0, after - 1]) / (program[0, after] - program[0, after - 1])
    v = (1.0 - share) * program[1, after - 1] + share * program[1, after]
    u = (1.0 - share) * program[2, after - 1] + share * program[2, after]
    return v, u


@_compiled()
def rates(
    t: float, state: Vector, setting: Vector, kind: int, program: Matrix, change: Vector, motions: Matrix
) -> None:
    """Fill the rate of every state, and for each agent the speed wanted, speed driven, turn rate driven."""
    mu1, mu2, rho_0, mu_rho = setting[0], setting[1], setting[2], setting[3]
    v_max, u_max, tilt, knows = setting[4], setting[5], setting[6], setting[9]
    cos_b, sin_b = setting[7], setting[8]
    sign, widened = 1.0 if sin_b > 0.0 else -1.0, 1.0 / sin_b
    v1, u1 = _driven_by_program(t, kind, program)
    motions[0, 0], motions[1, 0], motions[2, 0] = v1, v1, u1
    pairs = motions.shape[1] - 1
    heading = state[3 * pairs + 2]
    change[3 * pairs] = v1 * math.cos(heading)
    change[3 * pairs + 1] = v1 * math.sin(heading)
    change[3 * pairs + 2] = u1
    for pair in range(pairs):
        # A step that reaches across the predecessor has no rates, and is refused for that.
        rho = state[3 * pair] if state[3 * pair] > 0.0 else math.nan
        sin1, cos1 = _sine_and_cosine(state[3 * pair + 1])
        sin2, cos2 = _sine_and_cosine(state[3 * pair + 2])
        inverse = 1.0 / rho
        pull = (rho - rho_0) * inverse * ((rho + rho_0) * inverse)
        known = u1 if knows != 0.0 else 0.0
        turn = known + sign * v1 * mu_rho * pull - mu1 * (sin_b * cos1 - cos_b * sin1)
        wanted = (rho * turn - v1 * sin1) * widened
        v2 = _clip(wanted, v_max)
        away, along = sin2 * cos_b - cos2 * sin_b, cos2 * cos_b + sin2 * sin_b
        if wanted != v2:
            leaning = sign * tilt * ((wanted - v2) / abs(wanted)) * _clip(pull, 1.0)
            away = away * math.cos(leaning) + along * math.sin(leaning)
        line_rate = (v1 * sin1 + v2 * sin2) * inverse
        u2 = _clip(mu2 * away + line_rate, u_max)
        change[3 * pair] = -(v1 * cos1 + v2 * cos2)
        change[3 * pair + 1] = line_rate - u1
        change[3 * pair + 2] = line_rate - u2
        motions[0, pair + 1], motions[1, pair + 1], motions[2, pair + 1] = wanted, v2, u2
        v1, u1 = v2, u2


@_compiled()
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


@_compiled()
def _wrap(angle: float) -> float:
    if -math.pi < angle <= math.pi:
        return angle
    wrapped = angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))
    if wrapped <= -math.pi:
        return math.pi
    return min(wrapped, math.pi)


@_compiled()
def _place(state: Vector, poses: Matrix) -> None:
    """Fill the poses of all agents, each at the end of the line from its predecessor, and wrap all angles."""
    pairs = poses.shape[0] - 1
    x, y, theta = state[3 * pairs], state[3 * pairs + 1], state[3 * pairs + 2]
    for agent in range(pairs + 1):
        poses[agent, 0], poses[agent, 1], poses[agent, 2] = x, y, _wrap(theta)
        if agent < pairs:
            line = theta + state[3 * agent + 1]
            sine, cosine = _sine_and_cosine(line)
            x += state[3 * agent] * cosine
            y += state[3 * agent] * sine
            theta = line + math.pi - state[3 * agent + 2]
            state[3 * agent + 1] = _wrap(state[3 * agent + 1])
            state[3 * agent + 2] = _wrap(state[3 * agent + 2])


@_compiled(*_INTEGRATE)
def integrate(
    times: Vector,
    relative: float,
    absolute: float,
    longest_step: float,
    first: Vector,
    setting: Vector,
    kind: int,
    program: Matrix,
    states: Matrix,
    motions: Matrix,
    poses: Matrix,
) -> bool:
    """Fill ``states`` (n, m), ``motions`` (n, 3, agents) and ``poses`` (n, agents, 3) at the n times.

    False if the last time could not be reached. The angles of what is filled in are wrapped.

    Steps are as long as the largest local error of any state allows (``absolute + relative * |state|``), and
    at most ``longest_step``; between them the samples come from the method's own interpolant.
    """
    agents, size = motions.shape[2], len(first)
    stages = np.empty((7, size))
    moved, error = np.empty(size), 0.0
    now = first.copy()
    scratch = np.empty((3, agents))
    rates(times[0], now, setting, kind, program, stages[0], scratch)
    states[0] = now
    t, end, row = times[0], times[-1], 1
    step = min(longest_step, 1e-3, end - t)
    for _ in range(_MOST_STEPS):
        step = min(step, longest_step, end - t)
        if not step > 1e-14 * max(1.0, abs(t)):
            return False
        for stage in range(1, 7):
            moved[:] = now
            for earlier in range(stage):
                weight = step * _A[stage, earlier]
                for k in range(size):
                    moved[k] += weight * stages[earlier, k]
            rates(t + _C[stage] * step, moved, setting, kind, program, stages[stage], scratch)
        error = 0.0
        for k in range(size):
            total = 0.0
            for stage in range(7):
                total += _E[stage] * stages[stage, k]
            share = abs(step * total) / (absolute + relative * max(abs(now[k]), abs(moved[k])))
            # Not `max`: it would lose a NaN, which has to refuse the step.
            if not share <= error:
                error = share
        if not error <= 1.0:
            step *= max(_LEAST_FACTOR, _SAFETY * error**-0.2) if math.isfinite(error) else _LEAST_FACTOR
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
                rates(times[sample], states[sample], setting, kind, program, moved, motions[sample])
                _place(states[sample], poses[sample])
            return True
        step *= min(_MOST_FACTOR, _SAFETY * error**-0.2) if error > 0.0 else _MOST_FACTOR
    return False
