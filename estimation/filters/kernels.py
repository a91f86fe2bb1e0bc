"""Predict and update of the coordinated-turn filters, compiled.

The model is that of :mod:`estimation.models.motion`, which it is tested against; the fixed frame is the
frame of a follower that stands still. All of it is in this one file because the cache of compiled code looks
at the file of a kernel only: what it called from elsewhere could change unnoticed. Importing this module
compiles the kernels for their one signature, or loads them from the cache.

Each kernel leaves its arguments alone and fills the mean ``after`` (5,) and the covariance ``joint`` (5, 5),
which may share no memory with them: handing back new arrays would cost more than the arithmetic does. Only
:func:`update` may be given the same arrays for both.

A rotation or a turn integral is a 2x2 matrix [[a, -b], [b, a]] and is written as its pair (a, b).
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
Pair = tuple[float, float]
State = tuple[float, float, float, float, float]
Swing = tuple[Pair, Pair, Pair]
"""Of a turn u t over dt: its rotation, the integral of that over time, and the derivative of this by u."""
Jacobian = tuple[Pair, Pair, Pair, Pair, Pair]
"""Blocks of a transition: p by p, p by w, w by w, and the columns of p and of w by the turn rate."""

_F = TypeVar("_F", bound=Callable[..., object])

_SIZE = 5
_SMALL_TURN = 1e-3

_ANY_VECTOR = types.Array(types.float64, 1, "A", readonly=True)
_ANY_MATRIX = types.Array(types.float64, 2, "A", readonly=True)
_RESULT = (types.float64[::1], types.float64[:, ::1])
_PREDICT = (
    _ANY_VECTOR,
    _ANY_MATRIX,
    types.float64,
    *(types.float64,) * 4,
    _ANY_VECTOR,
    *_RESULT,
)
_UPDATE = (_ANY_VECTOR, _ANY_MATRIX, _ANY_VECTOR, _ANY_MATRIX, *_RESULT)
_STEP = (*_PREDICT[:-2], _ANY_VECTOR, _ANY_MATRIX, types.float64, *_RESULT)


def _compiled(*signature: object) -> Callable[[_F], _F]:
    """Compile for one signature now, or without one for whatever a kernel calls the function with."""
    compiler: Any = njit(signature or None, cache=True, fastmath=False, error_model="numpy")
    decorate: Callable[[_F], _F] = compiler
    return decorate


@_compiled()
def _times(a: Pair, b: Pair) -> Pair:
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


@_compiled()
def _swing(u: float, dt: float) -> Swing:
    a = u * dt
    if abs(a) < _SMALL_TURN:
        return (
            (1.0 - a * a * (0.5 - a * a / 24.0), a * (1.0 - a * a * (1.0 / 6.0 - a * a / 120.0))),
            (dt * (1.0 - a * a / 6.0), dt * (a / 2.0 - a * a * a / 24.0)),
            (dt * dt * (-a / 3.0 + a * a * a / 30.0), dt * dt * (0.5 - a * a / 8.0)),
        )
    half = math.sin(0.5 * a)
    sin_a, versed = 2.0 * half * math.cos(0.5 * a), 2.0 * half * half
    cos_a = 1.0 - versed
    s, c = sin_a / u, versed / u
    return (cos_a, sin_a), (s, c), ((dt * cos_a - s) / u, (dt * sin_a - c) / u)


@_compiled()
def _moved(p: Pair, w: Pair, leader: Swing, arc: Pair, back: Pair) -> tuple[Pair, Pair]:
    """Position and velocity after the leader's swing, along axes that moved by ``arc``, then are turned."""
    step = _times(leader[1], w)
    moved = _times(back, (p[0] + step[0] - arc[0], p[1] + step[1] - arc[1]))
    return moved, _times(back, _times(leader[0], w))


@_compiled()
def _jacobian(w: Pair, leader: Swing, dt: float, back: Pair) -> Jacobian:
    turn = _times(back, leader[0])
    swung = _times(turn, w)
    return (
        back,
        _times(back, leader[1]),
        turn,
        _times(back, _times(leader[2], w)),
        (-dt * swung[1], dt * swung[0]),
    )


@_compiled()
def _carried(f: Jacobian, a: float, b: float, c: float, d: float, e: float) -> State:
    """Multiply a state-sized column by the transition."""
    pp, pw, ww, pu, wu = f
    return (
        pp[0] * a - pp[1] * b + pw[0] * c - pw[1] * d + pu[0] * e,
        pp[1] * a + pp[0] * b + pw[1] * c + pw[0] * d + pu[1] * e,
        ww[0] * c - ww[1] * d + wu[0] * e,
        ww[1] * c + ww[0] * d + wu[1] * e,
        e,
    )


@_compiled()
def _mirror(covariance: Matrix) -> None:
    """Replace both triangles by their mean."""
    for i in range(_SIZE):
        for j in range(i):
            mean = 0.5 * (covariance[i, j] + covariance[j, i])
            covariance[i, j] = mean
            covariance[j, i] = mean


@_compiled()
def _add_noise(covariance: Matrix, w: Pair, dt: float, back: Pair, noise: Vector) -> None:
    """Add the noise of the leader's motion, ``w`` being its velocity before the step."""
    q_v, q_u, v_eps, q_start = noise[0], noise[1], noise[2], noise[3]
    squared, floor = w[0] * w[0] + w[1] * w[1], v_eps * v_eps
    weight = q_v / (squared + floor)
    start = q_start * max(0.0, 1.0 - squared / floor)
    wx, wy = _times(back, w)
    xx, xy, yy = weight * (wx * wx + floor) + start, weight * wx * wy, weight * (wy * wy + floor) + start
    for i, j, share in ((0, 0, dt * dt * dt / 3.0), (0, 2, dt * dt / 2.0), (2, 0, dt * dt / 2.0), (2, 2, dt)):
        covariance[i, j] += share * xx
        covariance[i, j + 1] += share * xy
        covariance[i + 1, j] += share * xy
        covariance[i + 1, j + 1] += share * yy
    covariance[4, 4] += q_u * dt


@_compiled()
def _add_input_noise(
    covariance: Matrix, p: Pair, w: Pair, dt: float, v2: float, own: Swing, speed: float, turn: float
) -> None:
    """Add what white errors of v2 and u2 of these densities do; ``p``, ``w`` are those after the step."""
    back = (own[0][0], -own[0][1])
    ax, ay = _times(back, own[1])
    bx, by = _times(back, own[2])
    by_v2 = (-ax, -ay, 0.0, 0.0)
    by_u2 = (dt * p[1] - v2 * bx, -dt * p[0] - v2 * by, dt * w[1], -dt * w[0])
    for i in range(4):
        for j in range(4):
            covariance[i, j] += speed * by_v2[i] * by_v2[j] + turn * by_u2[i] * by_u2[j]


@_compiled(*_PREDICT)
def extended_predict(
    mean: Vector,
    covariance: Matrix,
    dt: float,
    v2: float,
    u2: float,
    sd_v2: float,
    sd_u2: float,
    noise: Vector,
    after: Vector,
    joint: Matrix,
) -> None:
    """Carry mean (5,) and covariance (5, 5) through dt [s] by linearisation: F P F' + Q.

    v2 [m/s], u2 [rad/s] and their sd are the follower's, all zero for the fixed frame. ``noise`` (5,): q_v,
    q_u, v_eps, q_start of ``motion.ProcessNoise`` and the correlation time [s] of the errors of v2 and u2.
    """
    own = _swing(u2, dt)
    arc, back = (v2 * own[1][0], v2 * own[1][1]), (own[0][0], -own[0][1])
    w, u = (mean[2], mean[3]), mean[4]
    leader = _swing(u, dt)
    p_next, w_next = _moved((mean[0], mean[1]), w, leader, arc, back)
    f = _jacobian(w, leader, dt, back)
    for j in range(_SIZE):
        column = _carried(
            f, covariance[0, j], covariance[1, j], covariance[2, j], covariance[3, j], covariance[4, j]
        )
        for i in range(_SIZE):
            joint[i, j] = column[i]
    for i in range(_SIZE):
        row = _carried(f, joint[i, 0], joint[i, 1], joint[i, 2], joint[i, 3], joint[i, 4])
        for j in range(_SIZE):
            joint[i, j] = row[j]
    _add_noise(joint, w, dt, back, noise)
    white = 2.0 * noise[4] / dt if dt > 0.0 else 0.0
    _add_input_noise(joint, p_next, w_next, dt, v2, own, sd_v2 * sd_v2 * white, sd_u2 * sd_u2 * white)
    _mirror(joint)
    after[0], after[1], after[2], after[3], after[4] = p_next[0], p_next[1], w_next[0], w_next[1], u


@_compiled()
def _scaled_root(covariance: Matrix) -> Matrix:
    """Lower triangular root of ``_SIZE`` times a covariance; a direction without variance gets a zero column.

    A pivot that rounding has made negative is such a direction too, so that nothing ever turns into nan.
    """
    root = np.zeros((_SIZE, _SIZE))
    for j in range(_SIZE):
        pivot = _SIZE * covariance[j, j]
        for k in range(j):
            pivot -= root[j, k] * root[j, k]
        if pivot <= 0.0:
            continue
        root[j, j] = math.sqrt(pivot)
        for i in range(j + 1, _SIZE):
            rest = _SIZE * covariance[i, j]
            for k in range(j):
                rest -= root[i, k] * root[j, k]
            root[i, j] = rest / root[j, j]
    return root


@_compiled(*_PREDICT)
def unscented_predict(
    mean: Vector,
    covariance: Matrix,
    dt: float,
    v2: float,
    u2: float,
    sd_v2: float,
    sd_u2: float,
    noise: Vector,
    after: Vector,
    joint: Matrix,
) -> None:
    """Carry mean (5,) and covariance (5, 5) through dt [s] by ten equally weighted points (cubature rule).

    Arguments as for :func:`extended_predict`.
    """
    own = _swing(u2, dt)
    arc, back = (v2 * own[1][0], v2 * own[1][1]), (own[0][0], -own[0][1])
    root = _scaled_root(covariance)
    points = np.empty((2 * _SIZE, _SIZE))
    after[:] = 0.0
    for k in range(2 * _SIZE):
        sign, j = (1.0, k) if k < _SIZE else (-1.0, k - _SIZE)
        p = (mean[0] + sign * root[0, j], mean[1] + sign * root[1, j])
        w = (mean[2] + sign * root[2, j], mean[3] + sign * root[3, j])
        u = mean[4] + sign * root[4, j]
        p, w = _moved(p, w, _swing(u, dt), arc, back)
        points[k, 0], points[k, 1], points[k, 2], points[k, 3], points[k, 4] = p[0], p[1], w[0], w[1], u
        for i in range(_SIZE):
            after[i] += points[k, i] / (2 * _SIZE)
    joint[:] = 0.0
    for k in range(2 * _SIZE):
        for i in range(_SIZE):
            for j in range(_SIZE):
                joint[i, j] += (points[k, i] - after[i]) * (points[k, j] - after[j]) / (2 * _SIZE)
    p, w = (mean[0], mean[1]), (mean[2], mean[3])
    p_next, w_next = _moved(p, w, _swing(mean[4], dt), arc, back)
    _add_noise(joint, w, dt, back, noise)
    white = 2.0 * noise[4] / dt if dt > 0.0 else 0.0
    _add_input_noise(joint, p_next, w_next, dt, v2, own, sd_v2 * sd_v2 * white, sd_u2 * sd_u2 * white)
    _mirror(joint)


@_compiled()
def _weighed(x: float, y: float, a: float, b: float, c: float) -> Pair:
    """Multiply a row by the symmetric [[a, b], [b, c]]."""
    return x * a + y * b, x * b + y * c


@_compiled(*_UPDATE)
def update(
    mean: Vector, covariance: Matrix, position: Vector, spread: Matrix, after: Vector, joint: Matrix
) -> None:
    """Take in that the leader was seen at ``position`` (2,) with covariance ``spread`` (2, 2).

    Joseph form. As the position is part of the state, sigma points would give the same gain. Every element
    is read before it is written, so that ``after`` and ``joint`` may be ``mean`` and ``covariance``.
    """
    ra, rb, rc = spread[0, 0], spread[0, 1], spread[1, 1]
    a, b, c = covariance[0, 0] + ra, covariance[0, 1] + rb, covariance[1, 1] + rc
    det = a * c - b * b
    ia, ib, ic = c / det, -b / det, a / det
    x, y = position[0] - mean[0], position[1] - mean[1]
    gain = (
        _weighed(covariance[0, 0], covariance[0, 1], ia, ib, ic),
        _weighed(covariance[1, 0], covariance[1, 1], ia, ib, ic),
        _weighed(covariance[2, 0], covariance[2, 1], ia, ib, ic),
        _weighed(covariance[3, 0], covariance[3, 1], ia, ib, ic),
        _weighed(covariance[4, 0], covariance[4, 1], ia, ib, ic),
    )
    for i in range(_SIZE):
        after[i] = mean[i] + gain[i][0] * x + gain[i][1] * y
    # What is left of the position, 1 - K, as R / S: a difference of two near ones would lose its digits.
    left = ((ra * ia + rb * ib, ra * ib + rb * ic), (rb * ia + rc * ib, rb * ib + rc * ic))
    for j in range(_SIZE):
        first, second = covariance[0, j], covariance[1, j]
        joint[0, j] = left[0][0] * first + left[0][1] * second
        joint[1, j] = left[1][0] * first + left[1][1] * second
        for i in range(2, _SIZE):
            joint[i, j] = covariance[i, j] - gain[i][0] * first - gain[i][1] * second
    for i in range(_SIZE):
        first, second = joint[i, 0], joint[i, 1]
        joint[i, 0] = first * left[0][0] + second * left[0][1]
        joint[i, 1] = first * left[1][0] + second * left[1][1]
        for j in range(2, _SIZE):
            joint[i, j] -= first * gain[j][0] + second * gain[j][1]
        by_x, by_y = gain[i][0] * ra + gain[i][1] * rb, gain[i][0] * rb + gain[i][1] * rc
        for j in range(_SIZE):
            joint[i, j] += by_x * gain[j][0] + by_y * gain[j][1]
    _mirror(joint)


@_compiled()
def _gated_update(mean: Vector, covariance: Matrix, position: Vector, spread: Matrix, gate: float) -> float:
    """Take a measurement into mean and covariance themselves if its NIS is within the gate; the NIS."""
    a, b, c = (
        covariance[0, 0] + spread[0, 0],
        covariance[0, 1] + spread[0, 1],
        covariance[1, 1] + spread[1, 1],
    )
    x, y = position[0] - mean[0], position[1] - mean[1]
    nis: float = (c * x * x - 2.0 * b * x * y + a * y * y) / (a * c - b * b)
    if nis <= gate:
        update(mean, covariance, position, spread, mean, covariance)
    return nis


@_compiled(*_STEP)
def extended_step(
    mean: Vector,
    covariance: Matrix,
    dt: float,
    v2: float,
    u2: float,
    sd_v2: float,
    sd_u2: float,
    noise: Vector,
    position: Vector,
    spread: Matrix,
    gate: float,
    after: Vector,
    joint: Matrix,
) -> float:
    """:func:`extended_predict`, gate and :func:`update` in one call; the measurement's NIS.

    A measurement whose NIS is above ``gate``, or is not a number, leaves the prediction as it is.
    """
    extended_predict(mean, covariance, dt, v2, u2, sd_v2, sd_u2, noise, after, joint)
    return _gated_update(after, joint, position, spread, gate)


@_compiled(*_STEP)
def unscented_step(
    mean: Vector,
    covariance: Matrix,
    dt: float,
    v2: float,
    u2: float,
    sd_v2: float,
    sd_u2: float,
    noise: Vector,
    position: Vector,
    spread: Matrix,
    gate: float,
    after: Vector,
    joint: Matrix,
) -> float:
    """:func:`unscented_predict`, gate and :func:`update` in one call, as :func:`extended_step`."""
    unscented_predict(mean, covariance, dt, v2, u2, sd_v2, sd_u2, noise, after, joint)
    return _gated_update(after, joint, position, spread, gate)
