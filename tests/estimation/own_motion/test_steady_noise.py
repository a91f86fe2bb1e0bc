from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import PoseNoise
from estimation.models.motion import Matrix
from estimation.own_motion.own_track import ODOMETRY_CORRELATION, OwnNoise
from estimation.own_motion.steady_noise import steady_noise

NOISE = OwnNoise(PoseNoise(7e-4, 8e-3), v_max=0.2, u_max=0.6)


def last_sd(move: Matrix, driven: Matrix, seen: Matrix, variances: list[float]) -> float:
    """Standard deviation of a model's last state in the steady state, by the Riccati equation."""
    noise = np.diag(variances)
    prior = solve_discrete_are(move.T, seen.T, driven, noise)
    gain = prior @ seen.T @ np.linalg.inv(seen @ prior @ seen.T + noise)
    return math.sqrt((prior - gain @ seen @ prior)[-1, -1])


def expected(dt: float, odometry: FollowerMotion | None) -> tuple[float, float]:
    """Straight on along x the way decouples from offset and heading; odometry sees the last of each."""
    ramp = np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    place, heading = NOISE.pose.position**2, NOISE.pose.heading**2
    v = 0.5 * NOISE.v_max
    along, across = np.eye(1, 2), np.eye(2, 3)
    along_variances, across_variances = [place], [place, heading]
    if odometry is not None:
        inflation = max(1.0, 2.0 * ODOMETRY_CORRELATION / dt)
        along, across = np.eye(2), np.eye(3)
        along_variances.append(inflation * odometry.sd_v2**2)
        across_variances.append(inflation * odometry.sd_u2**2)
    turned = np.zeros((3, 3))
    turned[1:, 1:] = NOISE.u_max**2 * ramp
    return (
        last_sd(np.array([[1.0, dt], [0.0, 1.0]]), NOISE.v_max**2 * ramp, along, along_variances),
        last_sd(
            np.array([[1.0, v * dt, 0.5 * v * dt**2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]]),
            turned,
            across,
            across_variances,
        ),
    )


@pytest.mark.parametrize("odometry", [None, FollowerMotion(9.0, 9.0, 0.005, 0.03)])
@pytest.mark.parametrize("period", [1.0 / 120.0, 0.05, 0.2])
def test_it_is_the_steady_state_of_a_robot_that_drives_straight_on(
    period: float, odometry: FollowerMotion | None
) -> None:
    assert steady_noise(NOISE, period, odometry) == pytest.approx(expected(period, odometry), rel=1e-3)


def test_odometry_makes_it_less() -> None:
    alone, helped = steady_noise(NOISE, 0.01), steady_noise(NOISE, 0.01, FollowerMotion(0.0, 0.0, 1e-3, 1e-2))
    assert helped[0] < 0.5 * alone[0]
    assert helped[1] < 0.5 * alone[1]
