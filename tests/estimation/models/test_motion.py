from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.motion import (
    Matrix,
    Vector,
    process_noise,
    process_noise_body,
    propagate,
    propagate_body,
    transition,
    transition_body,
)
from formation.pose import Pose, advance

speeds = st.floats(-1.0, 1.0)
# Both sides of the switch to the series, and the switch itself, deserve as much attention as the rest.
turns = st.one_of(st.floats(-3.0, 3.0), st.floats(-1e-2, 1e-2), st.sampled_from([0.0, 1e-9, -1e-5]))
states = st.builds(
    lambda *values: np.array(values), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), speeds, speeds, turns
)
steps = st.floats(1e-3, 0.5)
follower_motions = st.builds(FollowerMotion, speeds, turns, st.just(0.005), st.just(0.03))
NOISE = ProcessNoise.by_rule(LeaderLimits(v_eps=0.04, k_v=0.3, k_u=0.7), 0.5)


def slopes(function: Callable[[Vector], Vector], at: Vector, step: float = 1e-5) -> Matrix:
    """Jacobian by fourth-order central differences."""
    columns = []
    for offset in step * np.eye(len(at)):
        near, far = (function(at + k * offset) - function(at - k * offset) for k in (1.0, 2.0))
        columns.append((8.0 * near - far) / (12.0 * step))
    return np.column_stack(columns)


@given(states, steps)
@settings(deadline=None, max_examples=30)
def test_the_leader_moves_as_its_differential_equation_says(state: Vector, dt: float) -> None:
    def rates(_: float, x: Vector) -> list[float]:
        return [x[2], x[3], -x[4] * x[3], x[4] * x[2], 0.0]

    solution = solve_ivp(rates, (0.0, dt), state, method="DOP853", rtol=1e-12, atol=1e-13)
    assert propagate(state, dt) == pytest.approx(solution.y[:, -1], abs=1e-10)


@given(st.floats(0.0, 1.0), st.floats(-math.pi, math.pi), turns, steps)
@settings(deadline=None)
def test_the_leader_moves_as_a_unicycle(v: float, theta: float, u: float, dt: float) -> None:
    there = advance(Pose(0.3, -0.2, theta), v, u, dt)
    state = propagate(np.array([0.3, -0.2, v * math.cos(theta), v * math.sin(theta), u]), dt)
    expected = [there.x, there.y, v * math.cos(there.theta), v * math.sin(there.theta), u]
    assert state == pytest.approx(np.array(expected), abs=1e-14)


@given(states, steps, st.builds(Pose, speeds, speeds, st.floats(-3.1, 3.1)), follower_motions)
@settings(deadline=None)
def test_the_body_frame_is_the_fixed_frame_seen_from_the_moving_follower(
    state: Vector, dt: float, pose: Pose, follower: FollowerMotion
) -> None:
    later = advance(pose, follower.v2, follower.u2, dt)
    moved = propagate_body(seen_from(pose, state), dt, follower)
    assert moved == pytest.approx(seen_from(later, propagate(state, dt)), abs=1e-13)


def seen_from(pose: Pose, state: Vector) -> Vector:
    position = (complex(state[0], state[1]) - complex(pose.x, pose.y)) * np.exp(-1j * pose.theta)
    velocity = complex(state[2], state[3]) * np.exp(-1j * pose.theta)
    return np.array([position.real, position.imag, velocity.real, velocity.imag, state[4]])


@given(states, steps, follower_motions)
@settings(deadline=None)
def test_transitions_are_the_derivatives_of_the_motion(
    state: Vector, dt: float, follower: FollowerMotion
) -> None:
    fixed = slopes(lambda x: propagate(x, dt), state)
    assert transition(state, dt) == pytest.approx(fixed, abs=1e-8)
    body = slopes(lambda x: propagate_body(x, dt, follower), state)
    assert transition_body(state, dt, follower) == pytest.approx(body, abs=1e-8)


@given(states, steps, follower_motions)
@settings(deadline=None)
def test_input_errors_enter_by_their_derivatives(state: Vector, dt: float, follower: FollowerMotion) -> None:
    def moved(inputs: Vector) -> Vector:
        return propagate_body(state, dt, FollowerMotion(float(inputs[0]), float(inputs[1]), 0.0, 0.0))

    correlation = 0.05
    gain = slopes(moved, np.array([follower.v2, follower.u2]))
    variances = np.array([follower.sd_v2**2, follower.sd_u2**2]) * 2.0 * correlation / dt
    exact = FollowerMotion(follower.v2, follower.u2, 0.0, 0.0)
    added = process_noise_body(state, dt, NOISE, follower, correlation) - process_noise_body(
        state, dt, NOISE, exact, correlation
    )
    assert added == pytest.approx(gain * variances @ gain.T, abs=1e-9)


def test_noise_of_two_steps_along_a_straight_path_is_that_of_one() -> None:
    first, second = 0.03, 0.07
    state = np.array([0.1, 0.2, 0.25, -0.1, 0.0])
    later = propagate(state, first)
    move = transition(later, second)
    move[:4, 4] = 0.0  # how the turn rate's noise reaches w and p is left to the model, see below
    composed = move @ process_noise(state, first, NOISE) @ move.T + process_noise(later, second, NOISE)
    assert composed == pytest.approx(process_noise(state, first + second, NOISE), abs=1e-17)


def test_what_the_turn_rate_adds_between_two_steps_vanishes_with_them() -> None:
    state = np.array([0.1, 0.2, 0.25, -0.1, 0.4])

    def defect(dt: float) -> float:
        """Largest difference, as a correlation, between two half steps and a whole one."""
        later = propagate(state, 0.5 * dt)
        move = transition(later, 0.5 * dt)
        halves = [process_noise(x, 0.5 * dt, NOISE) for x in (state, later)]
        whole = process_noise(state, dt, NOISE)
        scale = np.sqrt(np.diag(whole))
        difference = move @ halves[0] @ move.T + halves[1] - whole
        return float(np.max(np.abs(difference) / np.outer(scale, scale)))

    assert defect(1e-2) < 0.05
    assert defect(1e-3) < 0.11 * defect(1e-2)


def test_input_noise_of_two_steps_is_that_of_one() -> None:
    state, follower = np.array([0.4, 0.1, 0.1, 0.2, 0.3]), FollowerMotion(0.2, 0.4, 0.01, 0.05)
    silent = ProcessNoise(0.0, 0.0, 0.04)
    for dt, tolerance in ((0.1, 2e-2), (0.01, 2e-3)):
        later = propagate_body(state, 0.5 * dt, follower)
        move = transition_body(later, 0.5 * dt, follower)
        halves = [process_noise_body(x, 0.5 * dt, silent, follower, 0.05) for x in (state, later)]
        composed = move @ halves[0] @ move.T + halves[1]
        whole = process_noise_body(state, dt, silent, follower, 0.05)
        scale = np.sqrt(np.diag(whole)[:4])
        difference = np.abs(composed - whole)[:4, :4] / np.outer(scale, scale)
        assert np.max(difference) < tolerance


@given(states, steps, follower_motions)
@settings(deadline=None)
def test_noise_is_a_covariance(state: Vector, dt: float, follower: FollowerMotion) -> None:
    for noise in (process_noise(state, dt, NOISE), process_noise_body(state, dt, NOISE, follower, 0.05)):
        assert np.array_equal(noise, noise.T)
        assert np.linalg.eigvalsh(noise).min() >= -1e-18


def test_noise_drives_the_speed_and_leaves_the_direction_to_the_turn_rate() -> None:
    q = process_noise(np.array([0.0, 0.0, 0.3, 0.0, 0.0]), 0.01, NOISE)
    isotropic = process_noise(np.zeros(5), 0.01, NOISE)
    assert q[2, 2] == pytest.approx(NOISE.q_v * 0.01)
    assert q[3, 3] == pytest.approx(q[2, 2] * 0.04**2 / (0.3**2 + 0.04**2))
    assert isotropic[2, 2] == isotropic[3, 3] == pytest.approx((NOISE.q_v + NOISE.q_start) * 0.01)
    assert isotropic[2, 3] == 0.0


def test_only_a_leader_that_stands_is_expected_to_set_off() -> None:
    without = NOISE._replace(q_start=0.0)
    for speed, more in ((0.0, True), (0.039, True), (0.04, False), (0.3, False)):
        state = np.array([0.0, 0.0, 0.0, speed, 0.1])
        added = process_noise(state, 0.01, NOISE) - process_noise(state, 0.01, without)
        assert (added.any() > 0) == more
        assert np.linalg.eigvalsh(added).min() >= -1e-18


def test_no_time_adds_no_noise() -> None:
    follower = FollowerMotion(0.1, 0.2, 0.01, 0.02)
    assert not process_noise_body(np.ones(5), 0.0, NOISE, follower, 0.05).any()


def test_a_leader_that_stops_and_goes_at_random_has_the_speed_noise_of_the_rule() -> None:
    limits, step, every = LeaderLimits(v_eps=0.04, k_v=0.1, k_u=0.7), 0.7, 5.0
    noise = ProcessNoise.by_rule(limits, 0.5, step**2 / every)
    generator = np.random.default_rng(8)
    # Far longer than a sojourn the sum of the steps, taken as independent, spreads by the density times time.
    jumps = generator.poisson(100.0 / every, 4000)
    drift = [step * limits.k_v * generator.choice([-1.0, 1.0], count).sum() for count in jumps]
    assert np.var(drift) / 100.0 == pytest.approx(noise.q_v, rel=0.1)
    assert ProcessNoise.by_rule(limits, 0.5).q_v == pytest.approx((0.1 * limits.k_v) ** 2)
