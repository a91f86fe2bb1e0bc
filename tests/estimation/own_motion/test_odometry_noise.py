from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import PoseNoise
from estimation.own_motion.odometry_check import OdometrySample, WayEntry, Ways
from estimation.own_motion.odometry_history import InputTrust
from estimation.own_motion.odometry_noise import (
    ODOMETRY_AS_TOLD,
    OdometryNoise,
    noise_with_sample,
    noise_with_window,
    with_found_noise,
)
from estimation.own_motion.own_track import OwnNoise
from formation.pose import Pose

TRUST = InputTrust(0.005, 0.03)
LIMITS = OwnNoise(PoseNoise(0.0003, 0.0035), 0.22, 2.84)
TOLD = FollowerMotion(0.1, 0.4, TRUST.sd_v2, TRUST.sd_u2)
NOTHING = Ways(0.0, 0.0)


def after_samples(sd_v: float, sd_u: float, seed: int, *, drives: bool = True) -> OdometryNoise:
    """Noise after 20 s of a robot that steers smoothly, or stands."""
    rng = np.random.default_rng(seed)
    noise, last = ODOMETRY_AS_TOLD, None
    for k in range(600):
        t = k / 30.0
        v, u = (0.1, 0.5 * math.sin(0.5 * t)) if drives else (0.0, 0.0)
        told = v + sd_v * rng.normal(), u + sd_u * rng.normal()
        sample = OdometrySample(round(t * 1e9), *told, False, Pose(0.0, 0.0, 0.0))
        if last is not None:
            noise = noise_with_sample(noise, last, sample, TRUST, LIMITS)
        last = sample
    return noise


def after_windows(noise: OdometryNoise, off_u: float, seed: int) -> OdometryNoise:
    """Noise after 30 s of windows in which odometry turns too fast by as much, and the track is noisy."""
    rng = np.random.default_rng(seed)
    for _ in range(60):
        place, heading = math.sqrt(2.0) * 0.0003 * rng.normal(), math.sqrt(2.0) * 0.0035 * rng.normal()
        begin = WayEntry(0, NOTHING, NOTHING, NOTHING)
        told, shown = Ways(0.05, 0.2 + 0.5 * off_u), Ways(0.05 + place, 0.2 + heading)
        noise = noise_with_window(noise, begin, WayEntry(500_000_000, told, NOTHING, shown), TRUST, LIMITS)
    return noise


@pytest.mark.parametrize("sd_u", [0.003, 0.01, 0.1])
@pytest.mark.parametrize("seed", range(3))
def test_white_noise_is_found_from_samples_alone(sd_u: float, seed: int) -> None:
    noise = after_samples(0.2 * sd_u, sd_u, seed)
    assert math.sqrt(noise.u.white) == pytest.approx(sd_u, rel=0.2)
    assert math.sqrt(noise.v.white) == pytest.approx(0.2 * sd_u, rel=0.2)


def test_a_robot_that_stands_tells_nothing() -> None:
    assert with_found_noise(TOLD, after_samples(0.0, 0.0, 0, drives=False)) == TOLD


@pytest.mark.parametrize("seed", range(3))
def test_deviations_come_down_to_what_samples_show_where_nothing_lasts(seed: int) -> None:
    found = with_found_noise(TOLD, after_windows(after_samples(0.002, 0.01, seed), 0.0, seed))
    assert 0.8 * 0.01 < found.sd_u2 < 1.4 * 0.01
    assert 0.8 * 0.002 < found.sd_v2 < 1.4 * 0.002


@pytest.mark.parametrize("seed", range(3))
def test_an_error_that_lasts_stays_in_the_deviation(seed: int) -> None:
    found = with_found_noise(TOLD, after_windows(after_samples(0.002, 0.002, seed), 0.03, seed))
    assert found.sd_u2 == pytest.approx(0.03, rel=0.25)
