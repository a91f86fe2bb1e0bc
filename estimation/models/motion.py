"""Coordinated-turn motion of the leader, in a fixed frame and in the follower's moving body frame.

State ``[px, py, wx, wy, u1]``: leader position [m], leader velocity [m/s] and leader turn rate [rad/s].
In the fixed frame p and w are mocap coordinates. In the body frame p is the leader's position seen from the
follower, and w the leader's *absolute* velocity, both along the follower's axes (x ahead, y to its left).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

STATE_SIZE = 5
_SMALL_TURN = 1e-3  # below it the series of the turn integrals are exact to 1e-16


@dataclass(frozen=True, slots=True)
class LeaderLimits:
    """What is known of the leader: ``v_eps <= v1 <= k_v``, ``|u1| <= k_u`` (Assumption 1 of the paper)."""

    v_eps: float
    k_v: float
    k_u: float


@dataclass(frozen=True, slots=True)
class ProcessNoise:
    """Spectral densities of the leader's motion.

    ``q_v`` [m^2/s^3] drives the speed, ``q_u`` [rad^2/s^3] the turn rate. ``v_eps`` [m/s] is the speed below
    which the direction of motion is not trusted, so that the noise of w becomes isotropic. A leader slower
    than that stands or sets off, which the model of steady driving knows nothing of: there w is driven by up
    to ``q_start`` [m^2/s^3] more.
    """

    q_v: float
    q_u: float
    v_eps: float
    q_start: float = 0.0

    @staticmethod
    def by_rule(limits: LeaderLimits, turn_bandwidth: float, speed_bandwidth: float = 0.01) -> ProcessNoise:
        """Noise per second from the leader's limits.

        q_v = speed_bandwidth k_v^2, q_u = turn_bandwidth k_u^2, and q_start = k_v^2: from rest to k_v within
        a second. A leader that changes its speed by steps of ``s`` k_v, one in ``T`` seconds, has a speed
        bandwidth of s^2 / T; one that drives evenly within a tenth of k_v has 0.01.
        """
        k_v, k_u = limits.k_v, limits.k_u
        return ProcessNoise(speed_bandwidth * k_v**2, turn_bandwidth * k_u**2, limits.v_eps, k_v**2)


@dataclass(frozen=True, slots=True)
class FollowerMotion:
    """The follower's own motion as it is measured: speed v2 [m/s] and turn rate u2 [rad/s], with their sd."""

    v2: float
    u2: float
    sd_v2: float
    sd_u2: float


def turn_integrals(u: float, dt: float) -> tuple[float, float, float, float]:
    """Integrals over dt of cos(u t) and sin(u t), and their derivatives with respect to u."""
    a = u * dt
    if abs(a) < _SMALL_TURN:
        return (
            dt * (1.0 - a * a / 6.0),
            dt * (a / 2.0 - a**3 / 24.0),
            dt * dt * (-a / 3.0 + a**3 / 30.0),
            dt * dt * (0.5 - a * a / 8.0),
        )
    sin_a, cos_a = math.sin(a), math.cos(a)
    s, c = sin_a / u, 2.0 * math.sin(a / 2.0) ** 2 / u
    return s, c, (dt * cos_a - s) / u, (dt * sin_a - c) / u


def propagate(mean: Vector, dt: float) -> Vector:
    """Move the state (5,) through dt [s] of coordinated turn in a fixed frame; exact for constant v1, u1.

    p' = p + [[S, -C], [C, S]] w,  w' = R(u1 dt) w,  with S, C the integrals of cos(u1 t), sin(u1 t).
    """
    px, py, wx, wy, u = mean.tolist()
    s, c, _, _ = turn_integrals(u, dt)
    cos_a, sin_a = math.cos(u * dt), math.sin(u * dt)
    return np.array(
        [px + s * wx - c * wy, py + c * wx + s * wy, cos_a * wx - sin_a * wy, sin_a * wx + cos_a * wy, u]
    )


def transition(mean: Vector, dt: float) -> Matrix:
    """Jacobian (5, 5) of :func:`propagate` with respect to the state."""
    _, _, wx, wy, u = mean.tolist()
    s, c, ds, dc = turn_integrals(u, dt)
    cos_a, sin_a = math.cos(u * dt), math.sin(u * dt)
    return np.array(
        [
            [1.0, 0.0, s, -c, ds * wx - dc * wy],
            [0.0, 1.0, c, s, dc * wx + ds * wy],
            [0.0, 0.0, cos_a, -sin_a, -dt * (sin_a * wx + cos_a * wy)],
            [0.0, 0.0, sin_a, cos_a, dt * (cos_a * wx - sin_a * wy)],
            [0.0, 0.0, 0.0, 0.0, 1.0],
        ]
    )


def process_noise(mean: Vector, dt: float, noise: ProcessNoise) -> Matrix:
    """Covariance (5, 5) that dt [s] of motion adds.

    White acceleration of density q_v along w, integrated into w (dt), p (dt^3/3) and their cross term
    (dt^2/2); white turn acceleration q_u into u1, from where the model itself carries it into w and p.
    """
    wx, wy = float(mean[2]), float(mean[3])
    squared, floor = wx * wx + wy * wy, noise.v_eps**2
    weight = noise.q_v / (squared + floor)
    start = noise.q_start * max(0.0, 1.0 - squared / floor)
    xx, xy, yy = weight * (wx * wx + floor) + start, weight * wx * wy, weight * (wy * wy + floor) + start
    q = np.zeros((STATE_SIZE, STATE_SIZE))
    along = np.array([[xx, xy], [xy, yy]])
    q[0:2, 0:2] = along * (dt**3 / 3.0)
    q[0:2, 2:4] = q[2:4, 0:2] = along * (dt**2 / 2.0)
    q[2:4, 2:4] = along * dt
    q[4, 4] = noise.q_u * dt
    return q


def propagate_body(mean: Vector, dt: float, motion: FollowerMotion) -> Vector:
    """Move the state (5,) through dt [s] in the follower's body frame while the follower drives its arc.

    The leader moves as in :func:`propagate`; then the axes follow the follower's displacement d and turn
    phi = u2 dt: p' = R(-phi) (p - d), w' = R(-phi) w.
    """
    px, py, wx, wy, u = propagate(mean, dt).tolist()
    dx, dy, _, _ = follower_arc(dt, motion)
    cos_f, sin_f = math.cos(motion.u2 * dt), math.sin(motion.u2 * dt)
    px, py = px - dx, py - dy
    return np.array(
        [
            cos_f * px + sin_f * py,
            cos_f * py - sin_f * px,
            cos_f * wx + sin_f * wy,
            cos_f * wy - sin_f * wx,
            u,
        ]
    )


def transition_body(mean: Vector, dt: float, motion: FollowerMotion) -> Matrix:
    """Jacobian (5, 5) of :func:`propagate_body` with respect to the state."""
    return _body_rotation(dt, motion) @ transition(mean, dt)


def process_noise_body(
    mean: Vector, dt: float, noise: ProcessNoise, motion: FollowerMotion, correlation: float
) -> Matrix:
    """Covariance (5, 5) that dt [s] adds in the body frame: the leader's, and the follower's input errors.

    The errors of v2 and u2 are taken as noise of the given correlation time [s]: over a step they act as
    white noise of density 2 sd^2 correlation, mapped by the derivatives of :func:`propagate_body`.
    """
    rotation = _body_rotation(dt, motion)
    gain = _input_gain(mean, dt, motion)
    scale = 2.0 * correlation / dt if dt > 0.0 else 0.0
    inputs = np.array([motion.sd_v2**2, motion.sd_u2**2]) * scale
    leader = rotation @ process_noise(mean, dt, noise) @ rotation.T
    total: Matrix = leader + (gain * inputs) @ gain.T
    return 0.5 * (total + total.T)


def follower_arc(dt: float, motion: FollowerMotion) -> tuple[float, float, float, float]:
    """Displacement (dx, dy) [m] of the follower over dt along its old axes, and its derivatives by u2."""
    s, c, ds, dc = turn_integrals(motion.u2, dt)
    return motion.v2 * s, motion.v2 * c, motion.v2 * ds, motion.v2 * dc


def _body_rotation(dt: float, motion: FollowerMotion) -> Matrix:
    cos_f, sin_f = math.cos(motion.u2 * dt), math.sin(motion.u2 * dt)
    rotation = np.eye(STATE_SIZE)
    rotation[0, 0] = rotation[1, 1] = rotation[2, 2] = rotation[3, 3] = cos_f
    rotation[0, 1] = rotation[2, 3] = sin_f
    rotation[1, 0] = rotation[3, 2] = -sin_f
    return rotation


def _input_gain(mean: Vector, dt: float, motion: FollowerMotion) -> Matrix:
    """Jacobian (5, 2) of the propagated body state with respect to (v2, u2)."""
    px, py, wx, wy, _ = propagate_body(mean, dt, motion).tolist()
    cos_f, sin_f = math.cos(motion.u2 * dt), math.sin(motion.u2 * dt)
    s, c, ds, dc = turn_integrals(motion.u2, dt)
    by_v2 = (cos_f * s + sin_f * c, cos_f * c - sin_f * s)
    by_u2 = (motion.v2 * (cos_f * ds + sin_f * dc), motion.v2 * (cos_f * dc - sin_f * ds))
    return np.array(
        [
            [-by_v2[0], dt * py - by_u2[0]],
            [-by_v2[1], -dt * px - by_u2[1]],
            [0.0, dt * wy],
            [0.0, -dt * wx],
            [0.0, 0.0],
        ]
    )
