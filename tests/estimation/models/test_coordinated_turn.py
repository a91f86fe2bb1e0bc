from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.models.coordinated_turn import (
    FollowerMotion,
    LeaderLimits,
    ProcessNoise,
    State,
    acceleration,
    along_follower,
    by_own_speed,
    by_own_turn,
    by_turn_rate,
    input_density,
    mean_motion,
    moved,
)
from formation.arc import swing
from formation.pose import Pose, advance

speeds = st.floats(-1.0, 1.0)
# Both sides of the switch to the series, and the switch itself, deserve as much attention as the rest.
turns = st.one_of(st.floats(-3.0, 3.0), st.floats(-1e-2, 1e-2), st.sampled_from([0.0, 1e-9, -1e-5, 0.25]))
states = st.builds(State, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), speeds, speeds, turns)
steps = st.floats(1e-3, 0.5)
NOISE = ProcessNoise.by_rule(LeaderLimits(v_eps=0.04, k_v=0.3, k_u=0.7), 0.5)


def slope(function: Callable[[float], State], at: float, step: float = 1e-4) -> list[float]:
    """Derivative of position and velocity by fourth-order central differences."""
    near, far = (
        np.array(function(at + k * step)[:4]) - np.array(function(at - k * step)[:4]) for k in (1.0, 2.0)
    )
    derivative: list[float] = ((8.0 * near - far) / (12.0 * step)).tolist()
    return derivative


@given(st.floats(0.0, 1.0), st.floats(-math.pi, math.pi), turns, steps)
def test_the_leader_moves_as_a_unicycle(v: float, theta: float, u: float, dt: float) -> None:
    there = advance(Pose(0.3, -0.2, theta), v, u, dt)
    found = moved(State(0.3, -0.2, v * math.cos(theta), v * math.sin(theta), u), swing(u, dt))
    expected = (there.x, there.y, v * math.cos(there.theta), v * math.sin(there.theta), u)
    assert found == pytest.approx(expected, abs=1e-14)


@given(states, steps)
def test_the_derivative_by_the_turn_rate_is_one(state: State, dt: float) -> None:
    leader = swing(state.u, dt)
    found = by_turn_rate(state, moved(state, leader), leader, dt)
    expected = slope(lambda u: moved(state._replace(u=u), swing(u, dt)), state.u)
    assert found == pytest.approx(expected, abs=1e-10)


@given(states, speeds, turns, steps)
def test_the_derivatives_by_the_follower_s_motion_are_ones(
    state: State, v2: float, u2: float, dt: float
) -> None:
    own = swing(u2, dt)
    by_speed = slope(lambda v: along_follower(state, v, own), v2)
    assert by_own_speed(own) == pytest.approx(by_speed, abs=1e-10)
    by_turn = slope(lambda u: along_follower(state, v2, swing(u, dt)), u2)
    assert by_own_turn(along_follower(state, v2, own), v2, own, dt) == pytest.approx(by_turn, abs=1e-10)


@given(states, st.builds(Pose, speeds, speeds, st.floats(-3.1, 3.1)), speeds, turns, steps)
def test_axes_that_move_with_the_follower_are_those_of_its_pose(
    state: State, pose: Pose, v2: float, u2: float, dt: float
) -> None:
    later = advance(pose, v2, u2, dt)
    found = along_follower(seen_from(pose, state), v2, swing(u2, dt))
    assert found == pytest.approx(seen_from(later, state), abs=1e-13)


def seen_from(pose: Pose, state: State) -> State:
    position = (complex(state.x, state.y) - complex(pose.x, pose.y)) * np.exp(-1j * pose.theta)
    velocity = complex(state.vx, state.vy) * np.exp(-1j * pose.theta)
    return State(position.real, position.imag, velocity.real, velocity.imag, state.u)


@given(st.floats(0.0, 1.0), st.floats(-math.pi, math.pi))
def test_acceleration_is_along_the_velocity_by_as_much_as_that_is_known(v: float, heading: float) -> None:
    vx, vy = v * math.cos(heading), v * math.sin(heading)
    found = acceleration(vx, vy, NOISE)
    ahead = np.array([math.cos(heading), math.sin(heading)])
    floor, start = NOISE.v_eps**2, NOISE.q_start * max(0.0, 1.0 - (v / NOISE.v_eps) ** 2)
    share = floor / (v * v + floor)
    expected = NOISE.q_v * (np.outer(ahead, ahead) * (1.0 - share) + share * np.eye(2)) + start * np.eye(2)
    assert (found.xx, found.xy, found.yy) == pytest.approx(
        (expected[0, 0], expected[0, 1], expected[1, 1]), rel=1e-9, abs=1e-15
    )


def test_the_motion_over_an_interval_is_the_mean_of_its_ends_as_sure_as_the_later_one() -> None:
    before, after = FollowerMotion(0.1, -0.4, 0.5, 0.6), FollowerMotion(0.3, 0.2, 0.01, 0.02)
    assert mean_motion(before, after) == pytest.approx((0.2, -0.1, 0.01, 0.02))


def test_input_errors_of_a_correlation_time_act_as_white_noise_and_not_at_all_over_no_time() -> None:
    assert input_density(0.05, 0.1) == pytest.approx(1.0)
    assert input_density(0.05, 0.0) == 0.0
