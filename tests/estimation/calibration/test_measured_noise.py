"""How much poses and odometry scatter, out of a whole recording of known noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from estimation.calibration.measured_noise import (
    odometry_scatter,
    pose_scatter,
    robust_deviation,
    third_differences,
)
from formation.angles import FloatArray

EPOCH_NS = 1_700_000_000_000_000_000
LEAST_SPEED = 0.04


def drive(
    seconds: float = 20.0, rate: float = 120.0, kept: float = 1.0
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Stamps, poses (n, 3) without noise and motion (n, 2) on a curve, of which a share of frames is kept."""
    t = np.arange(round(seconds * rate)) / rate
    v, u = 0.1 + 0.03 * np.sin(1.1 * t), 0.5 * np.sin(0.8 * t)
    theta = 3.0 + np.cumsum(u) / rate
    x, y = np.cumsum(v * np.cos(theta)) / rate, np.cumsum(v * np.sin(theta)) / rate
    there = np.random.default_rng(5).random(len(t)) < kept
    stamps_ns = EPOCH_NS + np.round(t * 1e9).astype(np.int64)
    return stamps_ns[there], np.column_stack([x, y, theta])[there], np.column_stack([v, u])[there]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kept", [1.0, 0.6])
def test_noise_is_found_to_a_tenth_whatever_frames_are_lost(kept: float, seed: int) -> None:
    stamps_ns, poses, _ = drive(kept=kept)
    random = np.random.default_rng(seed)
    seen = poses + random.standard_normal(poses.shape) * [5e-4, 5e-4, 4e-3]
    place = pose_scatter(stamps_ns, seen[:, :2], seen[:, :2], LEAST_SPEED)
    heading = pose_scatter(stamps_ns, seen[:, 2:], seen[:, :2], LEAST_SPEED)
    assert place == pytest.approx(5e-4, rel=0.1)
    assert heading == pytest.approx(4e-3, rel=0.15)


def test_outliers_do_not_count_for_much() -> None:
    stamps_ns, poses, _ = drive()
    random = np.random.default_rng(1)
    noise = random.standard_normal((len(poses), 2)) * np.where(
        random.random((len(poses), 1)) < 0.02, 20.0, 1.0
    )
    seen = poses[:, :2] + 5e-4 * noise
    found = pose_scatter(stamps_ns, seen, seen, LEAST_SPEED)
    assert found == pytest.approx(5e-4, rel=0.2)


def test_shaking_that_neighbouring_frames_share_counts() -> None:
    stamps_ns, poses, _ = drive()
    t = (stamps_ns - EPOCH_NS) * 1e-9
    shaken = poses[:, :2] + 7e-4 * np.column_stack([np.sin(44.0 * t), np.cos(44.0 * t)])
    found = pose_scatter(stamps_ns, shaken, shaken, LEAST_SPEED)
    assert found is not None
    assert 3e-4 < found < 8e-4


def test_nothing_is_told_of_a_body_that_stands_or_was_hardly_seen() -> None:
    stamps_ns, poses, _ = drive()
    still = np.random.default_rng(1).standard_normal((len(poses), 2)) * 1e-5
    assert pose_scatter(stamps_ns, still, still, LEAST_SPEED) is None
    assert pose_scatter(stamps_ns[:50], poses[:50], poses[:50, :2], LEAST_SPEED) is None
    assert pose_scatter(stamps_ns[:0], poses[:0], poses[:0, :2], LEAST_SPEED) is None


@pytest.mark.parametrize("seed", range(5))
def test_weights_see_no_parabola_and_have_unit_gain(seed: int) -> None:
    times = np.sort(np.random.default_rng(seed).uniform(0.0, 0.1, (7, 4)), axis=1)
    weights = third_differences(times)
    for power in range(3):
        assert np.sum(weights * times**power, axis=1) == pytest.approx(0.0, abs=1e-12)
    assert np.linalg.norm(weights, axis=1) == pytest.approx(1.0)


def test_the_deviation_of_what_is_normal_is_its_own() -> None:
    normal = np.random.default_rng(2).standard_normal(20_000)
    assert robust_deviation(3.0 * normal) == pytest.approx(3.0, rel=0.02)
    assert robust_deviation(np.zeros(9)) == 0.0


def test_odometry_is_held_against_the_smoothed_track() -> None:
    stamps_ns, poses, motion = drive()
    random = np.random.default_rng(3)
    at = np.arange(0, len(stamps_ns), 4)
    told = motion[at] + random.standard_normal((len(at), 2)) * [4e-3, 0.02]
    seen = poses + random.standard_normal(poses.shape) * [2e-4, 2e-4, 2e-3]
    found = odometry_scatter(stamps_ns, seen, stamps_ns[at], told)
    assert found == pytest.approx((4e-3, 0.02), rel=0.12)
    assert odometry_scatter(stamps_ns, seen, stamps_ns[:0], told[:0]) is None
    assert odometry_scatter(stamps_ns, seen, stamps_ns[at] + 10**12, told) is None


def test_headings_may_pass_the_half_turn_when_unwrapped() -> None:
    stamps_ns, poses, _ = drive()
    turned = poses[:, 2] + np.linspace(0.0, 8.0 * math.pi, len(poses))
    noisy = turned + 3e-3 * np.random.default_rng(4).standard_normal(len(turned))
    wrapped = np.unwrap(np.angle(np.exp(1j * noisy)))
    found = pose_scatter(stamps_ns, wrapped[:, None], poses[:, :2], LEAST_SPEED)
    assert found == pytest.approx(3e-3, rel=0.15)
