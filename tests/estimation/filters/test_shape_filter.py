from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.filters.belief import Belief, Model, innovation
from estimation.filters.estimator import Estimator
from estimation.filters.filter_states import Guess, ShapeState
from estimation.filters.kalman import ExtendedFilter
from estimation.filters.shape_filter import ShapeFilter
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import (
    FrontEnd,
    Measurement,
    PoseNoise,
    measure_body_from_mocap,
    measure_world,
)
from estimation.tracking.estimate import Estimate, estimate_of
from estimation.tracking.track_point import NO_JUMP
from estimation.tracking.tracker import Status
from formation.angles import wrap
from formation.pose import Motion, Pose, advance
from formation.shape import Shape, shape_of

DT_NS = 8_333_333
DT = DT_NS * 1e-9
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.3, k_u=0.7)
NOISE = PoseNoise(position=3e-4, heading=0.0035)
SD_V2, SD_U2 = 2e-3, 1e-2


def model(front_end: FrontEnd) -> Model:
    return Model(front_end, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5))


def easy_drive(
    front_end: FrontEnd, seed: int, count: int, driven: Motion
) -> tuple[list[Measurement], list[Shape]]:
    """A leader half a metre away on an arc, the follower on another, and the true shapes."""
    generator = np.random.default_rng(seed)
    measure = measure_world if front_end is FrontEnd.WORLD else measure_body_from_mocap
    own, leader, follower = Motion(0.18, 0.1), Pose(0.0, 0.0, 0.3), Pose(0.15, -0.5, 0.2)
    seen, shapes = [], []
    for k in range(count):
        x, y, fx, fy, turned, v, u = generator.standard_normal(7) * (
            [NOISE.position] * 4 + [NOISE.heading, SD_V2, SD_U2]
        )
        pose = Pose(follower.x + fx, follower.y + fy, wrap(follower.theta + turned))
        motion = FollowerMotion(own.v + v, own.u + u, SD_V2, SD_U2)
        seen.append(measure(k * DT_NS, (leader.x + x, leader.y + y), pose, NOISE, motion))
        shapes.append(shape_of(leader, follower))
        leader, follower = advance(leader, driven.v, driven.u, DT), advance(follower, own.v, own.u, DT)
    return seen, shapes


def followed(of: Estimator, seen: list[Measurement]) -> tuple[list[Belief], list[float]]:
    beliefs, nis = [of.start(seen[0])], [math.nan]
    for measurement in seen[1:]:
        prior = of.predict(beliefs[-1], DT, measurement.motion)
        nis.append(innovation(prior, measurement).nis)
        beliefs.append(of.update(prior, measurement))
    return beliefs, nis


def estimates(beliefs: list[Belief], seen: list[Measurement]) -> list[Estimate]:
    return [
        estimate_of(belief.gaussian, measurement, Status.TRACKING, math.nan, 0, NO_JUMP)
        for belief, measurement in zip(beliefs, seen, strict=True)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("front_end", list(FrontEnd))
def test_where_it_is_easy_it_agrees_with_the_cartesian_filter(front_end: FrontEnd) -> None:
    gaps, spreads, deviations, nis = [], [], [], []
    for seed in range(4):
        seen, shapes = easy_drive(front_end, seed, 420, Motion(0.2, 0.15))
        (shape_beliefs, found_nis), (beliefs, _) = (
            followed(of, seen) for of in (ShapeFilter(model(front_end)), ExtendedFilter(model(front_end)))
        )
        nis += found_nis[240:]
        peers = zip(estimates(shape_beliefs, seen), estimates(beliefs, seen), shapes, strict=True)
        for found, peer, truth in list(peers)[240:]:
            gaps.append([found.v1 - peer.v1, wrap(found.alpha1 - peer.alpha1)])
            deviations.append([found.v1 - 0.2, wrap(found.alpha1 - truth.alpha1)])
            spreads.append(np.sqrt(np.diag(peer.covariance))[2:4])
    spread = np.sqrt(np.mean(np.square(spreads), axis=0))
    gap, deviation = (np.sqrt(np.mean(np.square(each), axis=0)) for each in (gaps, deviations))
    # In the body frame both know the same, in the world frame only this one takes the heading for noisy.
    assert np.all(gap < (0.06 if front_end is FrontEnd.BODY else 1.2) * spread)
    assert np.all(deviation < 1.2 * spread)
    assert 1.0 < np.mean(nis) < 2.2


@pytest.mark.parametrize("front_end", list(FrontEnd))
def test_it_waits_for_a_guess_and_gives_it_up_when_the_leader_stops(front_end: FrontEnd) -> None:
    of = ShapeFilter(model(front_end))
    seen, _ = easy_drive(front_end, 1, 60, Motion(0.2, 0.0))
    beliefs, _ = followed(of, seen)
    assert all(isinstance(belief.filter_state, Guess) for belief in beliefs[:2])
    assert isinstance(beliefs[-1].filter_state, ShapeState)
    standing, _ = easy_drive(front_end, 2, 240, Motion(0.0, 0.0))
    beliefs, _ = followed(of, standing)
    assert isinstance(beliefs[-1].filter_state, Guess) or beliefs[-1].speed < 0.05


def test_a_guess_does_not_average_over_the_time_before_the_leader_set_off() -> None:
    of = ShapeFilter(model(FrontEnd.WORLD))
    waiting, _ = easy_drive(FrontEnd.WORLD, 3, 600, Motion(0.0, 0.0))
    x, y = waiting[-1].position.tolist()
    belief = followed(of, waiting)[0][-1]
    for k in range(1, 90):
        moved = waiting[-1]._replace(capture_ns=waiting[-1].capture_ns + k * DT_NS, x=x + 0.2 * k * DT, y=y)
        belief = of.update(of.predict(belief, DT, FollowerMotion(0.0, 0.0, SD_V2, SD_U2)), moved)
    assert belief.mean[2:4] == pytest.approx([0.2, 0.0], abs=0.03)


def test_a_belief_of_another_estimator_is_refused() -> None:
    seen, _ = easy_drive(FrontEnd.WORLD, 1, 1, Motion(0.2, 0.0))
    plain = ExtendedFilter(model(FrontEnd.WORLD)).start(seen[0])
    with pytest.raises(TypeError, match="expected Guess or ShapeState"):
        ShapeFilter(model(FrontEnd.WORLD)).predict(plain, DT, seen[0].motion)
