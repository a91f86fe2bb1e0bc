"""The filters of the loop against filterpy's, and against the model that both are made of."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.filters.belief import Belief, Model
from estimation.filters.entries import step
from estimation.filters.estimator import Estimator
from estimation.filters.filter import Filter, Kind, filter_of
from estimation.filters.gaussian import Gaussian, nis_of
from estimation.filters.kalman import ExtendedFilter, UnscentedFilter
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement
from formation.kernel import interpreted
from formation.records import columns_of, load, row_of

LIMITS = LeaderLimits(v_eps=0.04, k_v=0.3, k_u=0.7)
WORLD = Model(FrontEnd.WORLD, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5))
BODY = replace(WORLD, front_end=FrontEnd.BODY)
PAIRS: list[tuple[Filter, Estimator]] = [
    (filter_of(kind, model), peer(model))
    for kind, peer in ((Kind.EKF, ExtendedFilter), (Kind.UKF, UnscentedFilter))
    for model in (WORLD, BODY)
]
STILL = FollowerMotion(0.0, 0.0, 0.0, 0.0)
IDS = ["ekf-world", "ekf-body", "ukf-world", "ukf-body"]
FILTERS = [filter_of(kind, model) for kind in Kind for model in (WORLD, BODY)]
FILTER_IDS = [f"{kind.name.lower()}-{front_end.value}" for kind in Kind for front_end in FrontEnd]

motions = st.builds(
    FollowerMotion,
    st.floats(-0.3, 0.3),
    st.one_of(st.floats(-3.0, 3.0), st.just(0.0)),
    st.floats(0.0, 0.05),
    st.floats(0.0, 0.1),
)
durations = st.sampled_from([1e-6, 1e-3, 1.0 / 120.0, 0.1, 1.0])
numbers = st.floats(-1.0, 1.0)


@st.composite
def beliefs(draw: st.DrawFn) -> Belief:
    """Leaders that stand, crawl or drive, known to within anything from a hair to nothing at all."""
    speed = draw(st.sampled_from([0.0, 1e-3, 0.1, 1.0]))
    turn = draw(st.sampled_from([0.0, 1e-4, 1.0, 10.0]))
    scale = np.array([5.0, 5.0, speed, speed, turn])
    mean = scale * np.array(draw(st.lists(numbers, min_size=5, max_size=5)))
    mixing = np.array(draw(st.lists(numbers, min_size=25, max_size=25))).reshape(5, 5)
    sd = np.array([10.0 ** draw(st.integers(-4, 0)) for _ in range(5)])
    return Belief(mean, (mixing @ mixing.T + 0.1 * np.eye(5)) * np.outer(sd, sd))


@st.composite
def measurements(draw: st.DrawFn) -> Measurement:
    sds = np.array([draw(st.sampled_from([3e-4, 5e-3, 0.3])) for _ in range(2)])
    tilt = draw(st.floats(-0.9, 0.9))
    position = 5.0 * np.array([draw(numbers), draw(numbers)])
    spread = np.array([[1.0, tilt], [tilt, 1.0]]) * np.outer(sds, sds)
    return Measurement.at(0, position, spread, draw(motions))


def assert_same(found: Gaussian, wanted: Belief) -> None:
    """Same to 1e-9 of the standard deviations, and of the values themselves."""
    sd = np.sqrt(np.diag(wanted.covariance))
    assert np.all(np.abs(found.mean - wanted.mean) <= 1e-9 * (np.abs(wanted.mean) + sd))
    assert np.all(np.abs(found.covariance - wanted.covariance) <= 1e-9 * np.outer(sd, sd))


@pytest.mark.parametrize("pair", PAIRS, ids=IDS)
@given(belief=beliefs(), dt=durations, follower=motions)
@settings(max_examples=60, deadline=None)
def test_predictions_are_filterpys(
    pair: tuple[Filter, Estimator], belief: Belief, dt: float, follower: FollowerMotion
) -> None:
    ours, theirs = pair
    assert_same(ours.predict(belief.gaussian, dt, follower), theirs.predict(belief, dt, follower))


@pytest.mark.parametrize("pair", PAIRS, ids=IDS)
@given(belief=beliefs(), measurement=measurements())
@settings(max_examples=60, deadline=None)
def test_updates_are_filterpys(
    pair: tuple[Filter, Estimator], belief: Belief, measurement: Measurement
) -> None:
    ours, theirs = pair
    found, wanted = ours.update(belief.gaussian, measurement), theirs.update(belief, measurement)
    # A measurement a million times surer than the prior costs filterpy's gain, a ratio of sums over sigma
    # points, that many digits; so the scale of rounding is that of what goes in, not of what comes out.
    sd = np.sqrt(np.diag(belief.covariance))
    scale = np.abs(belief.mean) + sd + np.abs(measurement.position).max() + np.abs(belief.mean[:2]).max()
    assert np.all(np.abs(found.mean - wanted.mean) <= 1e-9 * scale * max(1.0, sd.max() / sd[:2].min()))
    assert np.all(np.abs(found.covariance - wanted.covariance) <= 1e-9 * np.outer(sd, sd))


@pytest.mark.parametrize("pair", PAIRS, ids=IDS)
@pytest.mark.parametrize("rate", [10.0, 120.0])
def test_a_whole_track_is_filterpys(pair: tuple[Filter, Estimator], rate: float) -> None:
    ours, theirs = pair
    generator = np.random.default_rng(round(rate))
    follower = FollowerMotion(0.1, -0.4, 5e-3, 3e-2)
    wanted = theirs.start(seen(generator, 0.0, follower))
    beliefs_, filters = row_of(wanted.gaussian), row_of(ours)
    for k in range(1, 400):
        measurement = seen(generator, k / rate, follower)
        step(beliefs_, row_of(measurement), filters, 1.0 / rate, math.inf)
        wanted = theirs.update(theirs.predict(wanted, 1.0 / rate, follower), measurement)
        assert_same(load(Gaussian, beliefs_, 0), wanted)


@pytest.mark.parametrize("estimator", FILTERS, ids=FILTER_IDS)
@given(belief=beliefs(), dt=durations, measurement=measurements(), share=st.floats(0.5, 2.0))
@settings(max_examples=50, deadline=None)
def test_a_step_is_a_prediction_a_gate_and_an_update(
    estimator: Filter, belief: Belief, dt: float, measurement: Measurement, share: float
) -> None:
    follower = measurement.motion
    prior = estimator.predict(belief.gaussian, dt, follower)
    nis = nis_of(prior, measurement.x, measurement.y, measurement.spread)
    gate = share * nis
    found = estimator.step(belief.gaussian, dt, follower, measurement, gate)
    assert found.nis == nis
    assert found.belief == (estimator.update(prior, measurement) if nis <= gate else prior)
    unknown = estimator.step(belief.gaussian, dt, follower, measurement._replace(x=math.nan), math.inf)
    assert math.isnan(unknown.nis)
    assert unknown.belief == prior


@pytest.mark.parametrize("estimator", FILTERS, ids=FILTER_IDS)
@given(belief=beliefs(), dt=durations, measurement=measurements(), share=st.floats(0.5, 2.0))
@settings(max_examples=50, deadline=None)
def test_compiled_and_plain_steps_give_the_same_bits(
    estimator: Filter, belief: Belief, dt: float, measurement: Measurement, share: float
) -> None:
    gate = share * nis_of(belief.gaussian, measurement.x, measurement.y, measurement.spread)
    compiled, plain = row_of(belief.gaussian), row_of(belief.gaussian)
    seen_, filters = row_of(measurement), row_of(estimator)
    results = [each(rows, seen_, filters, dt, gate) for each, rows in ((step, compiled), (_plain, plain))]
    assert np.array(results[0]).tobytes() == np.array(results[1]).tobytes()
    assert columns_of(compiled).tobytes() == columns_of(plain).tobytes()


_plain = interpreted(step)


def seen(generator: np.random.Generator, at: float, follower: FollowerMotion) -> Measurement:
    """A leader on a circle, seen with noise."""
    position = 0.2 * np.array([np.cos(0.5 * at), np.sin(0.5 * at)]) + 1e-3 * generator.standard_normal(2)
    return Measurement.at(0, position, 1e-6 * np.eye(2), follower)


def test_a_direction_without_variance_breaks_nothing() -> None:
    flat = Gaussian.of(np.array([0.3, 0.1, 0.1, 0.0, 0.2]), np.diag([1e-6, 1e-6, 0.0, 1e-4, 0.0]))
    after = filter_of(Kind.UKF, WORLD).predict(flat, 0.1, STILL)
    assert np.isfinite(after.mean).all()
    assert np.linalg.eigvalsh(after.covariance).min() > 0.0


@pytest.mark.parametrize("estimator", FILTERS, ids=FILTER_IDS)
def test_the_model_of_a_filter_is_the_one_that_it_was_made_of(estimator: Filter) -> None:
    assert filter_of(Kind(estimator.kind), estimator.model) == estimator
