from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from benchmarks.random_leaders import random_leader
from estimation.filters.belief import Belief, Model, Modes, innovation
from estimation.filters.estimator import Estimator
from estimation.filters.imm import TURN_BANDWIDTHS, InteractingModels, mixture
from estimation.filters.kalman import ExtendedFilter
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement
from estimation.models.motion import Matrix

DT = 1.0 / 120.0
SIGMA = 1e-3
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.3, k_u=0.7)
STANDING = FollowerMotion(0.0, 0.0, 0.005, 0.03)
GENTLE, AGILE = TURN_BANDWIDTHS


def model(bandwidth: float) -> Model:
    return Model(FrontEnd.WORLD, LIMITS, ProcessNoise.by_rule(LIMITS, bandwidth))


def drawn_leader(generator: np.random.Generator, steps: int, bandwidth: float) -> Matrix:
    """States (steps, 5) of a leader that moves as the process noise of this bandwidth says."""
    heading, noise = generator.uniform(-math.pi, math.pi), model(bandwidth).noise
    state = np.array(
        [0.0, 0.0, 0.2 * math.cos(heading), 0.2 * math.sin(heading), generator.uniform(-0.5, 0.5)]
    )
    return random_leader(generator, state, steps, DT, noise)


def measured(generator: np.random.Generator, truth: Matrix) -> list[Measurement]:
    seen = truth[:, 0:2] + SIGMA * generator.standard_normal((len(truth), 2))
    return [
        Measurement.at(round(k * DT * 1e9), position, SIGMA**2 * np.eye(2), STANDING)
        for k, position in enumerate(seen)
    ]


@dataclass
class Score:
    """Mean squared errors of w and u1, mean NIS, and the mean probability of the agile mode."""

    w: float
    u: float
    nis: float
    agile: float


def score(of: Estimator, bandwidth: float, runs: int = 6, steps: int = 480, late: int = 150) -> Score:
    generator = np.random.default_rng(17)
    rows = []
    for _ in range(runs):
        truth = drawn_leader(generator, steps, bandwidth)
        seen = measured(generator, truth)
        belief = of.start(seen[0])
        for k in range(1, steps):
            prior = of.predict(belief, DT, STANDING)
            belief = of.update(prior, seen[k])
            if k >= late:
                error = belief.mean - truth[k]
                agile = (
                    belief.filter_state.probabilities[1]
                    if isinstance(belief.filter_state, Modes)
                    else math.nan
                )
                rows.append(
                    (
                        error[2] ** 2 + error[3] ** 2,
                        error[4] ** 2,
                        innovation(prior, seen[k]).nis,
                        agile,
                    )
                )
    return Score(*np.mean(rows, axis=0).tolist())


@pytest.mark.slow
@pytest.mark.parametrize(("bandwidth", "other"), [(GENTLE, AGILE), (AGILE, GENTLE)])
def test_whatever_the_leader_it_comes_close_to_the_filter_made_for_it(bandwidth: float, other: float) -> None:
    made_for_it = score(ExtendedFilter(model(bandwidth)), bandwidth)
    not_made_for_it = score(ExtendedFilter(model(other)), bandwidth)
    found = score(InteractingModels(model(AGILE), ExtendedFilter), bandwidth)
    assert found.w < 1.02**2 * made_for_it.w
    assert found.u < not_made_for_it.u
    assert found.nis == pytest.approx(2.0, abs=0.15)
    assert (found.agile > 0.5) == (bandwidth == AGILE)


def test_one_mode_alone_is_the_plain_filter() -> None:
    generator = np.random.default_rng(2)
    seen = measured(generator, drawn_leader(generator, 60, AGILE))
    alone, plain = InteractingModels(model(GENTLE), ExtendedFilter, [AGILE]), ExtendedFilter(model(AGILE))
    left, right = alone.start(seen[0]), plain.start(seen[0])
    for measurement in seen[1:]:
        left = alone.update(alone.predict(left, DT, STANDING), measurement)
        right = plain.update(plain.predict(right, DT, STANDING), measurement)
        assert left.mean == pytest.approx(right.mean, rel=1e-12, abs=1e-15)
        assert left.covariance == pytest.approx(right.covariance, rel=1e-9, abs=1e-18)


def test_a_mixture_has_the_moments_of_samples_drawn_from_it() -> None:
    generator = np.random.default_rng(3)
    spread = generator.standard_normal((5, 5))
    parts = [
        Belief(generator.standard_normal(5), spread @ spread.T),
        Belief(generator.standard_normal(5), np.eye(5)),
    ]
    mixed = mixture(parts, [0.3, 0.7])
    count = 200_000
    chosen = generator.random(count) < 0.3
    first, second = (generator.multivariate_normal(each.mean, each.covariance, count) for each in parts)
    drawn = np.where(chosen[:, None], first, second)
    assert mixed.mean == pytest.approx(drawn.mean(axis=0), abs=0.05)
    assert mixed.covariance == pytest.approx(np.cov(drawn.T), abs=0.15)


def test_coasting_forgets_the_mode() -> None:
    generator = np.random.default_rng(4)
    seen = measured(generator, drawn_leader(generator, 200, AGILE))
    of = InteractingModels(model(AGILE), ExtendedFilter)
    belief = of.start(seen[0])
    for measurement in seen[1:]:
        belief = of.update(of.predict(belief, DT, STANDING), measurement)
    in_steps = belief
    for _ in range(4):
        in_steps = of.predict(in_steps, 0.25, STANDING)
    at_once, for_long = of.predict(belief, 1.0, STANDING), of.predict(belief, 60.0, STANDING)
    assert [probabilities(each)[1] for each in (in_steps, for_long)] == pytest.approx(
        [probabilities(at_once)[1], 0.5]
    )


def probabilities(belief: Belief) -> tuple[float, ...]:
    assert isinstance(belief.filter_state, Modes)
    return belief.filter_state.probabilities


def test_a_belief_of_another_estimator_is_refused() -> None:
    of = InteractingModels(model(AGILE), ExtendedFilter)
    plain = ExtendedFilter(of.model).start(measured(np.random.default_rng(1), np.zeros((1, 5)))[0])
    with pytest.raises(TypeError, match="expected Modes"):
        of.predict(plain, DT, STANDING)
