"""The leader's motion in scalars: coordinated turn, noise, and the follower's axes that it is seen along.

The state is ``[x, y, vx, vy, u]``: position [m], velocity [m/s] and turn rate [rad/s], in a fixed frame or
along the follower's axes (:mod:`estimation.models.motion` tells of both). These functions are the model; the
matrices there and the filters are made of them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.arc import Swing
from formation.kernel import kernel


class LeaderLimits(NamedTuple):
    """What is known of the leader: ``v_eps <= v1 <= k_v``, ``|u1| <= k_u`` (Assumption 1 of the paper)."""

    v_eps: float
    k_v: float
    k_u: float


class ProcessNoise(NamedTuple):
    """Spectral densities of the leader's motion.

    ``q_v`` [m^2/s^3] drives the speed, ``q_u`` [rad^2/s^3] the turn rate. ``v_eps`` [m/s] is the speed below
    which the direction of motion is not trusted, so that the noise of w becomes isotropic. A leader slower
    than that stands or sets off, which the model of steady driving knows nothing of: there w is driven by up
    to ``q_start`` [m^2/s^3] more. ``q_across`` [m^2/s^3] is the most that is isotropic otherwise: jumps of
    the speed say nothing of the direction.
    """

    q_v: float
    q_u: float
    v_eps: float
    q_start: float = 0.0
    q_across: float = math.inf

    @staticmethod
    def by_rule(limits: LeaderLimits, turn_bandwidth: float, speed_bandwidth: float = 0.01) -> ProcessNoise:
        """Noise per second from the leader's limits.

        q_v = speed_bandwidth k_v^2, q_u = turn_bandwidth k_u^2, and q_start = k_v^2: from rest to k_v within
        a second. A leader that changes its speed by steps of ``s`` k_v, one in ``T`` seconds, has a speed
        bandwidth of s^2 / T; one that drives evenly within a tenth of k_v has 0.01.
        """
        k_v, k_u = limits.k_v, limits.k_u
        return ProcessNoise(speed_bandwidth * k_v**2, turn_bandwidth * k_u**2, limits.v_eps, k_v**2)


class FollowerMotion(NamedTuple):
    """The follower's own motion as it is measured: speed v2 [m/s] and turn rate u2 [rad/s], with their sd."""

    v2: float
    u2: float
    sd_v2: float
    sd_u2: float


class State(NamedTuple):
    """Position [m], velocity [m/s] and turn rate [rad/s] of the leader."""

    x: float
    y: float
    vx: float
    vy: float
    u: float


class Spread(NamedTuple):
    """Symmetric 2x2 covariance."""

    xx: float
    xy: float
    yy: float


class Push(NamedTuple):
    """What an error does to position and velocity."""

    x: float
    y: float
    vx: float
    vy: float


@kernel
def mean_motion(a: FollowerMotion, b: FollowerMotion) -> FollowerMotion:
    """Mean motion over an interval, from the motions at its ends (trapezoid); deviations are the later's."""
    return FollowerMotion(0.5 * (a.v2 + b.v2), 0.5 * (a.u2 + b.u2), b.sd_v2, b.sd_u2)


@kernel
def moved(state: State, leader: Swing) -> State:
    """State after the time of a swing by its own turn rate, in a fixed frame; exact for constant v1, u1.

    p' = p + [[S, -C], [C, S]] w,  w' = R(u dt) w,  with S, C the integrals of cos(u t), sin(u t).
    """
    wx, wy = state.vx, state.vy
    return State(
        state.x + leader.s * wx - leader.c * wy,
        state.y + leader.c * wx + leader.s * wy,
        leader.cos * wx - leader.sin * wy,
        leader.sin * wx + leader.cos * wy,
        state.u,
    )


@kernel
def by_turn_rate(before: State, after: State, leader: Swing, dt: float) -> Push:
    """Derivative by u of the state ``after`` dt [s], in a fixed frame."""
    return Push(
        leader.s_by_u * before.vx - leader.c_by_u * before.vy,
        leader.c_by_u * before.vx + leader.s_by_u * before.vy,
        -dt * after.vy,
        dt * after.vx,
    )


@kernel
def acceleration(vx: float, vy: float, noise: ProcessNoise) -> Spread:
    """Density [m^2/s^3] of the white acceleration of a leader that drives with this velocity."""
    squared, floor = vx * vx + vy * vy, noise.v_eps * noise.v_eps
    weight = noise.q_v / (squared + floor)
    start = noise.q_start * max(0.0, 1.0 - squared / floor)
    even = floor if noise.q_v <= noise.q_across else floor * (noise.q_across / noise.q_v)
    return Spread(weight * (vx * vx + even) + start, weight * vx * vy, weight * (vy * vy + even) + start)


@kernel
def along_follower(state: State, v2: float, own: Swing) -> State:
    """State along the axes of a follower that has meanwhile driven at v2 [m/s] and turned by a swing.

    The axes follow its displacement d and turn phi: p' = R(-phi) (p - d), w' = R(-phi) w.
    """
    x, y = state.x - v2 * own.s, state.y - v2 * own.c
    return State(
        own.cos * x + own.sin * y,
        own.cos * y - own.sin * x,
        own.cos * state.vx + own.sin * state.vy,
        own.cos * state.vy - own.sin * state.vx,
        state.u,
    )


@kernel
def by_own_speed(own: Swing) -> Push:
    """Derivative by v2 of a state along the follower's axes."""
    return Push(-(own.cos * own.s + own.sin * own.c), -(own.cos * own.c - own.sin * own.s), 0.0, 0.0)


@kernel
def by_own_turn(after: State, v2: float, own: Swing, dt: float) -> Push:
    """Derivative by u2 of a state along the follower's axes, ``after`` dt [s]."""
    x = own.cos * own.s_by_u + own.sin * own.c_by_u
    y = own.cos * own.c_by_u - own.sin * own.s_by_u
    return Push(dt * after.y - v2 * x, -dt * after.x - v2 * y, dt * after.vy, -dt * after.vx)


@kernel
def input_density(correlation: float, dt: float) -> float:
    """Factor [1] on sd^2 by which an input error of this correlation time [s] acts over a step of dt [s].

    White noise of density 2 sd^2 correlation over a step has the mean variance 2 sd^2 correlation / dt.
    """
    return 2.0 * correlation / dt if dt > 0.0 else 0.0
