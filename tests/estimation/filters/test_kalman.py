from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.random_leaders import random_leader
from estimation.consistency.cramer_rao import TruePath, state_bound
from estimation.filters.belief import Model
from estimation.filters.estimators import make_estimator
from estimation.filters.filter import Filter
from estimation.filters.gaussian import Gaussian, nis_of
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement
from estimation.models.motion import Matrix, Vector
from estimation.tracking.track import as_filter
from formation.angles import wrap

DT = 1.0 / 120.0
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.3, k_u=0.7)
MODEL = Model(FrontEnd.WORLD, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5))
BODY = replace(MODEL, front_end=FrontEnd.BODY)
STANDING = FollowerMotion(0.0, 0.0, 0.005, 0.03)
SIGMA = 1e-3
FILTERS = ("ekf", "ukf", "ekf-filterpy", "ukf-filterpy")


def estimator_of(kind: str, model: Model = MODEL) -> Filter:
    return as_filter(make_estimator(kind, model))


def seen(position: Vector, step: int = 0, sigma: float = SIGMA) -> Measurement:
    return Measurement.at(round(step * DT * 1e9), position, sigma**2 * np.eye(2), STANDING)


def drawn_leader(generator: np.random.Generator, steps: int) -> Matrix:
    """States (steps, 5) of a leader that moves as the model's own process noise says."""
    heading = generator.uniform(-math.pi, math.pi)
    state = np.array(
        [0.0, 0.0, 0.2 * math.cos(heading), 0.2 * math.sin(heading), generator.uniform(-0.5, 0.5)]
    )
    return random_leader(generator, state, steps, DT, MODEL.noise)


@pytest.mark.parametrize("kind", FILTERS)
def test_without_turning_it_is_the_textbook_kalman_filter(kind: str) -> None:
    # A turn rate known to be zero makes the motion linear, a huge v_eps makes the noise isotropic. It is not
    # quite zero, as sigma points need a covariance of full rank.
    limits = LeaderLimits(v_eps=1e4, k_v=0.3, k_u=1e-6)
    estimator = estimator_of(kind, Model(FrontEnd.WORLD, limits, ProcessNoise(9e-4, 1e-14, 1e4)))
    generator = np.random.default_rng(1)
    truth = np.stack([0.2 * DT * np.arange(200), -0.1 * DT * np.arange(200)], axis=1)
    positions = truth + SIGMA * generator.standard_normal(truth.shape)

    move = np.kron([[1.0, DT], [0.0, 1.0]], np.eye(2))
    drive = np.kron(9e-4 * np.array([[DT**3 / 3.0, DT**2 / 2.0], [DT**2 / 2.0, DT]]), np.eye(2))
    see = np.eye(2, 4)
    x = np.concatenate([positions[0], [0.0, 0.0]])
    covariance = np.diag([SIGMA**2, SIGMA**2, 0.09, 0.09])
    belief = estimator.start(seen(positions[0]))
    for step, z in enumerate(positions[1:], start=1):
        x, covariance = move @ x, move @ covariance @ move.T + drive
        gain = covariance @ see.T @ np.linalg.inv(see @ covariance @ see.T + SIGMA**2 * np.eye(2))
        x, covariance = x + gain @ (z - see @ x), (np.eye(4) - gain @ see) @ covariance
        belief = estimator.update(estimator.predict(belief, DT, STANDING), seen(z, step))
    assert belief.mean[:4] == pytest.approx(x, abs=1e-9)
    assert belief.covariance[:4, :4] == pytest.approx(covariance, rel=1e-5, abs=1e-12)


@pytest.mark.parametrize("pair", [("ekf", "ukf"), ("ekf-filterpy", "ukf-filterpy")])
@pytest.mark.parametrize("model", [MODEL, BODY])
def test_extended_and_unscented_agree_where_the_motion_is_nearly_linear(
    pair: tuple[str, str], model: Model
) -> None:
    follower = FollowerMotion(0.15, 0.4, 1e-4, 1e-4)
    belief = Gaussian.of(np.array([0.3, 0.1, 0.2, 0.05, 0.5]), np.diag([1e-8, 1e-8, 1e-7, 1e-7, 1e-6]))
    after: list[Gaussian] = []
    for estimator in (estimator_of(kind, model) for kind in pair):
        prior = estimator.predict(belief, DT, follower)
        after.append(estimator.update(prior, seen(prior.mean[0:2] + 1e-4, sigma=1e-4)))
    assert after[0].mean == pytest.approx(after[1].mean, abs=1e-8)
    assert after[0].covariance == pytest.approx(after[1].covariance, rel=1e-3, abs=1e-12)


class Step:
    """One prediction and one update with whatever comes."""

    def __init__(self, dt: float, x: float, y: float, sigmas: tuple[float, float], v2: float, u2: float):
        self.dt = dt
        self.measurement = Measurement.at(0, np.array([x, y]), np.diag(np.square(sigmas)), STANDING)
        self.follower = FollowerMotion(v2, u2, 0.01, 0.05)

    def __repr__(self) -> str:
        return f"Step({self.dt}, {self.measurement.position}, {self.measurement.covariance}, {self.follower})"


sigmas = st.sampled_from([1e-5, 3e-4, 5e-3, 0.3])
coordinates = st.floats(-5.0, 5.0)
any_steps = st.builds(
    Step,
    st.sampled_from([1e-6, 1e-3, DT, 0.1, 1.0]),
    coordinates,
    coordinates,
    st.tuples(sigmas, sigmas),
    st.floats(-0.3, 0.3),
    st.floats(-3.0, 3.0),
)


@pytest.mark.parametrize("kind", FILTERS)
@pytest.mark.parametrize("model", [MODEL, BODY])
@given(steps=st.lists(any_steps, min_size=1, max_size=12))
@settings(deadline=None, max_examples=60)
def test_covariance_stays_symmetric_and_positive_definite_whatever_comes(
    kind: str, model: Model, steps: list[Step]
) -> None:
    estimator = estimator_of(kind, model)
    belief = estimator.start(steps[0].measurement)
    for step in steps:
        belief = estimator.update(estimator.predict(belief, step.dt, step.follower), step.measurement)
        assert np.isfinite(belief.mean).all()
        assert np.array_equal(belief.covariance, belief.covariance.T)
        scale = np.sqrt(np.diag(belief.covariance))
        assert np.linalg.eigvalsh(belief.covariance / np.outer(scale, scale)).min() > 0.0


@pytest.mark.parametrize("kind", FILTERS)
def test_prediction_and_update_leave_their_arguments_alone(kind: str) -> None:
    estimator = estimator_of(kind)
    before = estimator.start(seen(np.array([0.1, 0.2])))
    mean, covariance = before.mean.copy(), before.covariance.copy()
    prior = estimator.predict(before, DT, STANDING)
    prior_mean = prior.mean.copy()
    first = estimator.update(prior, seen(np.array([0.11, 0.2])))
    estimator.update(estimator.predict(first, DT, STANDING), seen(np.array([5.0, 5.0])))
    again = estimator.update(prior, seen(np.array([0.11, 0.2])))
    assert np.array_equal(before.mean, mean)
    assert np.array_equal(before.covariance, covariance)
    assert np.array_equal(prior.mean, prior_mean)
    assert np.array_equal(first.mean, again.mean)
    assert np.array_equal(first.covariance, again.covariance)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ekf", "ukf"])  # filterpy's give the same: test_filter
def test_on_random_leaders_it_is_consistent_and_close_to_the_bound(kind: str) -> None:
    runs, steps, late = 16, 420, 180
    generator = np.random.default_rng(21)
    estimator = estimator_of(kind)
    nis, errors, deviations, bounds = [], [], [], []
    for _ in range(runs):
        truth = drawn_leader(generator, steps)
        positions = truth[:, 0:2] + SIGMA * generator.standard_normal((steps, 2))
        belief = estimator.start(seen(positions[0]))
        for step in range(1, steps):
            measurement = seen(positions[step], step)
            prior = estimator.predict(belief, DT, STANDING)
            belief = estimator.update(prior, measurement)
            if step >= late:
                nis.append(nis_of(prior, measurement.x, measurement.y, measurement.spread))
                errors.append(polar(belief.mean) - polar(truth[step]))
                deviations.append(polar_deviations(belief.mean, belief.covariance))
        path = TruePath(
            np.rint(DT * np.arange(steps) * 1e9).astype(np.int64),
            truth,
            np.zeros((steps, 3)),
            np.zeros((steps, 2)),
            np.ones(steps, dtype=np.bool_),
        )
        states = state_bound(path, MODEL, SIGMA)
        bounds += [polar_deviations(truth[step], states[step]) for step in range(late, steps)]
    error = np.array(errors)
    error[:, 1] = wrap(error[:, 1])
    # NIS is chi-square with 2 degrees of freedom; the standard error of its mean here is 0.03.
    assert 1.9 < float(np.mean(nis)) < 2.1
    coverage = np.mean(np.abs(error) <= 3.0 * np.array(deviations), axis=0)
    assert np.all(coverage > 0.985), coverage
    efficiency = np.sqrt(np.mean(error**2, axis=0) / np.mean(np.square(bounds), axis=0))
    assert np.all(efficiency < 1.15), efficiency
    assert np.all(efficiency > 0.85), efficiency


def polar(state: Vector) -> Vector:
    """Speed, heading and turn rate."""
    return np.array([math.hypot(state[2], state[3]), math.atan2(state[3], state[2]), state[4]])


def polar_deviations(state: Vector, covariance: Matrix) -> Vector:
    """Standard deviations of speed, heading and turn rate."""
    speed = math.hypot(state[2], state[3])
    along = np.array([state[2], state[3]]) / speed
    across = np.array([-along[1], along[0]]) / speed
    block = covariance[2:4, 2:4]
    return np.sqrt([along @ block @ along, across @ block @ across, covariance[4, 4]])
