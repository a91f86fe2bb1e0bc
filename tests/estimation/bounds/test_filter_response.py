from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_are
from scipy.optimize import linprog

from estimation.bounds.filter_response import (
    Disturbances,
    FlyingFilter,
    error_dynamics,
    response,
    worst_responses,
)
from estimation.filters.belief import Model
from estimation.filters.filter import Kind, filter_of
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, PoseNoise, measure_world
from formation.pose import Pose

LIMITS = LeaderLimits(0.04, 0.1, 0.7)
FLYING = FlyingFilter(3e-4, 1.0 / 120.0, ProcessNoise.by_rule(LIMITS, 0.5), LIMITS)
BOUNDS = Disturbances(9e-4, 0.07)


def impulses(flying: FlyingFilter, v1: float, u1: float, lags: int) -> tuple[np.ndarray, np.ndarray]:
    """Weights (lags, 2, 2) of noise and acceleration in the velocity's error, by running the error itself."""
    dynamics = error_dynamics(flying, v1, u1)
    columns = []
    for first in (dynamics.K, dynamics.B):
        for axis in (0, 1):
            error, course = first[:, axis], []
            for _ in range(lags):
                course.append(error[2:4])
                error = dynamics.M @ error
            columns.append(np.array(course))
    noise_x, noise_y, push_x, push_y = columns
    return np.stack([noise_x, noise_y], axis=2), np.stack([push_x, push_y], axis=2)


def test_the_gain_is_the_one_that_the_filter_in_the_loop_settles_to() -> None:
    """The very filter, flown along a leader on a circle, corrects by this gain in the leader's axes."""
    v1, u1, period = 0.08, 0.5, FLYING.period
    flies = filter_of(Kind.EKF, Model(FrontEnd.WORLD, LIMITS, FLYING.noise))
    noise, rest = PoseNoise(FLYING.sigma, 0.0035), FollowerMotion(0.0, 0.0, 0.0, 0.0)
    belief = None
    for k in range(400):
        angle = u1 * k * period
        place = (v1 / u1 * math.sin(angle), v1 / u1 * (1.0 - math.cos(angle)))
        seen = measure_world(round(k * period * 1e9), place, Pose(1.0, 1.0, 0.0), noise, rest)
        belief = (
            flies.start(seen)
            if belief is None
            else flies.update(ahead := flies.predict(belief, period, rest), seen)
        )
    nudged = [
        flies.update(ahead, seen._replace(x=seen.x + dx, y=seen.y + dy))
        for dx, dy in ((1e-6, 0.0), (0.0, 1e-6))
    ]
    assert belief is not None
    by_axis = np.array(
        [
            [(getattr(n, name) - getattr(belief, name)) / 1e-6 for n in nudged]
            for name in ("x", "y", "vx", "vy", "u")
        ]
    )
    c, s = math.cos(angle), math.sin(angle)
    back = np.array([[c, s], [-s, c]])
    turned = by_axis @ back.T
    turned[0:2], turned[2:4] = back @ turned[0:2], back @ turned[2:4]
    expected = error_dynamics(FLYING, v1, u1).K
    assert turned == pytest.approx(expected, rel=2e-3, abs=2e-3 * np.abs(expected).max())


def test_the_gain_solves_the_riccati_equation() -> None:
    from estimation.models.motion import process_noise_body, transition_body

    mean, along = np.array([0.0, 0.0, 0.06, 0.0, 0.7]), FollowerMotion(0.0, 0.7, 0.0, 0.0)
    F = transition_body(mean, FLYING.period, along)
    Q = process_noise_body(mean, FLYING.period, FLYING.noise, along, 0.0)
    H, R = np.eye(2, 5), FLYING.sigma**2 * np.eye(2)
    P = solve_discrete_are(F.T, H.T, Q, R)
    gain = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    assert pytest.approx(gain, rel=1e-5, abs=1e-7 * np.abs(gain).max()) == error_dynamics(FLYING, 0.06, 0.7).K


@pytest.mark.parametrize("u1", [0.0, 0.7])
def test_no_noise_and_no_acceleration_within_bounds_does_worse(u1: float) -> None:
    """A linear program over polygons inside the discs finds nearly as much, and never more."""
    lags, sides = 120, 12
    noise, push = impulses(FLYING, 0.08, u1, lags)
    corners = np.column_stack(
        [np.cos(2 * np.pi * np.arange(sides) / sides), np.sin(2 * np.pi * np.arange(sides) / sides)]
    )
    found = response(error_dynamics(FLYING, 0.08, u1), BOUNDS).velocity
    best = 0.0
    for angle in np.linspace(0.0, math.pi, 8, endpoint=False):
        direction = np.array([math.cos(angle), math.sin(angle)])
        # Shares of the corners in each frame: a point of the polygon.
        gains = np.concatenate(
            [
                (BOUNDS.position * np.einsum("i,nij,cj->nc", direction, noise, corners)).ravel(),
                (BOUNDS.acceleration * np.einsum("i,nij,cj->nc", direction, push, corners)).ravel(),
            ]
        )
        rows = np.kron(np.eye(2 * lags), np.ones(sides))
        solved = linprog(-gains, A_ub=rows, b_ub=np.ones(2 * lags), bounds=(0.0, 1.0))
        assert solved.fun is not None
        best = max(best, -solved.fun)
    assert 0.93 * found < best <= found


@settings(max_examples=20, deadline=None)
@given(
    scale=st.floats(0.1, 30.0),
    position=st.floats(1e-5, 1e-2),
    push=st.floats(0.0, 1.0),
    v1=st.floats(0.04, 0.1),
)
def test_more_noise_or_acceleration_makes_more_error(
    scale: float, position: float, push: float, v1: float
) -> None:
    dynamics = error_dynamics(FLYING._replace(sigma=FLYING.sigma * scale), v1, 0.3)
    found = response(dynamics, Disturbances(position, push))
    for more in (Disturbances(1.5 * position, push), Disturbances(position, push + 0.1)):
        larger = response(dynamics, more)
        assert larger.velocity > found.velocity
        assert larger.position > found.position
    doubled = response(dynamics, Disturbances(2.0 * position, 2.0 * push))
    assert doubled.velocity == pytest.approx(2.0 * found.velocity, rel=1e-12)


def test_the_worst_leader_is_among_those_that_the_limits_allow() -> None:
    worst = worst_responses(FLYING, BOUNDS)
    each = [response(error_dynamics(FLYING, v1, 0.7), BOUNDS).velocity for v1 in (0.04, 0.07, 0.1)]
    assert worst.velocity == max(each)
    assert all(later > before for before, later in pairwise(each)), "the faster, the more it is led astray"


def test_only_the_ratio_of_noises_matters_to_the_gain() -> None:
    """So that one table over the ratios of process to measurement noise serves every noise."""
    louder = FLYING._replace(
        sigma=7.0 * FLYING.sigma,
        noise=ProcessNoise(49.0 * FLYING.noise.q_v, 49.0 * FLYING.noise.q_u, LIMITS.v_eps),
    )
    assert (
        pytest.approx(error_dynamics(FLYING, 0.08, 0.4).K, rel=1e-6, abs=1e-9)
        == error_dynamics(louder, 0.08, 0.4).K
    )
