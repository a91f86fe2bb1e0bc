from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import binom, kstest

from formation.pose import STANDSTILL, Motion, Pose
from hil.emulator.mocap import CaptureClock, Delivery, MocapNoise, Stream, draw_frame, normals, observe

DELIVERY = Delivery(latency=0.03, jitter=0.02, loss=0.05)
COUNT = 4000
# Kolmogorov-Smirnov on fixed seeds: a p-value below this would be a one-in-a-thousand coincidence.
UNLIKELY = 1e-3


def test_normals_are_standard_normal_and_uncorrelated() -> None:
    draws = [draw_frame(3, index, DELIVERY) for index in range(COUNT)]
    columns = np.array([(*draw.bodies[0], *draw.bodies[1]) for draw in draws]).T
    assert columns.shape == (6, COUNT)
    for column in columns:
        assert kstest(column, "norm").pvalue > UNLIKELY
        assert abs(np.corrcoef(column[1:], column[:-1])[0, 1]) < 4.0 / math.sqrt(COUNT)
    off_diagonal = np.corrcoef(columns) - np.eye(6)
    assert np.max(np.abs(off_diagonal)) < 4.0 / math.sqrt(COUNT)


def test_delay_is_the_latency_and_an_exponential_jitter() -> None:
    delays = np.array([draw_frame(4, index, DELIVERY).delay for index in range(COUNT)])
    assert delays.min() >= 0.03
    assert kstest((delays - 0.03) / 0.02, "expon").pvalue > UNLIKELY
    steady = Delivery(latency=0.03, jitter=0.0, loss=0.0)
    assert {draw_frame(4, index, steady).delay for index in range(200)} == {0.03}


def test_the_share_of_lost_frames_is_as_ordered_and_unrelated_to_their_delay() -> None:
    draws = [draw_frame(5, index, DELIVERY) for index in range(COUNT)]
    lost = np.array([draw.lost for draw in draws])
    low, high = binom.interval(0.999, COUNT, 0.05)
    assert low <= int(lost.sum()) <= high
    delays = np.array([draw.delay for draw in draws])
    assert abs(np.corrcoef(lost, delays)[0, 1]) < 4.0 / math.sqrt(COUNT)
    assert not any(draw_frame(5, index, Delivery(0.03, 0.0, 0.0)).lost for index in range(500))


def test_what_is_drawn_does_not_depend_on_the_order_of_asking() -> None:
    forward = [draw_frame(6, index, DELIVERY) for index in range(300)]
    backward = [draw_frame(6, index, DELIVERY) for index in reversed(range(300))]
    assert forward == backward[::-1]
    assert len({draw.bodies[0] for draw in forward}) == 300


def test_seeds_and_streams_are_independent() -> None:
    series = [
        np.array([normals(seed, stream, index, 2)[0] for index in range(1000)])
        for seed in (1, 2, 2**62)
        for stream in Stream
    ]
    assert np.max(np.abs(np.corrcoef(series) - np.eye(len(series)))) < 5.0 / math.sqrt(1000)


@pytest.mark.parametrize(
    ("motion", "share"),
    [
        (STANDSTILL, 0.05),
        (Motion(0.05, 0.0), 1.0),
        (Motion(0.0, -0.2), 1.0),
        (Motion(1.0, 3.0), 1.0),
        (Motion(0.025, 0.0), 0.525),
    ],
)
def test_noise_rises_with_motion_from_its_static_share(motion: Motion, share: float) -> None:
    noise = MocapNoise(sigma_position=1e-3, sigma_heading=0.02, static_fraction=0.05)
    pose = Pose(1.0, -2.0, 0.5)
    seen = observe(pose, motion, noise, (1.0, -2.0, 0.5))
    assert seen.x - pose.x == pytest.approx(share * 1e-3)
    assert seen.y - pose.y == pytest.approx(share * -2e-3)
    assert seen.theta - pose.theta == pytest.approx(share * 0.01)


def test_headings_stay_on_the_circle() -> None:
    noise = MocapNoise(0.0, 0.1, 1.0)
    seen = observe(Pose(0.0, 0.0, math.pi), Motion(1.0, 0.0), noise, (0.0, 0.0, 1.0))
    assert seen.theta == pytest.approx(0.1 - math.pi)


def test_a_clock_of_its_own_is_ahead_drifts_and_jumps() -> None:
    clock = CaptureClock(offset=5.0, drift=1e-4, jump=-2.0, jump_at=3.0)
    second = 1_000_000_000
    assert clock.stamp_ns(10 * second, 0, None) == 15_001_000_000
    assert clock.stamp_ns(10 * second, 0, 8 * second) == 15_001_000_000
    assert clock.stamp_ns(10 * second, 0, 7 * second) == 13_001_000_000
    assert CaptureClock().stamp_ns(10 * second, 0, 0) == 10 * second
