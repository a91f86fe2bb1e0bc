"""How wrong the filter that flies can get under noise and acceleration that are bounded, and nothing else.

The extended filter of the world front end, once settled, is a linear filter with constant gains about a
leader that drives at v1 and turns at u1, seen along the leader's own axes. The error of its velocity is then
a weighted sum of the noise of all frames and of the accelerations between them, and the largest value of
such a sum under bounds is the sum of the weights' sizes: the L1 norm of its impulse responses. When an
estimate is used does not matter, as it speaks of the capture time.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.motion import STATE_SIZE, Matrix, process_noise_body, transition_body
from formation.angles import FloatArray

_SPEEDS = 3
_DIRECTIONS = 24
_SETTLED = 1e-9
_FORGOTTEN = 1e-7
_MOST_FRAMES = 20_000
_PLACE, _VELOCITY = slice(0, 2), slice(2, 4)


class FlyingFilter(NamedTuple):
    """A filter as it flies: sd of a position per axis [m], period of frames [s], noise, leader's limits."""

    sigma: float
    period: float
    noise: ProcessNoise
    limits: LeaderLimits


class Disturbances(NamedTuple):
    """Bounds, each in any direction: errors of measured positions [m], the leader's acceleration [m/s^2]."""

    position: float
    acceleration: float


class Responses(NamedTuple):
    """Largest errors of the filter's velocity [m/s] and position [m]."""

    velocity: float
    position: float


class ErrorDynamics(NamedTuple):
    """Error dynamics from frame to frame, e' = M e + K n - B a, along the leader's axes.

    n: error of the frame's position; a: acceleration that the model does not know of, since the frame before.
    """

    M: Matrix
    K: Matrix
    B: Matrix


@lru_cache(maxsize=64)
def worst_responses(flying: FlyingFilter, bounds: Disturbances) -> Responses:
    """Worst case over leaders at v_eps to k_v that turn at k_u, in the worst direction of the plane."""
    limits = flying.limits
    speeds = np.linspace(limits.v_eps, max(limits.k_v, limits.v_eps), _SPEEDS)
    found = [response(error_dynamics(flying, float(v1), limits.k_u), bounds) for v1 in speeds]
    return Responses(max(each.velocity for each in found), max(each.position for each in found))


def error_dynamics(flying: FlyingFilter, v1: float, u1: float) -> ErrorDynamics:
    """Error dynamics of the settled filter about a leader that drives at v1 [m/s] and turns at u1 [rad/s]."""
    period, along = flying.period, FollowerMotion(0.0, u1, 0.0, 0.0)
    mean = np.array([0.0, 0.0, v1, 0.0, u1])
    # Axes that turn with the leader: those of somebody who stands and turns as it does.
    F = transition_body(mean, period, along)
    Q = process_noise_body(mean, period, flying.noise, along, 0.0)
    K = _settled_gain(F, Q, flying.sigma)
    rest = np.eye(STATE_SIZE) - K @ np.eye(2, STATE_SIZE)
    push = np.zeros((STATE_SIZE, 2))
    push[_PLACE], push[_VELOCITY] = 0.5 * period * period * np.eye(2), period * np.eye(2)
    return ErrorDynamics(rest @ F, K, rest @ push)


def response(dynamics: ErrorDynamics, bounds: Disturbances) -> Responses:
    """L1 norms of the impulse responses times the bounds, in the worst direction."""
    noise, pushed = _weights(dynamics.M, dynamics.K), _weights(dynamics.M, dynamics.B)
    return Responses(
        *(
            float(
                np.max(
                    bounds.position * _worst(noise[:, rows]) + bounds.acceleration * _worst(pushed[:, rows])
                )
            )
            for rows in (_VELOCITY, _PLACE)
        )
    )


def _worst(weights: FloatArray) -> FloatArray:
    """Per direction the sum of the sizes of weights (n, 2, 2) on vectors; safely above all between.

    A direction between two of the grid is at most half a step away from one: the sum is the length of a
    convex combination of theirs, and so at most theirs over the cosine of half a step.
    """
    angles = np.pi / _DIRECTIONS * np.arange(_DIRECTIONS)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    sums = np.linalg.norm(np.einsum("di,nij->dnj", directions, weights), axis=2).sum(axis=1)
    safe: FloatArray = sums / math.cos(0.5 * np.pi / _DIRECTIONS)
    return safe


def _weights(M: Matrix, first: Matrix) -> FloatArray:
    """Impulse responses (n, 4, 2) of position and velocity, until they are forgotten."""
    weights: list[Matrix] = []
    now = first
    largest = float(np.abs(first).max())
    while len(weights) < _MOST_FRAMES and float(np.abs(now).max()) > _FORGOTTEN * largest:
        weights.append(now[:4])
        now = M @ now
    return np.array(weights)


def _settled_gain(F: Matrix, Q: Matrix, sigma: float) -> Matrix:
    """Gain (5, 2) that the filter's settles to."""
    H, R = np.eye(2, STATE_SIZE), sigma * sigma * np.eye(2)
    P: Matrix = np.eye(STATE_SIZE)
    gain: Matrix = np.zeros((STATE_SIZE, 2))
    for _ in range(_MOST_FRAMES):
        ahead = F @ P @ F.T + Q
        K: Matrix = np.asarray(np.linalg.solve(ahead[:2, :2] + R, ahead[:2]).T, dtype=np.float64)
        rest = np.eye(STATE_SIZE) - K @ H
        P = rest @ ahead @ rest.T + K @ R @ K.T
        moved = float(np.abs(K - gain).max())
        gain = K
        if moved <= _SETTLED * float(np.abs(K).max()):
            break
    return gain
