from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from estimation.calibration.smoothed_track import poses_at, smoothed_motion, travelled_motion
from formation.angles import FloatArray, wrap
from formation.pose import Pose, advance

STEP_NS = 16_000_000


def arc(count: int, v: float, u: float, theta: float = 3.0) -> FloatArray:
    """Poses of a robot on a circle; the heading wraps on the way."""
    step_s = STEP_NS * 1e-9
    poses = [advance(Pose(1.0, -2.0, theta), v, u, k * step_s) for k in range(count)]
    return np.array([(pose.x, pose.y, pose.theta) for pose in poses])


@given(st.floats(-0.3, 0.3), st.floats(-1.0, 1.0), st.floats(-3.1, 3.1))
def test_on_a_circle_the_motion_is_that_of_the_circle(v: float, u: float, theta: float) -> None:
    stamps, poses = np.arange(200) * STEP_NS, arc(200, v, u, theta)
    found = smoothed_motion(stamps, poses, stamps)
    inner = slice(20, -20)
    np.testing.assert_allclose(found.motion[inner], [[v, u]] * 160, atol=1e-3)
    np.testing.assert_allclose(found.poses[inner, :2], poses[inner, :2], atol=1e-3)
    np.testing.assert_allclose(wrap(found.poses[inner, 2] - poses[inner, 2]), 0.0, atol=1e-3)


def test_noise_of_a_camera_system_hardly_moves_it() -> None:
    stamps, generator = np.arange(2000) * STEP_NS, np.random.default_rng(3)
    poses = arc(2000, 0.08, 0.3) + generator.normal(size=(2000, 3)) * [7e-4, 7e-4, 8e-3]
    found = smoothed_motion(stamps, poses, stamps).motion[20:-20]
    assert (np.std(found, axis=0) < [0.003, 0.04]).all()
    np.testing.assert_allclose(found.mean(axis=0), [0.08, 0.3], atol=2e-3)


def test_it_neither_lags_nor_leads_a_change_of_speed() -> None:
    step_s = STEP_NS * 1e-9
    stamps = np.arange(400) * STEP_NS
    speed = 0.05 + 0.03 * np.sin(stamps * 1e-9)
    poses = np.column_stack([np.cumsum(speed) * step_s, np.zeros(400), np.zeros(400)])
    found = smoothed_motion(stamps, poses, stamps).motion[20:-20, 0]
    # A sum of speeds is the place half a step later.
    expected = np.interp(stamps[20:-20] + 0.5 * STEP_NS, stamps, speed)
    np.testing.assert_allclose(found, expected, atol=1e-3)


def test_nothing_is_known_at_the_ends_in_gaps_and_outside() -> None:
    stamps = np.concatenate([np.arange(100), np.arange(120, 200)]) * STEP_NS
    poses = np.vstack([arc(200, 0.1, 0.2)[:100], arc(200, 0.1, 0.2)[120:]])
    moments = np.array([-1, 5, 50, 95, 110, 125, 160, 198, 220]) * STEP_NS
    known = np.isfinite(smoothed_motion(stamps, poses, moments).motion[:, 0])
    assert known.tolist() == [False, False, True, False, False, False, True, False, False]
    known = np.isfinite(poses_at(stamps, poses, moments)[:, 2])
    assert known.tolist() == [False, True, True, True, False, True, True, True, False]
    few = smoothed_motion(stamps[:10], poses[:10], moments)
    assert np.isnan(few.poses).all()
    assert np.isnan(few.motion).all()


def test_between_two_poses_a_heading_turns_the_short_way() -> None:
    poses = np.array([[0.0, 0.0, 3.1], [1.0, 2.0, -3.1]])
    (middle,) = poses_at(np.array([0, STEP_NS]), poses, np.array([STEP_NS // 2]))
    np.testing.assert_allclose(middle[:2], [0.5, 1.0])
    assert abs(abs(middle[2]) - np.pi) < 1e-9


@given(
    st.floats(0.05, 0.3), st.floats(-0.8, 0.8), st.floats(-3.1, 3.1), st.sampled_from([0.0, 1.5, 3.0, None])
)
def test_who_travels_is_told_by_its_travel_wherever_its_body_looks(
    v: float, u: float, theta: float, aside: float | None
) -> None:
    stamps, poses = np.arange(200) * STEP_NS, arc(200, v, u, theta)
    shown = poses.copy()
    shown[:, 2] = np.nan if aside is None else wrap(poses[:, 2] + aside)
    found = travelled_motion(stamps, shown, stamps, 0.02)
    inner = slice(35, -35)
    np.testing.assert_allclose(found.motion[inner], [[v, u]] * 130, atol=3e-3)
    np.testing.assert_allclose(found.poses[inner, :2], poses[inner, :2], atol=1e-3)
    np.testing.assert_allclose(wrap(found.poses[inner, 2] - poses[inner, 2]), 0.0, atol=5e-3)


def test_a_body_that_is_carried_is_told_by_its_travel_though_it_turns_as_it_likes() -> None:
    stamps, poses = np.arange(400) * STEP_NS, arc(400, 0.2, 0.3)
    shown = poses.copy()
    shown[:, 2] = wrap(2.0 * np.sin(3.0 * stamps * 1e-9))
    found = travelled_motion(stamps, shown, stamps, 0.02)
    np.testing.assert_allclose(found.motion[40:-40], [[0.2, 0.3]] * 320, atol=3e-3)


def test_who_stands_looks_where_it_will_travel() -> None:
    stamps = np.arange(300) * STEP_NS
    way = np.maximum(0.0, 0.1 * (stamps * 1e-9 - 2.0))
    poses = np.column_stack([way * np.cos(0.7), way * np.sin(0.7), np.full(300, np.nan)])
    found = travelled_motion(stamps, poses, stamps, 0.02)
    np.testing.assert_allclose(found.poses[20:-20, 2], 0.7, atol=1e-6)
    np.testing.assert_allclose(found.motion[20:90, 0], 0.0, atol=1e-6)
    standing = travelled_motion(stamps, np.zeros((300, 3)), stamps, 0.02)
    assert np.isnan(standing.poses).all()


@given(st.floats(0.03, 0.3), st.sampled_from([0.0, np.nan]), st.integers(0, 9))
def test_who_sets_off_was_not_seen_to_drive_back_before(v: float, shown: float, seed: int) -> None:
    stamps, generator = np.arange(300) * STEP_NS, np.random.default_rng(seed)
    way = v * np.maximum(0.0, stamps * 1e-9 - 2.0)
    poses = np.column_stack([way, np.zeros(300), np.full(300, shown)])
    poses[:, :2] += generator.normal(size=(300, 2)) * 3e-4
    found = travelled_motion(stamps, poses, stamps, 0.01)
    inner = slice(20, -20)
    assert (found.motion[inner, 0] >= 0.0).all()
    assert (np.abs(found.poses[inner, 2]) < 0.3).all()
    np.testing.assert_allclose(found.motion[-120:-20, 0], v, atol=6e-3)


def test_who_drives_back_is_seen_to() -> None:
    stamps = np.arange(400) * STEP_NS
    way = 0.1 * np.abs(stamps * 1e-9 - 3.0)
    found = travelled_motion(stamps, np.column_stack([way, np.zeros(400), np.zeros(400)]), stamps, 0.01)
    np.testing.assert_allclose(np.abs(found.motion[20:160, 0]), 0.1, atol=1e-3)
    np.testing.assert_allclose(np.abs(found.motion[220:-20, 0]), 0.1, atol=1e-3)
    turn = found.motion[20:160, 0] * np.cos(found.poses[20:160, 2])
    np.testing.assert_allclose(turn, -0.1, atol=1e-3)
