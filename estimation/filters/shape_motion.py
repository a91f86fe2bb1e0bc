"""Motion of the shape state ``[rho, alpha1, alpha2, v1, u1]`` by Eq. (3) of the paper, and its other forms.

rho [m], bearings alpha1, alpha2 [rad] as in :mod:`formation.shape`, leader speed v1 [m/s] and turn rate
u1 [rad/s]. Everything divides by rho, and the noise across the leader's motion by v1.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.filters.belief import Model
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import Measurement
from estimation.models.motion import Matrix, Vector
from formation.angles import wrap
from formation.pose import Motion
from formation.shape import Shape, shape_rates

_LONGEST_STEP = 0.02


def drive_through(
    state: Vector, covariance: Matrix, dt: float, follower: FollowerMotion, model: Model
) -> tuple[Vector, Matrix]:
    """State (5,) and covariance (5, 5) after dt [s], by the midpoint rule in short steps."""
    steps = max(1, math.ceil(dt / _LONGEST_STEP))
    step = dt / steps
    for _ in range(steps):
        middle = state + 0.5 * step * rates(state, follower)
        by_state, by_input = jacobians(middle, follower)
        move = np.eye(5) + step * by_state + 0.5 * step**2 * by_state @ by_state
        half = np.eye(5) + 0.5 * step * by_state
        added = step * half @ _noise(middle, by_input, follower, model) @ half.T
        state = state + step * rates(middle, follower)
        state[1:3] = [wrap(float(state[1])), wrap(float(state[2]))]
        covariance = move @ covariance @ move.T + added
    return state, 0.5 * (covariance + covariance.T)


def rates(state: Vector, follower: FollowerMotion) -> Vector:
    """Time derivative (5,) of the state; the leader keeps v1 and u1."""
    rho, alpha1, alpha2, v1, u1 = state.tolist()
    found = shape_rates(Shape(rho, alpha1, alpha2), Motion(v1, u1), Motion(follower.v2, follower.u2))
    return np.array([found.rho_dot, found.alpha1_dot, found.alpha2_dot, 0.0, 0.0])


def jacobians(state: Vector, follower: FollowerMotion) -> tuple[Matrix, Matrix]:
    """Derivatives of :func:`rates` by the state (5, 5) and by v2, u2 (5, 2)."""
    rho, alpha1, alpha2, v1, _ = state.tolist()
    sin1, cos1, sin2, cos2 = math.sin(alpha1), math.cos(alpha1), math.sin(alpha2), math.cos(alpha2)
    line = (v1 * sin1 + follower.v2 * sin2) / rho
    turning = [-line / rho, v1 * cos1 / rho, follower.v2 * cos2 / rho, sin1 / rho, 0.0]
    by_state = np.zeros((5, 5))
    by_state[0] = [0.0, v1 * sin1, follower.v2 * sin2, -cos1, 0.0]
    by_state[1] = by_state[2] = turning
    by_state[1, 4] = -1.0
    by_input = np.zeros((5, 2))
    by_input[0:3, 0] = [-cos2, sin2 / rho, sin2 / rho]
    by_input[2, 1] = -1.0
    return by_state, by_input


def cartesian(state: Vector) -> tuple[Vector, Matrix]:
    """State of :mod:`estimation.models.motion` in the follower's body frame, and its Jacobian (5, 5)."""
    rho, alpha1, alpha2, v1, u1 = state.tolist()
    heading = alpha2 + math.pi - alpha1
    ex, ey, hx, hy = math.cos(alpha2), math.sin(alpha2), math.cos(heading), math.sin(heading)
    px, py, wx, wy = rho * ex, rho * ey, v1 * hx, v1 * hy
    jacobian = np.array(
        [
            [ex, 0.0, -py, 0.0, 0.0],
            [ey, 0.0, px, 0.0, 0.0],
            [0.0, wy, -wy, hx, 0.0],
            [0.0, -wx, wx, hy, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0],
        ]
    )
    return np.array([px, py, wx, wy, u1]), jacobian


def range_and_bearing(measurement: Measurement) -> tuple[Vector, Matrix]:
    """(rho, alpha2) as measured, and their covariance (2, 2), which follows from the geometry."""
    pose, noise = measurement.pose, measurement.pose_noise
    x, y = measurement.position.tolist()
    if pose is None or noise is None:
        rho, alpha2 = math.hypot(x, y), math.atan2(y, x)
        to_polar = np.array([[x / rho, y / rho], [-y / rho**2, x / rho**2]])
        return np.array([rho, alpha2]), to_polar @ measurement.covariance @ to_polar.T
    dx, dy = x - pose.x, y - pose.y
    rho, alpha2 = math.hypot(dx, dy), wrap(math.atan2(dy, dx) - pose.theta)
    to_polar = np.array([[dx / rho, dy / rho], [-dy / rho**2, dx / rho**2]])
    covariance = to_polar @ (measurement.covariance + noise.position**2 * np.eye(2)) @ to_polar.T
    covariance[1, 1] += noise.heading**2
    return np.array([rho, alpha2]), covariance


def _noise(state: Vector, by_input: Matrix, follower: FollowerMotion, model: Model) -> Matrix:
    """Density (5, 5) per second: the leader's along and across its motion and in u1, and the inputs'."""
    noise, speed = model.noise, float(state[3])
    floor = noise.v_eps**2
    across = noise.q_v * floor / (speed**2 + floor)
    density = np.zeros((5, 5))
    density[1, 1] = across / max(speed, 0.25 * noise.v_eps) ** 2
    density[3, 3] = noise.q_v
    density[4, 4] = noise.q_u
    inputs = 2.0 * model.input_correlation * np.array([follower.sd_v2**2, follower.sd_u2**2])
    total: Matrix = density + (by_input * inputs) @ by_input.T
    return total
