from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.random_leaders import random_leader
from estimation.filters.belief import Belief, Model, innovation
from estimation.filters.estimator import Estimator
from estimation.filters.filter_states import Horizon
from estimation.filters.kalman import ExtendedFilter
from estimation.filters.moving_horizon import MovingHorizon
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement
from estimation.models.motion import Matrix

DT = 1.0 / 120.0
SIGMA = 1e-3
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.3, k_u=0.7)
MODEL = Model(FrontEnd.WORLD, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5))
STANDING = FollowerMotion(0.0, 0.0, 0.005, 0.03)


def drawn_leader(generator: np.random.Generator, steps: int) -> Matrix:
    """States (steps, 5) of a leader that moves as the model's own process noise says."""
    heading = generator.uniform(-math.pi, math.pi)
    state = np.array([0.0, 0.0, 0.2 * math.cos(heading), 0.2 * math.sin(heading), 0.3])
    return random_leader(generator, state, steps, DT, MODEL.noise)


def measured(generator: np.random.Generator, truth: Matrix) -> list[Measurement]:
    seen = truth[:, 0:2] + SIGMA * generator.standard_normal((len(truth), 2))
    return [
        Measurement.at(round(k * DT * 1e9), position, SIGMA**2 * np.eye(2), STANDING)
        for k, position in enumerate(seen)
    ]


def followed(of: Estimator, seen: list[Measurement]) -> tuple[list[Belief], list[float]]:
    beliefs, nis = [of.start(seen[0])], [math.nan]
    for measurement in seen[1:]:
        prior = of.predict(beliefs[-1], DT, STANDING)
        nis.append(innovation(prior, measurement).nis)
        beliefs.append(of.update(prior, measurement))
    return beliefs, nis


def test_where_all_is_linear_any_window_gives_the_kalman_filter() -> None:
    # A turn rate known to be zero makes the motion linear, a huge v_eps makes the noise isotropic.
    model = Model(FrontEnd.WORLD, LeaderLimits(1e4, 0.3, 1e-6), ProcessNoise(9e-4, 1e-14, 1e4))
    generator = np.random.default_rng(1)
    seen = measured(generator, np.outer(DT * np.arange(60), [0.2, -0.1, 0.0, 0.0, 0.0]))
    expected, _ = followed(ExtendedFilter(model), seen)
    for window in (1, 5, 12):
        found, _ = followed(MovingHorizon(model, window), seen)
        for left, right in zip(found, expected, strict=True):
            assert left.mean == pytest.approx(right.mean, abs=1e-9)
            assert left.covariance == pytest.approx(right.covariance, rel=1e-6, abs=1e-13)


@pytest.mark.slow
def test_on_random_leaders_it_is_as_good_as_the_filter() -> None:
    generator = np.random.default_rng(2)
    squares, nis = [], []
    for _ in range(5):
        truth = drawn_leader(generator, 360)
        seen = measured(generator, truth)
        (beliefs, found_nis), (peers, _) = (
            followed(of, seen) for of in (MovingHorizon(MODEL), ExtendedFilter(MODEL))
        )
        nis += found_nis[120:]
        for belief, peer, state in list(zip(beliefs, peers, truth, strict=True))[120:]:
            squares.append([np.square(each.mean - state)[2:] for each in (belief, peer)])
    ratio = np.sqrt(np.divide(*np.mean(squares, axis=0)))
    assert np.all(ratio < 1.05), ratio
    assert np.mean(nis) == pytest.approx(2.0, abs=0.15)


def test_from_no_knowledge_more_steps_find_the_least_of_the_cost() -> None:
    """The answer of many Gauss-Newton steps is a fixed point: yet another one changes nothing."""
    generator = np.random.default_rng(3)
    seen = measured(generator, drawn_leader(generator, 12))
    ends = [followed(MovingHorizon(MODEL, 12, count), seen)[0][-1] for count in (1, 15, 16)]
    assert ends[1].mean == pytest.approx(ends[2].mean, abs=1e-9)
    assert ends[0].mean[:4] == pytest.approx(ends[1].mean[:4], abs=5e-3)


def test_the_window_stays_as_long_as_it_is_set() -> None:
    generator = np.random.default_rng(4)
    beliefs, _ = followed(MovingHorizon(MODEL, 7), measured(generator, drawn_leader(generator, 30)))
    lengths = []
    for belief in beliefs:
        assert isinstance(belief.filter_state, Horizon)
        lengths.append(len(belief.filter_state.stages))
    assert lengths == [min(k + 1, 7) for k in range(30)]


def test_a_belief_of_another_estimator_is_refused() -> None:
    seen = measured(np.random.default_rng(1), np.zeros((1, 5)))
    with pytest.raises(TypeError, match="expected Horizon"):
        MovingHorizon(MODEL).predict(ExtendedFilter(MODEL).start(seen[0]), DT, STANDING)
