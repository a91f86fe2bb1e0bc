"""Process noise that is found: the bandwidths that leaders were made with, from whatever is told."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.random_leaders import random_leader
from estimation.consistency.filter_bank import (
    LANES,
    MEMBERS,
    SPEED_LOWEST,
    SPEED_MEMBERS,
    SPEED_RATIO,
    TURN_LOWEST,
    TURN_MEMBERS,
    TURN_RATIO,
    Member,
)
from estimation.consistency.process_estimate import (
    NOTHING_LEARNED,
    SPEED_SHARE,
    TURN_SHARE,
    LearnedProcess,
    ProcessLearning,
    _begin,
    _posterior,
    _taken,
    learn,
    learned_noise,
    restarted,
    unlearned,
    vertex,
)
from estimation.filters.belief import Model
from estimation.filters.filter import Filter, Kind, filter_of
from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement, PoseNoise, measure_world
from estimation.models.motion import Vector
from estimation.tracking.track_point import TrackPoint, begun
from formation.pose import Pose
from formation.records import Rows, load_across, rows_of, store_across

LIMITS = LeaderLimits(v_eps=0.04, k_v=0.1, k_u=0.7)
SD, STEP = 1e-3, 1.0 / 30.0
STILL = FollowerMotion(0.0, 0.0, 0.0, 0.0)


def learning(turn: float, speed: float) -> ProcessLearning:
    told = ProcessNoise.by_rule(LIMITS, turn, speed)
    return ProcessLearning(True, told, LIMITS.k_v * LIMITS.k_v, LIMITS.k_u * LIMITS.k_u)


def main_filter(rules: ProcessLearning) -> Filter:
    return filter_of(Kind.EKF, Model(FrontEnd.WORLD, LIMITS, rules.told))


def sighted(generator: np.random.Generator, k: int, state: Vector) -> Measurement:
    x, y = state[:2] + SD * generator.standard_normal(2)
    capture_ns = 1_000_000_000 + round(k * STEP * 1e9)
    return measure_world(capture_ns, (float(x), float(y)), Pose(0.0, -1.0, 0.0), PoseNoise(SD, 0.01), STILL)


def point(measurement: Measurement, belief: Gaussian, estimator: Filter) -> TrackPoint:
    """Of a track that is settled."""
    return begun(measurement, estimator)._replace(belief=belief, settled=True)


def found_for(
    turn: float, speed: float, rules: ProcessLearning, seconds: float = 20.0, seed: int = 1
) -> tuple[LearnedProcess, Rows[Member]]:
    """What is learned of a leader of these bandwidths, which is tracked from the start."""
    generator = np.random.default_rng(seed)
    truth = ProcessNoise.by_rule(LIMITS, turn, speed)
    start = np.array([0.0, 0.0, 0.08, 0.0, 0.0])
    states = random_leader(generator, start, round(seconds / STEP), STEP, truth)
    estimator, bank, learned = main_filter(rules), rows_of(Member, LANES), NOTHING_LEARNED
    belief = estimator.start(sighted(generator, 0, states[0]))._replace(vx=0.08, vx_vx=1e-6, vy_vy=1e-6)
    for k, state in enumerate(states):
        measurement = sighted(generator, k + 1, state)
        noise = learned_noise(learned, rules)
        belief = estimator.driven_by(noise).step(belief, STEP, STILL, measurement, math.inf).belief
        learned = learn(learned, bank, point(measurement, belief, estimator), rules, estimator)
    return learned, bank


@pytest.mark.parametrize("told", [(0.5, 0.01), (4.0, 0.3)])
@pytest.mark.parametrize(("turn", "speed"), [(0.5, 0.01), (0.05, 0.1), (2.0, 0.001)])
def test_the_bandwidths_of_a_leader_are_found_whatever_is_told(
    turn: float, speed: float, told: tuple[float, float]
) -> None:
    rules = learning(*told)
    learned, _ = found_for(turn, speed, rules)
    noise = learned_noise(learned, rules)
    assert 1.0 / 2.5 < noise.q_u / (TURN_SHARE * turn * rules.turn) < 2.5
    assert 1.0 / 2.5 < noise.q_v / (SPEED_SHARE * speed * rules.speed) < 2.5
    kept = noise._replace(q_v=0.0, q_u=0.0, q_across=math.inf)
    assert kept == rules.told._replace(q_v=0.0, q_u=0.0)


def test_before_the_track_has_settled_it_is_as_told() -> None:
    rules, generator = learning(0.5, 0.01), np.random.default_rng(1)
    estimator, bank, learned = main_filter(rules), rows_of(Member, LANES), NOTHING_LEARNED
    for k in range(60):
        measurement = sighted(generator, k, np.zeros(5))
        learned = learn(learned, bank, begun(measurement, estimator), rules, estimator)
    assert learned == NOTHING_LEARNED
    assert learned_noise(learned, rules) == rules.told._replace(q_across=rules.told.q_v)


def test_a_new_track_starts_the_bank_anew_and_keeps_what_was_learned() -> None:
    rules, generator = learning(0.5, 0.01), np.random.default_rng(2)
    estimator = main_filter(rules)
    learned, bank = found_for(0.05, 0.001, rules)
    again = restarted(learned)
    assert (again.speed, again.turn, again.begun) == (learned.speed, learned.turn, False)
    scores = [load_across(Member, bank, LANES, k).score for k in range(MEMBERS)]
    there = np.array([5.0, 5.0, 0.08, 0.0, 0.0])
    k = 1000
    while not again.begun:
        assert (k - 1000) * STEP < 1.1
        measurement = sighted(generator, k, there)
        here = point(measurement, estimator.start(measurement), estimator)
        again = learn(again, bank, here, rules, estimator)
        k += 1
    assert [load_across(Member, bank, LANES, k).score for k in range(MEMBERS)] == scores
    assert load_across(Member, bank, LANES, 3).belief.x == pytest.approx(5.0, abs=0.1)


@pytest.mark.parametrize("k", range(TURN_MEMBERS, MEMBERS))
def test_a_little_evidence_for_one_member_does_not_take_the_noise_there(k: int) -> None:
    """Where nothing tells members apart it is near what is told, and a nat for one of them changes little."""
    bank, rules = rows_of(Member, LANES), learning(0.5, 0.01)
    _begin(bank, load_across(Member, bank, LANES, 0).belief, rules)
    none = _taken(bank, rules, 0.0, 0.0, False)
    store_across(bank, LANES, k, load_across(Member, bank, LANES, k)._replace(score=1.0))
    one = _taken(bank, rules, 0.0, 0.0, False)
    assert abs(math.log(none)) < math.log(5.0)
    assert abs(math.log(one / none)) < math.log(8.0)


def test_with_another_noise_what_was_found_takes_the_place_of_what_is_told() -> None:
    rules = learning(0.5, 0.01)
    learned, bank = found_for(0.05, 0.001, rules)
    again = unlearned(learned, bank, rules)
    assert (again.speed, again.turn, again.begun) == (learned.speed, learned.turn, False)
    assert again.settled_ns == learned.settled_ns
    turns = [math.log(TURN_LOWEST * TURN_RATIO**k / 0.5) for k in range(TURN_MEMBERS)]
    speeds = [math.log(SPEED_LOWEST * SPEED_RATIO**k / 0.01) for k in range(SPEED_MEMBERS)]
    for first, offs, found in ((0, turns, learned.turn), (TURN_MEMBERS, speeds, learned.speed)):
        likely = [_posterior(bank, first + k) for k in range(len(offs))]
        apart = [abs(off - math.log(found)) for off in offs]
        assert np.argsort(likely)[::-1].tolist() == np.argsort(apart).tolist()
        assert max(likely) - min(likely) < 5.0


@given(st.floats(0.5, 2.5), st.floats(-0.45, 0.45), st.floats(0.1, 1e3), st.sampled_from([4, 6]))
def test_three_members_tell_where_their_score_is_highest(
    step: float, off: float, scale: float, order: int
) -> None:
    """By the likelihood of summed up noise beside an even one, its spectrum integrated as it stands."""
    frequency = np.exp(np.linspace(-12.0, 12.0, 4001))
    true = frequency**-order + 1.0

    def score(y: float) -> float:
        told = math.exp(y) * frequency**-order + 1.0
        short = (np.log(told / true) + true / told - 1.0) * frequency
        return -scale * float(np.sum(short))

    best = -off * step
    below, above = score(best) - score(best - step), score(best) - score(best + step)
    assert vertex(below, above, step, float(order)) == pytest.approx(off * step, abs=1e-3)


def test_members_that_are_all_alike_tell_nothing() -> None:
    assert vertex(0.0, 0.0, 1.0, 4.0) == 0.0
