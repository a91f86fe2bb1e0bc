"""Tracks of measurements that come slowly, and of those that stand along the axes of a measured pose."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.filters.belief import Model
from estimation.filters.filter import Kind, filter_of
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement, PoseNoise, measure_body_anchored
from estimation.tracking.estimate import estimate_at
from estimation.tracking.track import Tracker
from estimation.tracking.track_point import TrackPoint, next_period
from estimation.tracking.track_settings import TrackSettings
from estimation.tracking.tracker import Status
from formation.pose import Pose, advance
from formation.shape import shape_of

LIMITS = LeaderLimits(0.04, 0.2, 0.6)
MODEL = Model(FrontEnd.BODY, LIMITS, ProcessNoise.by_rule(LIMITS, 0.05, 0.01))
SETTINGS = TrackSettings(settled_heading=0.5, unsettled_heading=0.8)
STANDING = FollowerMotion(0.0, 0.0, 0.001, 0.002)
S = 1_000_000_000


def tracked(period: float, seconds: float = 20.0) -> tuple[Tracker, TrackPoint]:
    """A leader that passes a follower that stands, seen every so many seconds to 5 mm."""
    tracker, point = Tracker(filter_of(Kind.EKF, MODEL), SETTINGS), None
    for k in range(round(seconds / period)):
        t = k * period
        seen = Measurement.at(
            round(t * S), np.array([-1.0 + 0.1 * t, 1.0]), np.diag([2.5e-5, 2.5e-5]), STANDING
        )
        point = tracker.begin(seen) if point is None else tracker.follow(point, seen)
    assert point is not None
    return tracker, point


@pytest.mark.parametrize("period", [1 / 120, 0.1, 0.25, 0.5, 1.2])
def test_a_track_lives_as_long_as_its_measurements_let_it(period: float) -> None:
    tracker, point = tracked(period)
    now_ns = point.measurement.capture_ns

    def status(later: float) -> Status:
        return tracker.status((point,), now_ns + round(later * S))

    assert point.period == pytest.approx(period, rel=0.15)
    assert status(0.0) is Status.TRACKING
    assert status(max(0.2, 2.0 * period)) is Status.TRACKING
    assert status(max(0.3, 3.0 * period)) is Status.COASTING
    assert status(max(1.1, 10.0 * period)) is Status.LOST


@pytest.mark.parametrize("period", [0.25, 0.5, 1.2])
def test_a_slow_sensor_tells_how_its_leader_moves(period: float) -> None:
    point = tracked(period)[1]
    assert point.belief.speed == pytest.approx(0.1, abs=0.01)
    assert point.settled


def test_one_long_gap_does_not_make_a_track_slow() -> None:
    period = 0.01
    for dt in (*[0.01] * 20, 0.9, *[0.01] * 10):
        period = next_period(period, dt)
    assert period == pytest.approx(0.01, rel=0.15)


def test_poses_that_both_lie_on_one_heading_error_do_not_shake_the_leader() -> None:
    """Along the axes of measured poses a heading that is noisy by 20 mrad costs nothing at 3 m."""
    generator, noise = np.random.default_rng(4), PoseNoise(0.0005, 0.02)
    tracker, point, errors, reported = Tracker(filter_of(Kind.EKF, MODEL), SETTINGS), None, [], []
    leader, follower = Pose(0.0, 3.0, 0.3), Pose(0.0, 0.0, 0.0)
    for k in range(900):
        t = k / 60
        at, own = advance(leader, 0.1, 0.05, t), advance(follower, 0.1, -0.1, t)
        x, y, turn, ex, ey = generator.normal(size=5) * [
            *[noise.position] * 2,
            noise.heading,
            *[noise.position] * 2,
        ]
        pose = Pose(own.x + x, own.y + y, own.theta + turn)
        motion = FollowerMotion(0.1, -0.1, 0.05, 0.5)
        seen = measure_body_anchored(round(t * S), (at.x + ex, at.y + ey), pose, noise, motion)
        point = tracker.begin(seen) if point is None else tracker.follow(point, seen)
        if k > 300:
            estimate = estimate_at(point, Status.TRACKING.value)
            errors.append((estimate.v1 - 0.1, estimate.alpha1 - shape_of(at, own).alpha1))
            reported.append(math.sqrt(estimate.joint.b_b))
    rms = np.sqrt(np.mean(np.array(errors) ** 2, axis=0))
    assert rms[0] < 0.003
    # alpha1 is an angle between the leader and the line to it, both of which the heading's error turns alike.
    assert rms[1] < noise.heading
    assert rms[1] < np.mean(reported) < 3.0 * rms[1]
