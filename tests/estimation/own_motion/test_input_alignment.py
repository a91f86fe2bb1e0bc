from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from estimation.own_motion.input_alignment import UNKNOWN, Alignment, align_odometry
from formation.angles import FloatArray, wrap
from formation.pose import Pose, advance

STEP_S = 0.016


def odometry(t: FloatArray, seed: int = 0) -> FloatArray:
    """Odometry of a robot that changes its mind every second or so."""
    generator = np.random.default_rng(seed)
    moments = np.cumsum(generator.uniform(0.5, 2.0, 100))
    values = generator.uniform([0.02, -0.5], [0.1, 0.5], (101, 2))
    return np.asarray(values[np.searchsorted(moments, t)])


def seen(t: FloatArray, motion: FloatArray, noise: float = 1.0) -> FloatArray:
    """Noisy poses of a robot that moves as given, sample by sample."""
    generator, pose, rows = np.random.default_rng(1), Pose(0.0, 0.0, 3.0), []
    for v, u in motion.tolist():
        rows.append((pose.x, pose.y, pose.theta))
        pose = advance(pose, v, u, STEP_S)
    shake = noise * generator.normal(size=(len(t), 3)) * [7e-4, 7e-4, 8e-3]
    poses = np.array(rows).reshape(-1, 3) + shake
    poses[:, 2] = wrap(poses[:, 2])
    return poses


FINE = 16


def motion(t: FloatArray, delay: float, lag: float, seed: int) -> FloatArray:
    """Mean motion over each step of a robot that answers to the odometry late, by a filter on fine steps."""
    fine = t[0] - 4.0 + (np.arange(round((t[-1] - t[0] + 4.0) / STEP_S + 1) * FINE) + 0.5) * STEP_S / FINE
    told = odometry(fine - delay, seed)
    if lag > 0.0:
        keep = math.exp(-STEP_S / FINE / lag)
        told = np.asarray(lfilter([1.0 - keep], [1.0, -keep], told, axis=0, zi=keep * told[:1])[0])
    return np.asarray(told.reshape(-1, FINE, 2).mean(axis=1)[-len(t) :])


def aligned(
    delay: float, scale_v: float, scale_u: float, seed: int = 0, noise: float = 1.0, lag: float = 0.0
) -> Alignment:
    t = np.arange(0.0, 60.0, STEP_S)
    moved = motion(t, delay, lag, seed) * [scale_v, scale_u]
    late = np.arange(0.003, 60.0, 0.03)
    return align_odometry(t, seen(t, moved, noise), late, odometry(late, seed))


@given(
    delay=st.floats(-0.5, 0.5),
    scale_v=st.floats(0.8, 1.2),
    scale_u=st.floats(0.8, 1.2),
    seed=st.integers(0, 50),
)
@settings(max_examples=12)
def test_delay_and_scales_are_found_within_what_is_said_of_them(
    delay: float, scale_v: float, scale_u: float, seed: int
) -> None:
    found = aligned(delay, scale_v, scale_u, seed)
    assert found.delay is not None
    assert found.scale_v is not None
    assert found.scale_u is not None
    assert found.delay.value == pytest.approx(delay, abs=4.0 * found.delay.sd + 0.01)
    assert found.scale_v.value == pytest.approx(scale_v, abs=4.0 * found.scale_v.sd + 0.01)
    assert found.scale_u.value == pytest.approx(scale_u, abs=4.0 * found.scale_u.sd + 0.01)
    assert found.delay.sd < 0.02
    assert found.scale_u.sd < 0.05
    # A delay is not split.
    assert found.lag is None or found.lag.value == 0.0
    assert found.late == found.delay


@given(
    delay=st.floats(-0.1, 0.4), lag=st.floats(0.12, 0.4), scale_u=st.floats(0.8, 1.2), seed=st.integers(0, 50)
)
@settings(max_examples=8, deadline=None)
def test_a_lag_is_told_apart_from_a_delay(delay: float, lag: float, scale_u: float, seed: int) -> None:
    found = aligned(delay, 0.95, scale_u, seed, lag=lag)
    assert found.delay is not None
    assert found.lag is not None
    assert found.late is not None
    assert found.scale_u is not None
    assert found.lag.value == pytest.approx(lag, abs=4.0 * found.lag.sd + 0.01)
    assert found.delay.value == pytest.approx(delay, abs=4.0 * found.delay.sd + 0.01)
    assert found.late.value == pytest.approx(delay + lag, abs=4.0 * found.late.sd + 0.01)
    assert found.late.value == pytest.approx(found.delay.value + found.lag.value, abs=1e-9)
    # How the two share it is known less well.
    assert found.late.sd < found.lag.sd < 0.05
    assert found.scale_u.value == pytest.approx(scale_u, abs=4.0 * found.scale_u.sd + 0.01)


def test_standard_deviations_are_those_of_the_errors() -> None:
    errors = []
    for seed in range(12):
        found = aligned(0.08, 0.9, 1.1, seed, lag=0.15)
        for known, true in ((found.delay, 0.08), (found.lag, 0.15), (found.late, 0.23)):
            assert known is not None
            errors.append((known.value - true) / known.sd)
    assert 0.3 < np.sqrt(np.mean(np.square(errors))) < 1.5


def test_slow_motion_tells_a_sum_but_no_lag() -> None:
    t = np.arange(0.0, 60.0, STEP_S)
    slow = np.column_stack([0.1 + 0.03 * np.sin(0.5 * t), 0.3 * np.sin(0.4 * t)])
    late = np.column_stack([0.1 + 0.03 * np.sin(0.5 * (t - 0.2)), 0.3 * np.sin(0.4 * (t - 0.2))])
    found = align_odometry(t, seen(t, late), t, slow)
    assert found.lag is None
    assert found.late is not None
    assert found.late.value == pytest.approx(0.2, abs=4.0 * found.late.sd)


def test_a_robot_that_drives_straight_and_evenly_lets_its_speed_be_compared_only() -> None:
    t = np.arange(0.0, 60.0, STEP_S)
    steady = np.tile([0.1, 0.0], (len(t), 1))
    found = align_odometry(t, seen(t, 0.9 * steady), t, steady)
    assert found.delay is None
    assert found.scale_u is None
    assert found.scale_v is not None
    assert found.scale_v.value == pytest.approx(0.9, abs=0.005)


def test_of_a_robot_that_stands_nothing_is_known() -> None:
    t = np.arange(0.0, 60.0, STEP_S)
    still = np.zeros((len(t), 2))
    assert align_odometry(t, seen(t, still), t, still) == UNKNOWN
    noisy = 1e-4 * np.random.default_rng(2).normal(size=still.shape)
    assert align_odometry(t, seen(t, still), t, noisy) == UNKNOWN


def test_a_delay_beyond_those_that_are_tried_is_not_made_up() -> None:
    assert aligned(3.0, 0.9, 0.9).delay is None


@pytest.mark.parametrize("count", [0, 1, 2, 200])
def test_of_a_short_span_nothing_is_known(count: int) -> None:
    t = np.arange(float(count)) * STEP_S
    assert align_odometry(t, seen(t, odometry(t)).reshape(-1, 3), t, odometry(t).reshape(-1, 2)) == UNKNOWN


def test_what_is_not_covered_by_both_is_left_out() -> None:
    t = np.arange(0.0, 60.0, STEP_S)
    poses = seen(t, odometry(t - 0.2))
    poses[(t > 20.0) & (t < 25.0)] += 5.0
    kept = (t < 20.0) | (t > 25.0)
    found = align_odometry(t[kept], poses[kept], t[t < 50.0], odometry(t[t < 50.0]))
    assert found.delay is not None
    assert found.delay.value == pytest.approx(0.2, abs=0.02)
