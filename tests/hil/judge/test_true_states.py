from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.kernel import interpreted
from formation.mount import NO_MOUNT, Mount, body_pose
from formation.pose import Pose
from hil.judge.entries import fill_shapes
from hil.judge.run_data import RunData
from hil.judge.true_states import LONGEST_GAP_NS, TrueStates, run_of
from hil.wire.message_types import Truth
from hil.wire.messages import header, to_ns

T0 = 1_700_000_000_000_000_000
STEP = 100_000_000


def truth(moment_ns: int, theta: float = 0.0) -> Truth:
    """Follower 0.2 m to the right of a leader at the origin that heads along theta."""
    x, y = 0.2 * math.cos(theta - 0.5 * math.pi), 0.2 * math.sin(theta - 0.5 * math.pi)
    return Truth(header(moment_ns, "mocap"), 0, 0.0, 0.0, theta, 0.08, 0.1, x, y, theta, 0.1, 0.1)


def at(states: TrueStates, *moments_ns: int) -> TrueStates:
    return states.at(np.array(moments_ns, dtype=np.int64))


@given(st.floats(-math.pi, math.pi), st.floats(-2.0, 2.0), st.floats(0.0, 1.0))
def test_a_heading_between_two_turns_the_short_way(theta: float, turn: float, share: float) -> None:
    first = replace(truth(T0), leader_theta=theta)
    second = replace(truth(T0 + STEP), leader_theta=math.remainder(theta + turn, math.tau))
    moment = T0 + round(share * STEP)
    heading = float(at(TrueStates.of([first, second]), moment).leader[0, 2])
    expected = theta + turn * (moment - T0) / STEP
    assert math.remainder(heading - expected, math.tau) == pytest.approx(0.0, abs=1e-12)
    assert -math.pi < heading <= math.pi


def test_a_moment_with_a_truth_gets_that_truth_bit_for_bit() -> None:
    truths = [truth(T0 + k * STEP, theta=0.1 * k) for k in range(5)]
    states = TrueStates.of(truths)
    same = at(states, *(to_ns(each.header.stamp) for each in truths))
    for name in ("leader", "follower", "v1", "rho", "alpha1", "alpha2", "rho_dot", "alpha2_dot"):
        np.testing.assert_array_equal(getattr(same, name), getattr(states, name))


def test_nothing_is_known_outside_and_in_long_gaps() -> None:
    states = TrueStates.of([truth(T0), truth(T0 + STEP), truth(T0 + STEP + LONGEST_GAP_NS + 1)])
    found = at(states, T0 - 1, T0 + STEP // 2, T0 + 2 * STEP, T0 + STEP + LONGEST_GAP_NS + 2)
    assert np.isfinite(found.rho).tolist() == [False, True, False, False]
    assert not np.any(np.isfinite(at(TrueStates.of([]), T0).rho))


def test_unknown_speeds_leave_the_shape_known() -> None:
    states = TrueStates.of([replace(truth(T0), v1=math.nan, v2=math.nan)])
    assert states.rho[0] == pytest.approx(0.2)
    assert states.alpha1[0] == pytest.approx(-0.5 * math.pi)
    assert math.isnan(states.rho_dot[0])
    assert math.isnan(states.alpha2_dot[0])


def test_two_robots_in_one_place_have_no_shape() -> None:
    states = TrueStates.of([replace(truth(T0), follower_x=0.0, follower_y=0.0), truth(T0 + STEP)])
    assert np.isfinite(states.rho).tolist() == [False, True]


def test_order_and_doubles_do_not_matter() -> None:
    late, early = truth(T0 + STEP, theta=1.0), truth(T0)
    states = TrueStates.of([late, early, replace(early, v1=9.0)])
    assert states.capture_ns.tolist() == [T0, T0 + STEP]
    assert states.v1.tolist() == [0.08, 0.08]


def test_a_leader_that_backs_up_has_the_shape_of_one_that_faces_the_other_way(
    exact_run_data: RunData,
) -> None:
    forwards = TrueStates.of(exact_run_data.truth)
    turned = [
        replace(each, leader_theta=each.leader_theta + math.pi, v1=-each.v1) for each in exact_run_data.truth
    ]
    backwards = TrueStates.of(turned)
    for name in TrueStates.__slots__:
        np.testing.assert_allclose(getattr(backwards, name), getattr(forwards, name), atol=1e-12)


def test_truth_of_bodies_becomes_that_of_the_robots_below() -> None:
    leader, follower = Mount(0.05, -0.02, 0.2), Mount(0.0, 0.03, -0.1)
    rows, bodies = [], []
    for k in range(5):
        poses = Pose(0.1 * k, 0.2, 0.3 * k), Pose(1.0, 0.1 * k, -0.2 * k)
        motions = ((0.1, 0.3), (0.2, -0.2))
        rows.append([*poses[0], *poses[1], *motions[0], *motions[1]])
        seen = [body_pose(pose, mount) for pose, mount in zip(poses, (leader, follower), strict=True)]
        speeds = [
            (math.cos(m.yaw) * (v - u * m.y) + math.sin(m.yaw) * u * m.x, u)
            for (v, u), m in zip(motions, (leader, follower), strict=True)
        ]
        bodies.append([*seen[0], *seen[1], *speeds[0], *speeds[1]])
    stamps = np.arange(5, dtype=np.int64)
    wanted = TrueStates.along(stamps, np.array(rows))
    found = TrueStates.along(stamps, np.array(bodies)).of_robots(leader, follower)
    for name in ("leader", "follower", "v1", "u1", "v2", "u2", "rho", "alpha1", "alpha2", "rho_dot"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), atol=1e-12)
    assert wanted.of_robots(NO_MOUNT, NO_MOUNT) is wanted


def test_shapes_are_filled_in_to_the_same_bits_compiled_or_not() -> None:
    columns = np.random.default_rng(4).normal(scale=4.0, size=(15, 200))
    columns[10] = np.abs(columns[10])
    columns[10, :3] = math.nan
    columns[2, 3] = math.inf
    plain = columns.copy()
    fill_shapes(columns)
    interpreted(fill_shapes)(plain)
    np.testing.assert_array_equal(columns, plain)


@given(st.sets(st.integers(0, 60), min_size=1), st.data())
def test_moments_are_found_at_once_only_where_they_follow_each_other(
    moments: set[int], data: st.DataObject
) -> None:
    held = np.array(sorted(moments), dtype=np.int64)
    wanted = np.array(data.draw(st.lists(st.integers(0, 60), unique=True)), dtype=np.int64)
    runs = [slice(first, first + len(wanted)) for first in range(len(held))]
    matching = [run for run in runs if len(wanted) and held[run].tolist() == wanted.tolist()]
    assert run_of(held, wanted) == (matching[0] if matching else None)
