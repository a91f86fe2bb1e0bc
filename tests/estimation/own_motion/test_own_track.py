from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.models.measurement import PoseNoise
from estimation.models.motion import FollowerMotion
from estimation.own_motion.own_track import OwnNoise, OwnTrack, fold, own_motion
from formation.angles import wrap
from formation.pose import Pose, advance

FRAME_NS = 16_000_000
NOISE = OwnNoise(PoseNoise(7e-4, 8e-3), v_max=0.2, u_max=0.6)


def driven(count: int, v: float, u: float, seed: int = 1) -> list[Pose]:
    """Noisy poses on a circle."""
    shake = np.random.default_rng(seed).normal(size=(count, 3)) * [7e-4, 7e-4, 8e-3]
    poses = [advance(Pose(1.0, 2.0, 3.0), v, u, k * FRAME_NS * 1e-9) for k in range(count)]
    return [
        Pose(p.x + d[0], p.y + d[1], float(wrap(p.theta + d[2])))
        for p, d in zip(poses, shake.tolist(), strict=True)
    ]


def folded(poses: list[Pose], odometry: FollowerMotion | None = None, span: float = 1.0) -> OwnTrack:
    track: OwnTrack = ()
    for k, pose in enumerate(poses):
        track = fold(track, k * FRAME_NS, pose, odometry, NOISE, span)
    return track


@pytest.mark.slow
def test_errors_are_as_large_as_the_filter_says() -> None:
    errors, sds = [], []
    for seed in range(60):
        motion = folded(driven(120, 0.08, 0.4, seed), span=0.0)[-1].motion
        errors.append((motion.v2 - 0.08, motion.u2 - 0.4))
        sds.append((motion.sd_v2, motion.sd_u2))
    # On a steady circle they are smaller: the sd also allows for a change of speed.
    ratio = np.sqrt(np.mean(np.square(errors), axis=0)) / np.mean(sds, axis=0)
    assert (ratio > 0.4).all()
    assert (ratio < 1.1).all()


@pytest.mark.slow
def test_a_filter_that_moves_as_assumed_has_the_variance_it_says() -> None:
    generator, ends = np.random.default_rng(4), []
    step = FRAME_NS * 1e-9
    for _ in range(80):
        pose, v, u, poses = Pose(0.0, 0.0, 0.0), 0.05, 0.0, []
        for _ in range(80):
            v += NOISE.v_max * math.sqrt(step) * generator.normal()
            u += NOISE.u_max * math.sqrt(step) * generator.normal()
            pose = advance(pose, v, u, step)
            shake = generator.normal(size=3) * [7e-4, 7e-4, 8e-3]
            poses.append(Pose(pose.x + shake[0], pose.y + shake[1], pose.theta + shake[2]))
        point = folded(poses, span=0.0)[-1]
        error = point.mean[3:] - [v, u]
        ends.append(error @ np.linalg.solve(point.covariance[3:, 3:], error))
    assert 1.5 < np.mean(ends) < 2.5


def test_odometry_helps_where_it_is_good_and_is_left_out_where_it_is_absurd() -> None:
    poses = driven(120, 0.08, 0.4)
    alone = folded(poses)[-1].motion
    helped = folded(poses, FollowerMotion(0.08, 0.4, 0.002, 0.01))[-1].motion
    assert helped.sd_u2 < 0.5 * alone.sd_u2
    assert helped.u2 == pytest.approx(0.4, abs=3.0 * helped.sd_u2)
    absurd = folded(poses, FollowerMotion(5.0, -9.0, 0.002, 0.01))[-1].motion
    assert (absurd.v2, absurd.u2) == pytest.approx((alone.v2, alone.u2), abs=0.02)


@given(st.permutations(range(12)), st.sets(st.integers(0, 11)))
def test_in_whatever_order_poses_come_the_track_is_that_of_their_capture_times(
    order: list[int], twice: set[int]
) -> None:
    poses = driven(20, 0.1, -0.5)
    expected = folded(poses)
    track = folded(poses[:8])
    for k in [*(8 + k for k in order), *(8 + k for k in twice)]:
        track = fold(track, k * FRAME_NS, poses[k], None, NOISE, 1.0)
    assert [point.capture_ns for point in track] == [point.capture_ns for point in expected]
    for one, other in zip(track, expected, strict=True):
        np.testing.assert_allclose(one.mean, other.mean, atol=1e-12)
        np.testing.assert_allclose(one.covariance, other.covariance, atol=1e-12)


def test_a_flipped_heading_is_left_out_and_a_robot_that_was_moved_is_found_again() -> None:
    poses = driven(60, 0.08, 0.2)
    before = folded(poses)
    flipped = Pose(poses[-1].x, poses[-1].y, wrap(poses[-1].theta + math.pi))
    after = fold(before, 60 * FRAME_NS, flipped, None, NOISE, 1.0)
    assert after[-1].motion.u2 == before[-1].motion.u2
    for k in range(61, 130):
        elsewhere = advance(Pose(9.0, 9.0, 0.0), 0.1, 0.0, k * FRAME_NS * 1e-9)
        after = fold(after, k * FRAME_NS, elsewhere, None, NOISE, 1.0)
    assert (after[-1].motion.v2, after[-1].motion.u2) == pytest.approx((0.1, 0.0), abs=0.01)


def test_after_a_long_silence_nothing_is_taken_for_known() -> None:
    track = fold(
        folded(driven(60, 0.08, 0.2)), 60 * FRAME_NS + 2_000_000_000, Pose(0, 0, 0), None, NOISE, 1.0
    )
    assert track[-1].motion == FollowerMotion(0.0, 0.0, NOISE.v_max, NOISE.u_max)


def test_the_track_keeps_its_span_and_knows_the_moments_of_its_poses_only() -> None:
    track = folded(driven(60, 0.08, 0.2), span=0.16)
    assert len(track) == 12
    assert all(before.capture_ns < after.capture_ns for before, after in pairwise(track))
    assert own_motion(track, 59 * FRAME_NS) == track[-1].motion
    assert own_motion(track, 59 * FRAME_NS - 1) is None
    assert own_motion(track, 60 * FRAME_NS) is None
    assert own_motion((), 0) is None
    assert fold(track, 5 * FRAME_NS, Pose(0, 0, 0), None, NOISE, 0.16) is track
