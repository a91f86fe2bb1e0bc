"""The compiled filters against filterpy's, and against the model that both are made of."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from estimation.filters.compiled import CompiledExtended, CompiledUnscented
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.filters import kernels
from estimation.filters.belief import Belief, Model, innovation
from estimation.filters.estimator import Estimator
from estimation.filters.kalman import ExtendedFilter, UnscentedFilter
from estimation.models.measurement import FrontEnd, Measurement
from estimation.models.motion import FollowerMotion, LeaderLimits, Matrix, ProcessNoise, Vector

LIMITS = LeaderLimits(v_eps=0.04, k_v=0.3, k_u=0.7)
WORLD = Model(FrontEnd.WORLD, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5))
BODY = replace(WORLD, front_end=FrontEnd.BODY)
PAIRS = [
    (compiled(model), carried(model))
    for compiled, carried in ((CompiledExtended, ExtendedFilter), (CompiledUnscented, UnscentedFilter))
    for model in (WORLD, BODY)
]
STILL = FollowerMotion(0.0, 0.0, 0.0, 0.0)
IDS = ["ekf-world", "ekf-body", "ukf-world", "ukf-body"]

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
    return Measurement(0, position, np.array([[1.0, tilt], [tilt, 1.0]]) * np.outer(sds, sds), draw(motions))


def assert_same(found: Belief, wanted: Belief) -> None:
    """Same to 1e-9 of the standard deviations, and of the values themselves."""
    sd = np.sqrt(np.diag(wanted.covariance))
    assert np.all(np.abs(found.mean - wanted.mean) <= 1e-9 * (np.abs(wanted.mean) + sd))
    assert np.all(np.abs(found.covariance - wanted.covariance) <= 1e-9 * np.outer(sd, sd))
    assert np.array_equal(found.covariance, found.covariance.T)


@pytest.mark.parametrize("pair", PAIRS, ids=IDS)
@given(belief=beliefs(), dt=durations, follower=motions)
@settings(max_examples=60)
def test_predictions_are_filterpys(
    pair: tuple[Estimator, Estimator], belief: Belief, dt: float, follower: FollowerMotion
) -> None:
    compiled, carried = pair
    assert_same(compiled.predict(belief, dt, follower), carried.predict(belief, dt, follower))


@pytest.mark.parametrize("pair", PAIRS, ids=IDS)
@given(belief=beliefs(), measurement=measurements())
@settings(max_examples=60)
def test_updates_are_filterpys(
    pair: tuple[Estimator, Estimator], belief: Belief, measurement: Measurement
) -> None:
    compiled, carried = pair
    found, wanted = compiled.update(belief, measurement), carried.update(belief, measurement)
    # A measurement a million times surer than the prior costs filterpy's gain, a ratio of sums over sigma
    # points, that many digits; so the scale of rounding is that of what goes in, not of what comes out.
    sd = np.sqrt(np.diag(belief.covariance))
    scale = np.abs(belief.mean) + sd + np.abs(measurement.position).max() + np.abs(belief.mean[:2]).max()
    assert np.all(np.abs(found.mean - wanted.mean) <= 1e-9 * scale * max(1.0, sd.max() / sd[:2].min()))
    assert np.all(np.abs(found.covariance - wanted.covariance) <= 1e-9 * np.outer(sd, sd))
    assert np.array_equal(found.covariance, found.covariance.T)


@pytest.mark.parametrize("pair", PAIRS, ids=IDS)
@pytest.mark.parametrize("rate", [10.0, 120.0])
def test_a_whole_track_is_filterpys(pair: tuple[Estimator, Estimator], rate: float) -> None:
    compiled, carried = pair
    generator = np.random.default_rng(round(rate))
    follower = FollowerMotion(0.1, -0.4, 5e-3, 3e-2)
    found = wanted = carried.start(seen(generator, 0.0, follower))
    for k in range(1, 400):
        measurement = seen(generator, k / rate, follower)
        found = compiled.update(compiled.predict(found, 1.0 / rate, follower), measurement)
        wanted = carried.update(carried.predict(wanted, 1.0 / rate, follower), measurement)
        assert_same(found, wanted)


@pytest.mark.parametrize("pair", PAIRS, ids=IDS)
@given(belief=beliefs(), dt=durations, measurement=measurements(), share=st.floats(0.5, 2.0))
@settings(max_examples=50)
def test_a_step_is_a_prediction_a_gate_and_an_update(
    pair: tuple[Estimator, Estimator], belief: Belief, dt: float, measurement: Measurement, share: float
) -> None:
    compiled, follower = pair[0], measurement.motion
    prior = compiled.predict(belief, dt, follower)
    nis = innovation(prior, measurement).nis
    gate = share * nis
    found, told = compiled.step(belief, dt, follower, measurement, gate)
    assert told == pytest.approx(nis, rel=1e-9)
    wanted = compiled.update(prior, measurement) if told <= gate else prior
    assert np.array_equal(found.mean, wanted.mean)
    assert np.array_equal(found.covariance, wanted.covariance)


def seen(generator: np.random.Generator, at: float, follower: FollowerMotion) -> Measurement:
    """A leader on a circle, seen with noise."""
    position = 0.2 * np.array([np.cos(0.5 * at), np.sin(0.5 * at)]) + 1e-3 * generator.standard_normal(2)
    return Measurement(0, position, 1e-6 * np.eye(2), follower)


@pytest.mark.parametrize("estimator", [pair[0] for pair in PAIRS], ids=IDS)
def test_the_layout_of_what_is_given_does_not_matter(estimator: Estimator) -> None:
    generator = np.random.default_rng(3)
    follower = FollowerMotion(0.1, -0.4, 5e-3, 3e-2)
    measurement = seen(generator, 0.0, follower)
    plain = estimator.predict(estimator.start(measurement), 0.1, follower)
    odd = Belief(strided(plain.mean), fortran(plain.covariance))
    other = replace(
        measurement, position=strided(measurement.position), covariance=fortran(measurement.covariance)
    )
    for found, wanted in (
        (estimator.predict(odd, 0.1, follower), estimator.predict(plain, 0.1, follower)),
        (estimator.update(odd, other), estimator.update(plain, measurement)),
        (
            estimator.step(odd, 0.1, follower, other, math.inf)[0],
            estimator.step(plain, 0.1, follower, measurement, math.inf)[0],
        ),
    ):
        assert np.array_equal(found.mean, wanted.mean)
        assert np.array_equal(found.covariance, wanted.covariance)


def strided(values: Vector) -> Vector:
    """Every second of an array, which may not be written to."""
    spread = np.repeat(values, 2)[::2]
    spread.flags.writeable = False
    return spread


def fortran(values: Matrix) -> Matrix:
    columns = np.asfortranarray(values)
    columns.flags.writeable = False
    return columns


def test_a_direction_without_variance_breaks_nothing() -> None:
    flat = Belief(np.array([0.3, 0.1, 0.1, 0.0, 0.2]), np.diag([1e-6, 1e-6, 0.0, 1e-4, 0.0]))
    after = CompiledUnscented(WORLD).predict(flat, 0.1, STILL)
    assert np.isfinite(after.mean).all()
    assert np.linalg.eigvalsh(after.covariance).min() > 0.0


def test_no_call_ever_waits_for_the_compiler() -> None:
    every: list[Any] = [
        kernels.extended_predict,
        kernels.unscented_predict,
        kernels.update,
        kernels.extended_step,
        kernels.unscented_step,
    ]
    estimator = CompiledUnscented(WORLD)
    prior = estimator.predict(estimator.start(seen(np.random.default_rng(1), 0.0, STILL)), 1, STILL)
    odd = Measurement(0, strided(np.ones(2)), fortran(np.eye(2)), STILL)
    estimator.update(prior, odd)
    estimator.step(prior, 1, STILL, odd, 18)
    assert [len(kernel.signatures) for kernel in every] == [1] * 5
