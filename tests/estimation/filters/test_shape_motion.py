from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.filters.belief import Model
from estimation.filters.shape_motion import cartesian, drive_through, jacobians, range_and_bearing, rates
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, PoseNoise, measure_body_from_mocap, measure_world
from estimation.models.motion import propagate_body
from formation.pose import Pose

LIMITS = LeaderLimits(v_eps=0.04, k_v=0.3, k_u=0.7)
SILENT = Model(FrontEnd.BODY, LIMITS, ProcessNoise(0.0, 0.0, 0.04))

angles = st.floats(-3.0, 3.0)
states = st.tuples(st.floats(0.2, 2.0), angles, angles, st.floats(0.05, 0.5), st.floats(-1.0, 1.0))
followers = st.builds(FollowerMotion, st.floats(-0.3, 0.3), st.floats(-1.0, 1.0), st.just(0.0), st.just(0.0))


@given(states, followers, st.floats(0.001, 0.3))
@settings(deadline=None)
def test_it_moves_as_the_exact_arcs_do(state: tuple[float, ...], follower: FollowerMotion, dt: float) -> None:
    before = np.array(state)
    after, _ = drive_through(before, np.eye(5), dt, follower, SILENT)
    exact = propagate_body(cartesian(before)[0], dt, follower)
    assert cartesian(after)[0] == pytest.approx(exact, abs=3e-4)


@given(states, followers)
@settings(deadline=None)
def test_the_jacobians_are_the_derivatives(state: tuple[float, ...], follower: FollowerMotion) -> None:
    here = np.array(state)
    by_state, by_input = jacobians(here, follower)
    _, by_shape = cartesian(here)
    for k, step in enumerate(1e-6 * np.eye(5)):
        ahead, behind = here + step, here - step
        slope = (rates(ahead, follower) - rates(behind, follower)) / 2e-6
        assert by_state[:, k] == pytest.approx(slope, abs=1e-6)
        slope = (cartesian(ahead)[0] - cartesian(behind)[0]) / 2e-6
        assert by_shape[:, k] == pytest.approx(slope, abs=1e-6)
    for k, (v, u) in enumerate(((1e-6, 0.0), (0.0, 1e-6))):
        more = FollowerMotion(follower.v2 + v, follower.u2 + u, 0.0, 0.0)
        slope = (rates(here, more) - rates(here, follower)) / 1e-6
        assert by_input[:, k] == pytest.approx(slope, abs=1e-5)


@pytest.mark.parametrize("bearing", [-2.5, 0.3, 1.6])
def test_both_front_ends_measure_the_same_range_and_bearing_as_well(bearing: float) -> None:
    noise, motion = PoseNoise(1e-3, 4e-3), FollowerMotion(0.1, 0.0, 0.0, 0.0)
    follower = Pose(0.3, -0.2, 0.9)
    line = follower.theta + bearing
    leader = (follower.x + 0.5 * math.cos(line), follower.y + 0.5 * math.sin(line))
    for measure in (measure_world, measure_body_from_mocap):
        seen, covariance = range_and_bearing(measure(0, leader, follower, noise, motion))
        assert seen == pytest.approx([0.5, bearing])
        expected = np.diag([2e-6, 2e-6 / 0.25 + 16e-6])
        assert covariance == pytest.approx(expected, abs=1e-15)
