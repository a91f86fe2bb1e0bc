from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from benchmarks.random_leaders import random_leader
from estimation.filters.belief import Model
from estimation.filters.kalman import ExtendedFilter
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import (
    FrontEnd,
    Measurement,
    PoseNoise,
    measure_body_from_mocap,
    measure_world,
)
from estimation.models.motion import Matrix
from estimation.tracking.estimate import estimate_of
from estimation.tracking.smoother import smooth
from estimation.tracking.track import Tracker
from estimation.tracking.track_point import NO_JUMP, TrackPoint, Verdict
from estimation.tracking.track_settings import TrackSettings, gate_of
from estimation.tracking.tracker import Status
from formation.angles import wrap
from formation.pose import Pose, advance
from formation.shape import shape_of

DT_NS = 8_333_333
DT = DT_NS * 1e-9
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.3, k_u=0.7)
NOISE = ProcessNoise.by_rule(LIMITS, 0.5)
FINE = PoseNoise(position=1e-3, heading=1e-4)
STANDING = FollowerMotion(0.0, 0.0, 0.0, 0.0)


def tracker(front_end: FrontEnd = FrontEnd.WORLD) -> Tracker:
    return Tracker(ExtendedFilter(Model(front_end, LIMITS, NOISE)), TrackSettings())


def drawn_leader(generator: np.random.Generator, steps: int) -> Matrix:
    """States (steps, 5) of a leader that moves as the process noise says."""
    heading = generator.uniform(-math.pi, math.pi)
    state = np.array([1.0, 0.5, 0.2 * math.cos(heading), 0.2 * math.sin(heading), 0.3])
    return random_leader(generator, state, steps, DT, NOISE)


def followed(
    generator: np.random.Generator, truth: Matrix, front_end: FrontEnd
) -> tuple[list[Measurement], list[Pose]]:
    """What a follower on a circle measures of the leader, and its own true poses."""
    measure = measure_world if front_end is FrontEnd.WORLD else measure_body_from_mocap
    pose, seen, poses = Pose(0.5, 0.0, 0.1), [], []
    for k, state in enumerate(truth):
        leader = (state[:2] + FINE.position * generator.standard_normal(2)).tolist()
        fx, fy = ([pose.x, pose.y] + FINE.position * generator.standard_normal(2)).tolist()
        noisy = Pose(fx, fy, wrap(pose.theta + FINE.heading * generator.standard_normal()))
        motion = FollowerMotion(0.1, 0.2, 1e-3, 5e-3)
        seen.append(measure(k * DT_NS, (leader[0], leader[1]), noisy, FINE, motion))
        poses.append(pose)
        pose = advance(pose, 0.1, 0.2, DT)
    return seen, poses


def errors(points: Sequence[TrackPoint], truth: Matrix, poses: Sequence[Pose]) -> Matrix:
    """Errors (n, 3) of v1, alpha1 and u1."""
    rows = []
    for point, state, pose in zip(points, truth, poses, strict=True):
        found = estimate_of(point.belief, point.measurement, Status.TRACKING, math.nan, 0, NO_JUMP)
        heading = math.atan2(state[3], state[2])
        alpha1 = shape_of(Pose(float(state[0]), float(state[1]), heading), pose).alpha1
        speed = math.hypot(state[2], state[3])
        rows.append([found.v1 - speed, wrap(found.alpha1 - alpha1), found.u1 - state[4]])
    return np.array(rows)


@pytest.mark.slow
@pytest.mark.parametrize("front_end", list(FrontEnd))
def test_knowing_the_future_beats_the_filter(front_end: FrontEnd) -> None:
    generator = np.random.default_rng(5)
    of = tracker(front_end)
    filtered, smoothed = [], []
    for _ in range(6):
        truth = drawn_leader(generator, 360)
        seen, poses = followed(generator, truth, front_end)
        points = [of.begin(seen[0])]
        for measurement in seen[1:]:
            points.append(of.follow(points[-1], measurement))
        inner = slice(120, 300)
        filtered.append(errors(points, truth, poses)[inner])
        smoothed.append(errors(smooth(of, seen), truth, poses)[inner])
    ratio = np.sqrt(np.mean(np.square(smoothed), axis=(0, 1)) / np.mean(np.square(filtered), axis=(0, 1)))
    assert np.all(ratio < [0.7, 0.45, 0.6])


def test_its_covariance_covers_its_errors() -> None:
    generator = np.random.default_rng(6)
    squares = []
    for _ in range(8):
        truth = drawn_leader(generator, 300)
        seen, _ = followed(generator, truth, FrontEnd.WORLD)
        for point, state in list(zip(smooth(tracker(), seen), truth, strict=True))[60:-60:20]:
            error = point.belief.mean - state
            squares.append(error @ np.linalg.solve(point.belief.covariance, error))
    assert np.mean(squares) == pytest.approx(5.0, abs=1.2)


def test_without_turning_it_is_the_textbook_smoother() -> None:
    # A turn rate known to be zero makes the motion linear, a huge v_eps makes the noise isotropic.
    model = Model(FrontEnd.WORLD, LeaderLimits(1e4, 0.3, 1e-6), ProcessNoise(9e-4, 1e-14, 1e4))
    generator = np.random.default_rng(1)
    positions = np.outer(DT * np.arange(60), [0.2, -0.1]) + 1e-3 * generator.standard_normal((60, 2))
    noise = 1e-6 * np.eye(2)
    seen = [Measurement.at(k * DT_NS, at, noise, STANDING) for k, at in enumerate(positions)]
    points = smooth(Tracker(ExtendedFilter(model), TrackSettings(gate=gate_of(1.0 - 1e-12))), seen)
    # The same as one least-squares problem over the whole path, solved at once.
    move = np.kron([[1.0, DT], [0.0, 1.0]], np.eye(2))
    drive = np.kron(9e-4 * np.array([[DT**3 / 3.0, DT**2 / 2.0], [DT**2 / 2.0, DT]]), np.eye(2))
    information, known = np.zeros((240, 240)), np.zeros(240)
    known_at_start = np.diag([1e6, 1e6, 1.0 / 0.09, 1.0 / 0.09])
    information[:4, :4] += known_at_start
    known[:4] += known_at_start @ [*positions[0], 0.0, 0.0]
    for k in range(1, 60):
        step = np.zeros((4, 240))
        step[:, 4 * k - 4 : 4 * k], step[:, 4 * k : 4 * k + 4] = -move, np.eye(4)
        information += step.T @ np.linalg.solve(drive, step)
        here = slice(4 * k, 4 * k + 2)
        information[here, here] += 1e6 * np.eye(2)
        known[here] += 1e6 * positions[k]
    covariance = np.linalg.inv(information)
    best = (covariance @ known).reshape(60, 4)
    assert np.array([point.belief.mean[:4] for point in points]) == pytest.approx(best, abs=1e-7)
    for k in (0, 20, 59):
        block = covariance[4 * k : 4 * k + 4, 4 * k : 4 * k + 4]
        assert points[k].belief.covariance[:4, :4] == pytest.approx(block, rel=1e-3, abs=1e-10)


def test_order_and_duplicates_do_not_matter_and_the_newest_point_is_the_filter_s() -> None:
    generator = np.random.default_rng(2)
    seen, _ = followed(generator, drawn_leader(generator, 60), FrontEnd.WORLD)
    of = tracker()
    straight = smooth(of, seen)
    shuffled = smooth(of, [seen[k] for k in generator.permutation([*range(60), 5, 50])])
    point = of.begin(seen[0])
    for measurement in seen[1:]:
        point = of.follow(point, measurement)
    assert np.array_equal(straight[-1].belief.mean, point.belief.mean)
    for left, right in zip(straight, shuffled, strict=True):
        assert np.array_equal(left.belief.mean, right.belief.mean)


def test_it_knows_the_direction_from_the_first_frame_on_and_through_a_gap() -> None:
    generator = np.random.default_rng(3)
    truth = drawn_leader(generator, 300)
    seen, poses = followed(generator, truth, FrontEnd.WORLD)
    kept = [k for k in range(300) if not 150 <= k < 210]
    points = smooth(tracker(), [seen[k] for k in kept])
    assert all(point.settled for point in points)
    assert np.abs(errors(points, truth[kept], [poses[k] for k in kept])[:, 1]).max() < 0.4


def test_nothing_is_carried_back_over_a_restart_or_out_of_an_outlier() -> None:
    generator = np.random.default_rng(4)
    seen, _ = followed(generator, drawn_leader(generator, 240), FrontEnd.WORLD)
    wild = seen[60]._replace(x=seen[60].x + 0.2, y=seen[60].y + 0.1)
    jumped = [each._replace(x=each.x + 0.05, y=each.y - 0.05) for each in seen[120:]]
    points = smooth(tracker(), [*seen[:60], wild, *seen[61:120], *jumped])
    assert points[60].verdict == Verdict.GATED
    assert points[60].belief.mean[:2] == pytest.approx(seen[60].position, abs=5e-3)
    restarts = [k for k, point in enumerate(points) if point.verdict == Verdict.RESTARTED]
    assert len(restarts) == 2
    before = smooth(tracker(), [*seen[:60], wild, *seen[61:120]])
    assert np.array_equal(points[119].belief.mean, before[119].belief.mean)


def test_no_measurements_make_no_track() -> None:
    assert smooth(tracker(), []) == ()
