from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from estimation.filters.belief import Model
from estimation.filters.filter import Filter, Kind, filter_of
from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement, PoseNoise, measure_body, measure_world
from estimation.tracking.estimate import Estimate, estimate_of
from estimation.tracking.track_point import NO_JUMP
from estimation.tracking.tracker import Status
from formation.angles import wrap
from formation.pose import Motion, Pose, advance
from formation.shape import Shape, follower_pose, leader_velocity, polar_velocity

DT_NS = 8_333_333
DT = DT_NS * 1e-9
CUTOFF = 0.1
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.3, k_u=0.7)


def estimator(front_end: FrontEnd) -> Filter:
    model = Model(front_end, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5))
    return filter_of(Kind.DIFFERENCE, model, CUTOFF)


def followed(of: Filter, measurements: list[Measurement]) -> list[Gaussian]:
    beliefs = [of.start(measurements[0])]
    for before, measurement in pairwise(measurements):
        dt = (measurement.capture_ns - before.capture_ns) * 1e-9
        prior = of.predict(beliefs[-1], dt, measurement.motion)
        beliefs.append(of.update(prior, measurement))
    return beliefs


def estimated(belief: Gaussian, measurement: Measurement) -> Estimate:
    return estimate_of(belief, measurement, Status.TRACKING, math.nan, measurement.capture_ns, NO_JUMP)


@given(
    st.floats(0.3, 2.0),
    st.floats(-math.pi, math.pi),
    st.floats(-0.2, 0.2),
    st.floats(-1.0, 1.0),
    st.builds(Motion, st.floats(-0.2, 0.2), st.floats(-1.0, 1.0)),
)
@settings(deadline=None)
def test_constant_rates_without_noise_are_found_exactly(
    rho: float, alpha2: float, rho_dot: float, alpha2_dot: float, own: Motion
) -> None:
    of, motion = estimator(FrontEnd.BODY), FollowerMotion(own.v, own.u, 0.005, 0.03)
    seen = [
        measure_body(
            k * DT_NS, rho + rho_dot * k * DT, wrap(alpha2 + alpha2_dot * k * DT), 0.001, 0.001, motion
        )
        for k in range(30)
    ]
    found = estimated(followed(of, seen)[-1], seen[-1])
    x, y = leader_velocity(found.rho, found.alpha2, rho_dot, alpha2_dot, own)
    assume(math.hypot(x, y) > 1e-3)
    v1, alpha1 = polar_velocity(x, y)
    assert found.rho_dot == pytest.approx(rho_dot, abs=1e-10)
    assert found.alpha2_dot == pytest.approx(alpha2_dot, abs=1e-9)
    assert found.v1 == pytest.approx(v1, abs=1e-9)
    assert abs(wrap(found.alpha1 - alpha1)) < 1e-6


@pytest.mark.parametrize("front_end", list(FrontEnd))
def test_a_pair_that_turns_as_one_body_is_found_exactly_turn_rate_included(front_end: FrontEnd) -> None:
    # Abreast on concentric circles: both turn at the same rate, and the shape does not change.
    leader, turn, noise = Pose(0.3, 0.2, 2.0), 0.6, PoseNoise(1e-3, 1e-3)
    shape = Shape(0.25, -0.5 * math.pi, 0.5 * math.pi)
    motion = FollowerMotion(0.2 + turn * shape.rho, turn, 0.005, 0.03)
    seen = []
    for k in range(400):
        at_ns, follower = k * DT_NS, follower_pose(shape, leader)
        if front_end is FrontEnd.WORLD:
            seen.append(measure_world(at_ns, (leader.x, leader.y), follower, noise, motion))
        else:
            seen.append(measure_body(at_ns, shape.rho, shape.alpha2, 1e-3, 1e-3, motion))
        leader = advance(leader, 0.2, turn, DT)
    found = estimated(followed(estimator(front_end), seen)[-1], seen[-1])
    assert (found.v1, found.alpha1) == pytest.approx((0.2, shape.alpha1), abs=1e-9)
    assert (found.rho_dot, found.alpha2_dot) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert found.u1 == pytest.approx(turn, abs=1e-8)


def test_rates_follow_a_step_with_the_time_constant_of_the_low_pass() -> None:
    of, standing = estimator(FrontEnd.BODY), FollowerMotion(0.0, 0.0, 0.005, 0.03)
    rho = [0.5 + 0.1 * max(0.0, (k - 60) * DT) for k in range(200)]
    seen = [measure_body(k * DT_NS, r, 0.0, 1e-3, 1e-3, standing) for k, r in enumerate(rho)]
    beliefs = followed(of, seen)
    for after in (0.05, 0.1, 0.3):
        k = 60 + round(after / DT)
        rates = beliefs[k].rates
        # A backward difference through a discrete low-pass: within one frame of the continuous answer.
        assert rates.rho_dot == pytest.approx(0.1 * (1.0 - math.exp(-after / CUTOFF)), abs=0.1 * DT / CUTOFF)


@pytest.mark.parametrize("front_end", list(FrontEnd))
def test_its_covariance_covers_its_errors(front_end: FrontEnd) -> None:
    generator = np.random.default_rng(4)
    noise, sd_v2, sd_u2 = PoseNoise(1e-3, 5e-3), 5e-3, 3e-2
    of = estimator(front_end)
    leader, follower = Pose(0.0, 0.0, 0.3), Pose(0.1, -0.6, 0.1)
    seen = []
    for k in range(1500):
        x, y, fx, fy, turned, v, u = generator.standard_normal(7) * ([1e-3] * 4 + [5e-3, sd_v2, sd_u2])
        pose = Pose(follower.x + fx, follower.y + fy, follower.theta + turned)
        motion = FollowerMotion(0.2 + v, 0.0 + u, sd_v2, sd_u2)
        if front_end is FrontEnd.WORLD:
            seen.append(measure_world(k * DT_NS, (leader.x + x, leader.y + y), pose, noise, motion))
        else:
            dx, dy = leader.x + x - pose.x, leader.y + y - pose.y
            rho, alpha2 = math.hypot(dx, dy), math.atan2(dy, dx) - pose.theta
            sd_rho = math.sqrt(2.0) * 1e-3
            seen.append(measure_body(k * DT_NS, rho, alpha2, sd_rho, math.hypot(sd_rho / rho, 5e-3), motion))
        leader, follower = advance(leader, 0.2, 0.0, DT), advance(follower, 0.2, 0.0, DT)
    squares = []
    for belief in followed(of, seen)[100:]:
        heading = 0.3 if front_end is FrontEnd.WORLD else 0.3 - follower.theta
        error = belief.mean[2:4] - 0.2 * np.array([math.cos(heading), math.sin(heading)])
        squares.append(error @ np.linalg.solve(belief.covariance[2:4, 2:4], error))
    # Two degrees of freedom; the lag that is allowed for does not occur on a straight line.
    assert 0.5 < float(np.mean(squares)) < 2.2


def test_the_first_measurement_says_nothing_about_rates() -> None:
    of, standing = estimator(FrontEnd.BODY), FollowerMotion(0.0, 0.0, 0.005, 0.03)
    belief = of.start(measure_body(0, 0.5, 1.0, 1e-3, 1e-3, standing))
    assert belief.speed == 0.0
    assert belief.sd_heading == math.inf
    assert of.update(belief, measure_body(0, 0.5, 1.0, 1e-3, 1e-3, standing)) == belief
