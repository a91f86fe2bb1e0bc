from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from estimation.filters.belief import Belief, Model
from estimation.filters.bias_filter import BiasedExtended, offsets_of
from estimation.filters.estimator import Estimator, RecordFilter
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise, mean_motion
from estimation.models.measurement import FrontEnd, Measurement, measure_body
from estimation.models.motion import Vector
from estimation.tracking.estimate import estimate_of
from estimation.tracking.track_point import NO_JUMP
from estimation.tracking.tracker import Status
from formation.angles import wrap
from formation.pose import Motion, Pose, advance
from formation.shape import shape_of

DT = 0.05
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.2, k_u=0.5)
MODEL = Model(FrontEnd.BODY, LIMITS, ProcessNoise.by_rule(LIMITS, 0.003, 0.0001), input_correlation=DT / 2)
SD_RANGE, SD_BEARING, SD_V2, SD_U2 = 0.005, 0.01, 0.003, 0.01
PRIOR = (0.05, 0.1)
OFFSETS = np.array([0.06, -0.12])
LEADER = Motion(0.1, 0.1)
OUTSIDE, INSIDE = (1.6, 0.3), (0.5, 0.0)  # of the leader's circle, which has a radius of 1 m

Drive = Callable[[float], Motion]


def weaving(t: float) -> Motion:
    """Round and round, faster and slower: the line of sight and the own velocity turn against the leader."""
    return Motion(0.15 + 0.08 * math.sin(0.9 * t), 0.6)


def keeping_formation(_t: float) -> Motion:
    """On a circle around the leader's own centre: nothing changes, seen from either robot."""
    return Motion(0.05, LEADER.u)


def sightings(
    drive: Drive, offsets: Vector, seconds: float, seed: int, start: tuple[float, float] = OUTSIDE
) -> tuple[list[Measurement], list[float]]:
    """Sightings with offsets of a leader on a circle, and the true alpha1."""
    generator = np.random.default_rng(seed)
    leader, follower = Pose(1.0, 0.0, math.pi / 2), Pose(*start, math.pi / 2)
    seen, alpha1 = [], []
    for k in range(round(seconds / DT)):
        own, shape = drive(k * DT), shape_of(leader, follower)
        range_noise, bearing_noise, v, u = (
            generator.standard_normal(4) * [SD_RANGE, SD_BEARING, SD_V2, SD_U2]
        ).tolist()
        rho, alpha2 = shape.rho + offsets[0] + range_noise, shape.alpha2 + offsets[1] + bearing_noise
        motion = FollowerMotion(own.v + v, own.u + u, SD_V2, SD_U2)
        seen.append(measure_body(round(k * DT * 1e9), rho, alpha2, SD_RANGE, SD_BEARING, motion))
        alpha1.append(shape.alpha1)
        middle = drive((k + 0.5) * DT)
        leader = advance(leader, LEADER.v, LEADER.u, DT)
        follower = advance(follower, middle.v, middle.u, DT)
    return seen, alpha1


def tracked(estimator: Estimator, seen: list[Measurement]) -> list[Belief]:
    beliefs = [estimator.start(seen[0])]
    for before, now in pairwise(seen):
        follower = mean_motion(before.motion, now.motion)
        beliefs.append(estimator.step(beliefs[-1], DT, follower, now, math.inf)[0])
    return beliefs


def alpha1_error(belief: Belief, seen: Measurement, alpha1: float) -> tuple[float, float]:
    found = estimate_of(belief.gaussian, seen, Status.TRACKING, math.nan, 0, NO_JUMP)
    return float(wrap(found.alpha1 - alpha1)), math.sqrt(found.covariance[3, 3])


@pytest.mark.slow
def test_offsets_are_found_while_the_pair_moves_against_each_other() -> None:
    plain: list[float] = []
    biased: list[float] = []
    squares = []
    for seed in range(4):
        seen, alpha1 = sightings(weaving, OFFSETS, 50.0, seed)
        with_offsets = tracked(BiasedExtended(MODEL, *PRIOR), seen)
        offsets = offsets_of(with_offsets[-1])
        assert offsets.range_observable
        assert offsets.bearing_observable
        sd = np.sqrt(np.diag(offsets.covariance))
        assert np.all(sd < 0.5 * np.array(PRIOR))
        squares.append(np.square((offsets.mean - OFFSETS) / sd))
        without = tracked(RecordFilter(MODEL), seen)
        for errors, beliefs in ((plain, without), (biased, with_offsets)):
            late = zip(beliefs[-100:], seen[-100:], alpha1[-100:], strict=True)
            errors += [alpha1_error(*each)[0] for each in late]
    # Over many seeds the root mean square is some 2: what was linearised far off in the beginning lasts.
    assert np.all(np.mean(squares, axis=0) < 9.0)
    assert np.std(biased) < 0.5 * np.sqrt(np.mean(np.square(plain)))


@pytest.mark.slow
def test_what_a_kept_formation_cannot_tell_stays_unknown_and_is_told_so() -> None:
    errors = []
    for seed in range(12):
        offsets = np.random.default_rng([seed, 9]).standard_normal(2) * PRIOR
        seen, alpha1 = sightings(keeping_formation, offsets, 20.0, seed, INSIDE)
        beliefs = tracked(BiasedExtended(MODEL, *PRIOR), seen)
        known = offsets_of(beliefs[-1])
        assert not known.range_observable
        assert not known.bearing_observable
        assert np.sqrt(np.diag(known.covariance)) == pytest.approx(PRIOR, rel=0.2)
        error, sd = alpha1_error(beliefs[-1], seen[-1], alpha1[-1])
        assert abs(error) < 3.5 * sd
        errors.append(error / sd)
    assert np.mean(np.square(errors)) < 2.0


def test_without_offsets_it_is_the_plain_filter() -> None:
    seen, _ = sightings(weaving, np.zeros(2), 5.0, 1)
    sure = tracked(BiasedExtended(MODEL, 1e-9, 1e-9), seen)[-1]
    plain = tracked(RecordFilter(MODEL), seen)[-1]
    # It takes the measurement as it is shown, range and bearing bent into a plane: the same to first order.
    assert sure.mean == pytest.approx(plain.mean, rel=1e-6, abs=1e-8)
    assert sure.covariance == pytest.approx(plain.covariance, rel=1e-6, abs=1e-10)


def test_the_gate_knows_of_the_offsets() -> None:
    seen, _ = sightings(weaving, np.array([0.1, 0.0]), 0.1, 2)
    far = seen[1]._replace(y=seen[1].y + 0.1)
    surprise = []
    for sd in (1e-6, 0.1):
        estimator = BiasedExtended(replace(MODEL, limits=LIMITS._replace(k_v=0.05)), sd, sd)
        # Sure of the leader, so that only the offsets can explain what is seen.
        begun = estimator.start(seen[0])
        belief = begun._replace(
            covariance=1e-8 * np.eye(5), filter_state=replace(offsets_of(begun), cross=np.zeros((5, 2)))
        )
        prior = estimator.predict(belief, DT, seen[1].motion)
        after, nis = estimator.step(belief, DT, seen[1].motion, far, math.inf)
        gated, again = estimator.step(belief, DT, seen[1].motion, far, 0.5 * nis)
        assert again == nis
        assert np.array_equal(gated.mean, prior.mean)
        assert not np.array_equal(after.mean, prior.mean)
        assert np.linalg.eigvalsh(after.covariance).min() > 0.0
        surprise.append(nis)
    assert surprise[0] > 20.0 * surprise[1]


def test_the_world_front_end_has_no_such_sensor() -> None:
    with pytest.raises(ValueError, match="front end is 'world', expected 'body'"):
        BiasedExtended(replace(MODEL, front_end=FrontEnd.WORLD), *PRIOR)
