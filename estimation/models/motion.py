"""Coordinated-turn motion of the leader as vectors and matrices, for estimators that are written in them.

State ``[px, py, wx, wy, u1]``: leader position [m], leader velocity [m/s] and leader turn rate [rad/s].
In the fixed frame p and w are mocap coordinates. In the body frame p is the leader's position seen from the
follower, and w the leader's *absolute* velocity, both along the follower's axes (x ahead, y to its left).
The arithmetic is that of :mod:`estimation.models.coordinated_turn`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.models.coordinated_turn import (
    FollowerMotion,
    ProcessNoise,
    State,
    acceleration,
    along_follower,
    by_own_speed,
    by_own_turn,
    by_turn_rate,
    input_density,
    moved,
)
from formation.arc import swing

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

STATE_SIZE = 5


def state_of(mean: Vector) -> State:
    """State (5,) as the record that it is."""
    return State(*mean.tolist())


def propagate(mean: Vector, dt: float) -> Vector:
    """Move the state (5,) through dt [s] of coordinated turn in a fixed frame; exact for constant v1, u1."""
    state = state_of(mean)
    return np.array(moved(state, swing(state.u, dt)))


def transition(mean: Vector, dt: float) -> Matrix:
    """Jacobian (5, 5) of :func:`propagate` with respect to the state."""
    state = state_of(mean)
    turn = swing(state.u, dt)
    jacobian = np.eye(STATE_SIZE)
    jacobian[0:2, 2:4] = [[turn.s, -turn.c], [turn.c, turn.s]]
    jacobian[2:4, 2:4] = [[turn.cos, -turn.sin], [turn.sin, turn.cos]]
    jacobian[0:4, 4] = by_turn_rate(state, moved(state, turn), turn, dt)
    return jacobian


def process_noise(mean: Vector, dt: float, noise: ProcessNoise) -> Matrix:
    """Covariance (5, 5) that dt [s] of motion adds.

    White acceleration of density q_v along w, integrated into w (dt), p (dt^3/3) and their cross term
    (dt^2/2); white turn acceleration q_u into u1, from where the model itself carries it into w and p.
    """
    spread = acceleration(float(mean[2]), float(mean[3]), noise)
    q = np.zeros((STATE_SIZE, STATE_SIZE))
    along = np.array([[spread.xx, spread.xy], [spread.xy, spread.yy]])
    q[0:2, 0:2] = along * (dt**3 / 3.0)
    q[0:2, 2:4] = q[2:4, 0:2] = along * (dt**2 / 2.0)
    q[2:4, 2:4] = along * dt
    q[4, 4] = noise.q_u * dt
    return q


def propagate_body(mean: Vector, dt: float, motion: FollowerMotion) -> Vector:
    """Move the state (5,) through dt [s] in the follower's body frame while the follower drives its arc."""
    state = state_of(mean)
    ahead = moved(state, swing(state.u, dt))
    return np.array(along_follower(ahead, motion.v2, swing(motion.u2, dt)))


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
    rotation, own = _body_rotation(dt, motion), swing(motion.u2, dt)
    after = state_of(propagate_body(mean, dt, motion))
    gain = np.zeros((STATE_SIZE, 2))
    gain[0:4, 0], gain[0:4, 1] = by_own_speed(own), by_own_turn(after, motion.v2, own, dt)
    inputs = np.array([motion.sd_v2**2, motion.sd_u2**2]) * input_density(correlation, dt)
    leader = rotation @ process_noise(mean, dt, noise) @ rotation.T
    total: Matrix = leader + (gain * inputs) @ gain.T
    return 0.5 * (total + total.T)


def _body_rotation(dt: float, motion: FollowerMotion) -> Matrix:
    own = swing(motion.u2, dt)
    rotation = np.eye(STATE_SIZE)
    rotation[0:2, 0:2] = rotation[2:4, 2:4] = [[own.cos, own.sin], [-own.sin, own.cos]]
    return rotation
