"""Live check of a mount: what it finds, how fast and how surely, and that it does not cry wolf."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.models.measurement import PoseNoise
from estimation.tracking.mount_check import (
    MOST_YAW,
    NO_MOUNT_CHECK,
    NOTED_PLACE,
    NOTED_YAW,
    MountCheck,
    mount_checked,
    mount_left,
    surely_above,
)
from formation.kernel import entry
from formation.mount import Mount, body_pose
from formation.pose import Pose, advance
from formation.records import Rows, load, rows_of, store
from formation.wrapping import wrapped
from tests.bits import same_bits

NOISE = PoseNoise(3e-4, 3.5e-3)
RATE = 120


def drive(
    mount: Mount,
    seconds: float,
    seed: int = 0,
    *,
    kind: str = "winding",
    noise: PoseNoise = NOISE,
    rate: int = RATE,
) -> list[tuple[int, Pose]]:
    """Poses of a body as a motion capture shows it, by capture time [ns]."""
    random, pose, seen = np.random.default_rng(seed), Pose(0.0, 0.0, 2.0), []
    for k in range(round(seconds * rate)):
        t = k / rate
        v, u = 0.1, 0.7 * math.sin(1.6 * t + seed)
        if kind == "straight":
            u = 0.0
        elif kind == "stop and go":
            v, u = (0.1, u) if t % 3.0 < 1.5 else (0.0, 0.0)
        elif kind == "steps":
            v, u = (0.05, 0.15)[int(t) % 2], (0.7, -0.7)[int(t / 1.5) % 2]
        elif kind == "on the spot":
            v = 0.0
        pose = advance(pose, v, u, 1.0 / rate)
        body = body_pose(pose, mount)
        x, y, theta = (random.normal(size=3) * [noise.position, noise.position, noise.heading]).tolist()
        seen.append((round(1e9 * t), Pose(body.x + x, body.y + y, wrapped(body.theta + theta))))
    return seen


def checked(seen: list[tuple[int, Pose]], noise: PoseNoise = NOISE) -> MountCheck:
    check = NO_MOUNT_CHECK
    for at_ns, pose in seen:
        check = mount_checked(check, at_ns, pose, noise, False)
    return check


@pytest.mark.parametrize("degrees", [8.0, 10.0, 30.0, -60.0])
def test_a_heading_that_must_not_be_driven_by_is_found_within_five_seconds(degrees: float) -> None:
    for seed in range(10):
        check = checked(drive(Mount(0.0, 0.0, math.radians(degrees)), 5.0, seed))
        left = mount_left(check)
        assert check.off
        assert abs(left.yaw - math.radians(degrees)) < 4.0 * left.sd_yaw


@pytest.mark.parametrize(("place", "kind"), [(0.02, "winding"), (-0.05, "winding"), (0.05, "on the spot")])
def test_a_body_ahead_of_the_axis_is_found_within_five_seconds_of_turning(place: float, kind: str) -> None:
    for seed in range(10):
        left = mount_left(checked(drive(Mount(place, 0.0, 0.0), 5.0, seed, kind=kind)))
        assert surely_above(left.place, left.sd_place, NOTED_PLACE)
        assert abs(left.place - place) < 4.0 * left.sd_place


def test_a_straight_drive_tells_the_heading_and_no_place() -> None:
    left = mount_left(checked(drive(Mount(0.05, 0.0, 0.1), 10.0, kind="straight")))
    assert left.yaw == pytest.approx(0.1, abs=4.0 * left.sd_yaw)
    assert left.sd_yaw < 0.01
    assert not surely_above(left.place, left.sd_place, 0.0)


@pytest.mark.parametrize("kind", ["winding", "straight", "stop and go", "steps", "on the spot"])
@pytest.mark.parametrize(("noise", "rate"), [(NOISE, 120), (PoseNoise(5e-3, 1.75e-2), 120), (NOISE, 20)])
def test_a_right_mount_is_never_called_wrong(kind: str, noise: PoseNoise, rate: int) -> None:
    for seed in range(8):
        check = NO_MOUNT_CHECK
        for at_ns, pose in drive(Mount(0.0, 0.0, 0.0), 20.0, seed, kind=kind, noise=noise, rate=rate):
            check = mount_checked(check, at_ns, pose, noise, False)
            left = mount_left(check)
            assert not surely_above(left.yaw, left.sd_yaw, NOTED_YAW)
            assert not surely_above(left.place, left.sd_place, NOTED_PLACE)


def test_noise_that_is_ten_times_what_was_told_makes_it_uncertain_and_not_wrong() -> None:
    loud = PoseNoise(10.0 * NOISE.position, 10.0 * NOISE.heading)
    for seed in range(10):
        check = NO_MOUNT_CHECK
        for at_ns, pose in drive(Mount(0.0, 0.0, 0.0), 20.0, seed, noise=loud):
            check = mount_checked(check, at_ns, pose, NOISE, False)
            assert not check.off


def test_steps_of_the_motion_capture_are_not_taken_for_a_mount() -> None:
    for seed in range(10):
        random, check = np.random.default_rng(seed), NO_MOUNT_CHECK
        aside, turned = np.zeros(2), 0.0
        for k, (at_ns, pose) in enumerate(drive(Mount(0.0, 0.0, 0.0), 30.0, seed)):
            if k % 240 == 120:
                aside, turned = 0.03 * random.normal(size=2), 0.1 * random.normal()
            if k % 240 == 180:
                aside, turned = np.zeros(2), 0.0
            moved = Pose(pose.x + aside[0], pose.y + aside[1], wrapped(pose.theta + turned))
            check = mount_checked(check, at_ns, moved, NOISE, False)
            assert not check.off


def test_a_body_that_is_knocked_aside_is_noticed_and_a_robot_that_stands_forgets_nothing() -> None:
    before = drive(Mount(0.0, 0.0, 0.0), 20.0)
    after = drive(Mount(0.0, 0.0, math.radians(20.0)), 40.0, seed=1)
    check = checked(before)
    assert not check.off
    offset_ns, place = before[-1][0] + 10**9, after[0][1]
    for at_ns, pose in after:
        check = mount_checked(check, offset_ns + at_ns, pose, NOISE, False)
    assert check.off
    still = check
    for k in range(1200):
        still = mount_checked(still, offset_ns + 41 * 10**9 + k * 8_333_333, place, NOISE, False)
    assert mount_left(still) == mount_left(check)


def test_an_arc_begins_anew_after_a_jump_and_after_a_gap() -> None:
    begun = mount_checked(NO_MOUNT_CHECK, 0, Pose(0.0, 0.0, 0.0), NOISE, False)
    far = Pose(0.0, 0.1, 0.0)
    assert mount_checked(begun, 300_000_000, far, NOISE, True) == begun._replace(
        since_ns=300_000_000, since=far
    )
    assert mount_checked(begun, 2_000_000_000, far, NOISE, False) == begun._replace(
        since_ns=2_000_000_000, since=far
    )
    assert mount_checked(begun, 300_000_000, far, NOISE, False).arcs == 1.0


def test_the_limit_is_one_of_the_heading_that_is_left() -> None:
    for degrees, off in ((4.0, False), (8.0, True)):
        assert checked(drive(Mount(0.0, 0.0, math.radians(degrees)), 30.0)).off is off
    assert math.radians(4.0) < MOST_YAW < math.radians(8.0)


@entry
def all_watched(rows: Rows[MountCheck], poses: Rows[Pose], count: int) -> bool:
    """Watch poses that are a hundredth of a second apart in compiled code."""
    check = load(MountCheck, rows, 0)
    for k in range(count):
        check = mount_checked(check, k * 10_000_000, load(Pose, poses, k), PoseNoise(3e-4, 3.5e-3), False)
    store(rows, 0, check)
    return check.off


def test_compiled_and_plain_agree_to_the_last_bit() -> None:
    seen = [pose for _, pose in drive(Mount(0.03, 0.01, 0.2), 6.0)]
    rows, poses = rows_of(MountCheck, 1), rows_of(Pose, len(seen))
    store(rows, 0, NO_MOUNT_CHECK)
    for k, pose in enumerate(seen):
        store(poses, k, pose)
    off = all_watched(rows, poses, len(seen))
    check = NO_MOUNT_CHECK
    for k, pose in enumerate(seen):
        check = mount_checked(check, k * 10_000_000, pose, NOISE, False)
    assert off == check.off
    same_bits(load(MountCheck, rows, 0), check)
