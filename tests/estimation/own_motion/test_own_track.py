from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import PoseNoise
from estimation.models.motion import Matrix, Vector
from estimation.own_motion.own_track import (
    OwnNoise,
    OwnPoint,
    folded,
    motion_of,
    own_begun,
    own_followed,
    own_place,
    own_point,
    own_predicted,
)
from formation.angles import wrap
from formation.pose import Pose, advance
from formation.records import columns_of, rows_of
from formation.ring import EMPTY

FRAME_NS = 16_000_000
NOISE = OwnNoise(PoseNoise(7e-4, 8e-3), v_max=0.2, u_max=0.6)
NO_ODOMETRY = FollowerMotion(0.0, 0.0, 0.0, 0.0)


def driven(count: int, v: float, u: float, seed: int = 1) -> list[Pose]:
    """Noisy poses on a circle."""
    shake = np.random.default_rng(seed).normal(size=(count, 3)) * [7e-4, 7e-4, 8e-3]
    poses = [advance(Pose(1.0, 2.0, 3.0), v, u, k * FRAME_NS * 1e-9) for k in range(count)]
    return [
        Pose(p.x + d[0], p.y + d[1], float(wrap(p.theta + d[2])))
        for p, d in zip(poses, shake.tolist(), strict=True)
    ]


class OwnTrack:
    """A track in rows of its own."""

    def __init__(self, span: float = 1.0, room: int = 256) -> None:
        self.rows, self.ring, self.span = rows_of(OwnPoint, room), EMPTY, span

    def fold(self, capture_ns: int, pose: Pose, odometry: FollowerMotion | None = None) -> None:
        due = own_begun(capture_ns, pose, odometry is not None, odometry or NO_ODOMETRY, NOISE)
        self.ring = folded(self.rows, self.ring, due, NOISE, self.span)

    def points(self) -> list[OwnPoint]:
        return [own_point(self.rows, self.ring, k) for k in range(self.ring.length)]

    def motion(self) -> FollowerMotion:
        return motion_of(self.points()[-1])


def track_of(
    poses: list[Pose], odometry: FollowerMotion | None = None, span: float = 1.0, room: int = 256
) -> OwnTrack:
    track = OwnTrack(span, room)
    for k, pose in enumerate(poses):
        track.fold(k * FRAME_NS, pose, odometry)
    return track


def motion_block(point: OwnPoint) -> Matrix:
    """Covariance (2, 2) of v and u."""
    spread = point.spread
    return np.array([[spread.v_v, spread.v_u], [spread.v_u, spread.u_u]])


@pytest.mark.slow
def test_errors_are_as_large_as_the_filter_says() -> None:
    errors, sds = [], []
    for seed in range(60):
        motion = track_of(driven(120, 0.08, 0.4, seed), span=0.0).motion()
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
        point = track_of(poses, span=0.0).points()[-1]
        error = np.array([point.state.v - v, point.state.u - u])
        ends.append(error @ np.linalg.solve(motion_block(point), error))
    assert 1.5 < np.mean(ends) < 2.5


def test_odometry_helps_where_it_is_good_and_is_left_out_where_it_is_absurd() -> None:
    poses = driven(120, 0.08, 0.4)
    alone = track_of(poses).motion()
    helped = track_of(poses, FollowerMotion(0.08, 0.4, 0.002, 0.01)).motion()
    assert helped.sd_u2 < 0.5 * alone.sd_u2
    assert helped.u2 == pytest.approx(0.4, abs=3.0 * helped.sd_u2)
    absurd = track_of(poses, FollowerMotion(5.0, -9.0, 0.002, 0.01)).motion()
    assert (absurd.v2, absurd.u2) == pytest.approx((alone.v2, alone.u2), abs=0.02)


@given(st.permutations(range(12)), st.sets(st.integers(0, 11)))
def test_in_whatever_order_poses_come_the_track_is_that_of_their_capture_times(
    order: list[int], twice: set[int]
) -> None:
    poses = driven(20, 0.1, -0.5)
    expected = track_of(poses)
    track = track_of(poses[:8])
    for k in [*(8 + k for k in order), *(8 + k for k in twice)]:
        track.fold(k * FRAME_NS, poses[k])
    assert track.points() == expected.points()


def test_a_flipped_heading_is_left_out_and_a_robot_that_was_moved_is_found_again() -> None:
    poses = driven(60, 0.08, 0.2)
    track = track_of(poses)
    before = track.motion()
    flipped = Pose(poses[-1].x, poses[-1].y, wrap(poses[-1].theta + math.pi))
    track.fold(60 * FRAME_NS, flipped)
    assert track.motion().u2 == before.u2
    for k in range(61, 130):
        track.fold(k * FRAME_NS, advance(Pose(9.0, 9.0, 0.0), 0.1, 0.0, k * FRAME_NS * 1e-9))
    assert track.motion()[:2] == pytest.approx((0.1, 0.0), abs=0.01)


@pytest.mark.parametrize("v", [-3.0, 1.5, 6.0])
def test_a_robot_that_drives_faster_than_it_is_told_to_is_found_too(v: float) -> None:
    """The first poses do not fit 0.2 m/s, and those after them only once its speed is known."""
    track = track_of(driven(20, v, 0.4))
    assert track.points()[-1].rejected == 0
    motion = track.motion()
    assert abs(motion.v2 - v) < 4.0 * motion.sd_v2 < 0.3
    assert abs(motion.u2 - 0.4) < 4.0 * motion.sd_u2


def test_after_a_long_silence_nothing_is_taken_for_known() -> None:
    track = track_of(driven(60, 0.08, 0.2))
    track.fold(60 * FRAME_NS + 2_000_000_000, Pose(0.0, 0.0, 0.0))
    assert track.motion() == FollowerMotion(0.0, 0.0, NOISE.v_max, NOISE.u_max)


def test_the_track_keeps_its_span_and_knows_the_moments_of_its_poses() -> None:
    track = track_of(driven(60, 0.08, 0.2), span=0.16)
    times = [point.capture_ns for point in track.points()]
    assert len(times) == 12
    assert all(before < after for before, after in pairwise(times))
    assert [own_place(track.rows, track.ring, at_ns) for at_ns in times] == list(range(12))
    assert own_place(track.rows, track.ring, times[-1] - 1) == 11
    assert own_place(track.rows, track.ring, times[-1] + 1) == 12
    before, ring = columns_of(track.rows).tobytes(), track.ring
    for known in (5 * FRAME_NS, times[0], times[7], times[-1]):
        track.fold(known, Pose(0.0, 0.0, 0.0))
    assert (columns_of(track.rows).tobytes(), track.ring) == (before, ring)


@pytest.mark.parametrize("k", [0, 1, 5, 59, 60])
def test_what_a_pose_would_become_is_predicted_without_putting_it_there(k: int) -> None:
    poses = driven(61, 0.08, 0.2)
    track = OwnTrack()
    for number, pose in enumerate(poses[:60]):
        if number != k:
            track.fold(number * FRAME_NS, pose)
    due = own_begun(k * FRAME_NS, poses[k], False, NO_ODOMETRY, NOISE)
    before, ring = columns_of(track.rows).tobytes(), track.ring
    found = own_predicted(track.rows, ring, due, NOISE)
    assert (columns_of(track.rows).tobytes(), track.ring) == (before, ring)
    if k == 0:
        assert found == due
        return
    track.fold(k * FRAME_NS, poses[k])
    at = own_place(track.rows, track.ring, k * FRAME_NS)
    assert found == own_point(track.rows, track.ring, at)
    # A moment that the track has is told as the track has it, whatever comes with it now.
    again = own_begun(k * FRAME_NS, Pose(7.0, 7.0, 0.0), False, NO_ODOMETRY, NOISE)
    assert own_predicted(track.rows, track.ring, again, NOISE) == found


def test_more_poses_than_there_is_room_for_shorten_the_track_and_nothing_else() -> None:
    poses = driven(100, 0.08, 0.4)
    roomy, tight = track_of(poses), track_of(poses, room=8)
    assert tight.points() == roomy.points()[-8:]
    late = driven(101, 0.08, 0.4)[97]
    for track in (roomy, tight):
        track.fold(97 * FRAME_NS + 5, late)
    assert tight.points() == roomy.points()[-8:]
    ring = tight.ring
    tight.fold(3 * FRAME_NS + 5, late)
    assert tight.ring == ring


def test_it_is_a_kalman_filter_on_the_unicycle() -> None:
    """Against matrices: the motion by finite differences, the update in Joseph's form."""
    generator = np.random.default_rng(9)
    odometry = FollowerMotion(0.08, 0.4, 0.01, 0.05)
    point = own_begun(0, Pose(1.0, 2.0, 3.0), False, NO_ODOMETRY, NOISE)
    mean, covariance = np.array(point.state), covariance_of(point)
    for k in range(1, 60):
        pose = advance(Pose(1.0, 2.0, 3.0), 0.08, 0.4, k * 0.016)
        shake = (generator.standard_normal(3) * [7e-4, 7e-4, 8e-3]).tolist()
        seen = Pose(pose.x + shake[0], pose.y + shake[1], float(wrap(pose.theta + shake[2])))
        point = own_followed(point, own_begun(k * FRAME_NS, seen, True, odometry, NOISE), NOISE)
        mean, covariance = by_matrices(mean, covariance, seen, odometry, 0.016)
        assert point.state[:2] == pytest.approx(mean[:2], abs=1e-9)
        assert abs(wrap(point.state.theta - float(mean[2]))) < 1e-9
        assert point.state[3:] == pytest.approx(mean[3:], abs=1e-8)
        scale = np.sqrt(np.diag(covariance))
        assert covariance_of(point) / np.outer(scale, scale) == pytest.approx(
            covariance / np.outer(scale, scale), abs=1e-7
        )


def covariance_of(point: OwnPoint) -> Matrix:
    matrix = np.empty((5, 5))
    rows, columns = np.triu_indices(5)
    matrix[rows, columns] = matrix[columns, rows] = point.spread
    return matrix


def by_matrices(
    mean: Vector, covariance: Matrix, seen: Pose, odometry: FollowerMotion, dt: float
) -> tuple[Vector, Matrix]:
    def moved(x: Vector) -> Vector:
        pose = advance(Pose(x[0], x[1], 0.0), x[3], x[4], dt)
        line = complex(pose.x - x[0], pose.y - x[1]) * np.exp(1j * x[2])
        return np.array([x[0] + line.real, x[1] + line.imag, x[2] + x[4] * dt, x[3], x[4]])

    step = 1e-5
    move = np.column_stack([(moved(mean + e) - moved(mean - e)) / (2.0 * step) for e in step * np.eye(5)])
    ramp = np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    drive, turn = np.zeros((5, 2)), np.zeros((5, 2))
    drive[0, 0], drive[1, 0], drive[3, 1] = math.cos(mean[2]), math.sin(mean[2]), 1.0
    turn[2, 0] = turn[4, 1] = 1.0
    noise = 0.04 * drive @ ramp @ drive.T + 0.36 * turn @ ramp @ turn.T
    mean, covariance = moved(mean), move @ covariance @ move.T + noise
    inflation = 2.0 * 0.05 / dt
    for rows, value, variances in (
        ([0, 1, 2], np.array(seen), np.square([7e-4, 7e-4, 8e-3])),
        ([3, 4], np.array(odometry[:2]), inflation * np.square(odometry[2:])),
    ):
        see = np.eye(5)[rows]
        residual = value - see @ mean
        if rows[0] == 0:
            residual[2] = wrap(float(residual[2]))
        gain = covariance @ see.T @ np.linalg.inv(see @ covariance @ see.T + np.diag(variances))
        rest = np.eye(5) - gain @ see
        mean = mean + gain @ residual
        covariance = rest @ covariance @ rest.T + (gain * variances) @ gain.T
    return mean, covariance
