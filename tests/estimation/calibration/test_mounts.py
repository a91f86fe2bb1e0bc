"""Mounts found from motion: right, as certain as is said, and silent where the motion is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.calibration.mounts import (
    NOTHING_FOUND,
    FoundMount,
    WheelSpeed,
    find_mount,
    short_drive_mount,
)
from estimation.models.measurement import PoseNoise
from formation.angles import FloatArray, wrap
from formation.mount import Mount
from formation.pose import Pose

MOUNT = Mount(0.05, -0.02, 0.3)
STEP = 1.0 / 1200.0


def drive(
    seed: int,
    *,
    seconds: float = 30.0,
    rate: int = 120,
    noise: float = 3e-4,
    turn: float = 0.7,
    omega: float = 1.57,
    mean_turn: float = 0.0,
    faster_by_turn: float = 0.0,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times, poses of a body at MOUNT and true speeds; the heading's noise is 12 rad/m of it."""
    random = np.random.default_rng(seed)
    t = np.arange(round(seconds / STEP), dtype=np.float64) * STEP
    u = mean_turn + turn * np.sin(omega * t + seed)
    v: FloatArray = 0.08 + faster_by_turn * u
    theta = np.cumsum(u) * STEP + random.uniform(-3.0, 3.0)
    x, y = np.cumsum(v * np.cos(theta)) * STEP, np.cumsum(v * np.sin(theta)) * STEP
    seen = slice(None, None, 1200 // rate)
    cos, sin = np.cos(theta), np.sin(theta)
    poses = np.column_stack(
        [x + cos * MOUNT.x - sin * MOUNT.y, y + sin * MOUNT.x + cos * MOUNT.y, theta + MOUNT.yaw]
    )[seen]
    poses += noise * random.normal(size=poses.shape) * [1.0, 1.0, 12.0]
    poses[:, 2] = wrap(poses[:, 2])
    return t[seen], poses, v[seen]


def wheels(t: FloatArray, v: FloatArray, seed: int, *, scale: float = 1.0, late: float = 0.0) -> WheelSpeed:
    """Odometry of a robot at 30 Hz."""
    random = np.random.default_rng(100 + seed)
    return WheelSpeed(t[::4] + late, scale * v[::4] + 0.002 * random.normal(size=len(t[::4])))


def errors(found: FoundMount) -> tuple[FloatArray, FloatArray]:
    """Errors of x, y, yaw and their standard deviations; NaN where they are not known."""
    values = [math.nan if value is None else value for value in (found.x, found.y, found.yaw)]
    return np.array(values) - MOUNT, np.array([math.nan if sd is None else sd for sd in found.sd])


@pytest.mark.parametrize("noise", [3e-4, 3e-3])
def test_half_a_minute_of_winding_tells_all_and_how_well(noise: float) -> None:
    found = [errors(find_mount(*drive(seed, noise=noise)[:2])) for seed in range(25)]
    off, sd = (np.array(part) for part in zip(*found, strict=True))
    assert (np.abs(off).max(axis=0) < np.array([1e-4, 1e-4, 5e-4]) * (noise / 3e-4)).all()
    spread = np.sqrt(np.mean(np.square(off / sd), axis=0))
    assert (spread > 0.3).all()
    assert (spread < 1.5).all()


def test_wheels_tell_the_place_of_a_robot_that_drives_faster_in_left_turns() -> None:
    found = []
    for seed in range(12):
        t, poses, v = drive(seed, faster_by_turn=0.05)
        found.append(errors(find_mount(t, poses, wheels(t, v, seed, scale=1.1, late=0.02))))
    off, sd = (np.array(part) for part in zip(*found, strict=True))
    assert (np.abs(off).max(axis=0) < [2e-4, 5e-4, 5e-4]).all()
    assert (np.abs(off / sd) < 4.5).all()


def test_a_straight_line_tells_the_yaw_alone() -> None:
    for seed in range(5):
        found = find_mount(*drive(seed, turn=0.0)[:2])
        assert (found.x, found.y, found.sd[0], found.sd[1]) == (None, None, None, None)
        assert found.yaw == pytest.approx(MOUNT.yaw, abs=1e-3)


def test_a_steady_circle_tells_no_place_and_neither_does_standing() -> None:
    for seed in range(5):
        found = find_mount(*drive(seed, turn=0.0, mean_turn=0.4)[:2])
        assert found.x is None
        assert found.y is None
        assert found.yaw is None or abs(found.yaw - MOUNT.yaw) < 4.0 * (found.sd[2] or 0.0)
    t = np.arange(0.0, 10.0, 0.01)
    still = np.random.default_rng(0).normal(size=(len(t), 3)) * [3e-4, 3e-4, 3e-3]
    assert find_mount(t, still) == NOTHING_FOUND


def test_too_little_tells_nothing() -> None:
    t, poses, _ = drive(0, seconds=2.0)
    for n in (0, 1, 2, len(t)):
        assert find_mount(t[:n], poses[:n]) == NOTHING_FOUND


def test_wrong_poses_in_between_do_not_count() -> None:
    for seed in range(5):
        t, poses, _ = drive(seed)
        random = np.random.default_rng(seed)
        for first in random.integers(0, len(t) - 60, size=6):
            poses[first : first + 30] += random.normal(size=3) * [0.03, 0.03, 0.3]
        poses[:, 2] = wrap(poses[:, 2])
        off, _ = errors(find_mount(t, poses))
        assert (np.abs(off) < [5e-4, 5e-4, 2e-3]).all()


def test_gaps_and_slow_frames_are_no_hindrance() -> None:
    t, poses, _ = drive(3)
    there = (t % 7.0) > 1.0
    off, _ = errors(find_mount(t[there], poses[there]))
    assert (np.abs(off) < [2e-4, 2e-4, 1e-3]).all()
    off, _ = errors(find_mount(*drive(3, rate=10)[:2]))
    assert (np.abs(off) < [5e-4, 5e-4, 2e-3]).all()


def test_what_is_not_known_is_taken_from_before() -> None:
    before = Mount(0.1, 0.2, 0.3)
    assert FoundMount(0.5, None, None, (1e-3, None, None)).mount(before) == Mount(0.5, 0.2, 0.3)


def short_drive(seconds: float, seed: int = 0) -> FoundMount:
    t, poses, _ = drive(seed, seconds=seconds)
    stamps = [round(1e9 * at) for at in t.tolist()]
    return short_drive_mount(stamps, [Pose(*row) for row in poses.tolist()], PoseNoise(3e-4, 3.6e-3))


def test_three_seconds_tell_yaw_and_what_is_ahead_but_not_beside() -> None:
    found = [short_drive(3.5, seed) for seed in range(20)]
    assert find_mount(*drive(0, seconds=3.5)[:2]) == NOTHING_FOUND
    off = np.array([errors(each)[0] for each in found])
    sds = np.array([errors(each)[1] for each in found])
    assert np.all(np.isnan(off[:, 1]))
    assert np.nanmax(sds[:, 2]) < math.radians(2.0)
    scores = (off / sds)[:, [0, 2]]
    assert np.sqrt(np.nanmean(np.square(scores))) < 1.5
    assert np.isfinite(scores).mean() > 0.9


def test_a_drive_of_a_second_tells_nothing() -> None:
    assert short_drive(1.0) == NOTHING_FOUND
