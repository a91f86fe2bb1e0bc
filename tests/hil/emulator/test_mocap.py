from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, kstest

from formation.angles import wrap
from formation.pose import STANDSTILL, Motion, Pose
from hil.emulator.lab_messages import frame_message
from hil.emulator.mocap import (
    BodyNormals,
    CaptureClock,
    Delivery,
    MocapNoise,
    SeenPose,
    Shares,
    Stream,
    block_length,
    draw_block,
    observe,
    seen_pose,
    whole_ns,
)
from hil.emulator.robot import standing
from hil.wire.messages import encode
from hil.wire.reading import read_frame

DELIVERY = Delivery(latency=0.03, jitter=0.02, loss=0.05)
COUNT = 4000
# Kolmogorov-Smirnov on fixed seeds: a p-value below this would be a one-in-a-thousand coincidence.
UNLIKELY = 1e-3


def shares(seed: int) -> list[Shares]:
    return [Shares(*row) for row in draw_block(seed, Stream.MOCAP, 0, 6)[1][:COUNT].tolist()]


def test_normals_are_standard_normal_and_uncorrelated() -> None:
    columns = draw_block(3, Stream.MOCAP, 0, 6)[0][:COUNT].T
    assert columns.shape == (6, COUNT)
    for column in columns:
        assert kstest(column, "norm").pvalue > UNLIKELY
        assert abs(np.corrcoef(column[1:], column[:-1])[0, 1]) < 4.0 / math.sqrt(COUNT)
    off_diagonal = np.corrcoef(columns) - np.eye(6)
    assert np.max(np.abs(off_diagonal)) < 4.0 / math.sqrt(COUNT)


def test_delay_is_the_latency_and_an_exponential_jitter() -> None:
    delays = np.array([DELIVERY.time_on_the_way(each) for each in shares(4)])
    assert delays.min() >= 0.03
    assert kstest((delays - 0.03) / 0.02, "expon").pvalue > UNLIKELY
    steady = Delivery(latency=0.03, jitter=0.0, loss=0.0)
    assert {steady.time_on_the_way(each) for each in shares(4)} == {0.03}
    assert not steady.varies()
    assert steady._replace(jitter=0.02).varies()
    assert steady._replace(loss=0.1).varies()


def test_the_share_of_lost_frames_is_as_ordered_and_unrelated_to_their_delay() -> None:
    drawn = shares(5)
    lost = np.array([DELIVERY.loses(each) for each in drawn])
    low, high = binom.interval(0.999, COUNT, 0.05)
    assert low <= int(lost.sum()) <= high
    delays = np.array([DELIVERY.time_on_the_way(each) for each in drawn])
    assert abs(np.corrcoef(lost, delays)[0, 1]) < 4.0 / math.sqrt(COUNT)
    assert not any(Delivery(0.03, 0.0, 0.0).loses(each) for each in drawn)


def test_what_is_drawn_does_not_depend_on_the_order_of_asking() -> None:
    forward = [draw_block(6, Stream.MOCAP, block, 6)[0] for block in range(3)]
    backward = [draw_block(6, Stream.MOCAP, block, 6)[0] for block in reversed(range(3))]
    assert np.array_equal(forward, backward[::-1])
    assert len(np.unique(np.vstack(forward), axis=0)) == 3 * block_length(Stream.MOCAP)


def test_seeds_and_streams_are_independent() -> None:
    series = [draw_block(seed, stream, 0, 2)[0][:1000, 0] for seed in (1, 2, 2**62) for stream in Stream]
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
    seen = observe(standing(pose)._replace(motion=motion), noise, BodyNormals(1.0, -2.0, 0.5))
    assert seen.x - pose.x == pytest.approx(share * 1e-3)
    assert seen.y - pose.y == pytest.approx(share * -2e-3)
    assert seen.theta - pose.theta == pytest.approx(share * 0.01)


def test_headings_stay_on_the_circle() -> None:
    noise = MocapNoise(0.0, 0.1, 1.0)
    seen = observe(
        standing(Pose(0.0, 0.0, math.pi))._replace(motion=Motion(1.0, 0.0)), noise, BodyNormals(0.0, 0.0, 1.0)
    )
    assert seen.theta == pytest.approx(0.1 - math.pi)


def test_a_clock_of_its_own_is_ahead_drifts_and_jumps() -> None:
    clock = CaptureClock(offset=5.0, drift=1e-4, jump=-2.0, jump_at=3.0)
    second = 1_000_000_000
    assert clock.reading_ns(10 * second, 0, -1) == 15_001_000_000
    assert clock.reading_ns(10 * second, 0, 8 * second) == 15_001_000_000
    assert clock.reading_ns(10 * second, 0, 7 * second) == 13_001_000_000
    assert CaptureClock(0.0, 0.0, 0.0, 0.0).reading_ns(10 * second, 0, 0) == 10 * second


def yaw(seen: SeenPose) -> float:
    """Heading as a receiver works it out."""
    norm = math.sqrt(seen.qz * seen.qz + seen.qw * seen.qw)
    z, w = seen.qz / norm, seen.qw / norm
    return math.atan2(2.0 * (w * z), 1.0 - 2.0 * (z * z))


@given(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-math.pi, math.pi, exclude_min=True))
def test_what_a_frame_shows_is_to_the_bit_what_its_bytes_say(x: float, y: float, theta: float) -> None:
    pose = Pose(x, y, theta)
    payload = encode(frame_message(10**18, 7, [("leader", Pose(1.0, 0.0, 0.0)), ("follower", pose)]))
    seen = seen_pose(pose)
    assert read_frame(payload, "leader", "follower").follower == Pose(seen.x, seen.y, yaw(seen))
    assert abs(wrap(yaw(seen) - theta)) < 1e-15


@given(st.floats(-1e9, 1e9))
def test_times_in_whole_nanoseconds_are_off_by_half_a_one_at_most(seconds: float) -> None:
    assert abs(whole_ns(seconds) - seconds * 1e9) <= 0.5 + abs(seconds) * 1e9 * 4e-16
