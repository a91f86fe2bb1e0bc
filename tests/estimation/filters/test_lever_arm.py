"""A leader's body off its wheel axis: the map to it, its Jacobian, and filters that see the body alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.filters.belief import Model
from estimation.filters.filter import Filter, Kind, filter_of
from estimation.filters.gaussian import Gaussian
from estimation.filters.lever_arm import Lever, robot_under
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement, PoseNoise, measure_body, measure_world
from estimation.models.motion import Vector
from formation.angles import FloatArray
from formation.kernel import entry
from formation.pose import Pose
from tests.bits import same_bits

LIMITS = LeaderLimits(0.02, 0.22, 0.8)
LEVER = Lever(0.05, -0.02)
MODEL = Model(FrontEnd.WORLD, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5), lever=LEVER)
STILL = FollowerMotion(0.0, 0.0, 0.0, 0.0)
NOISE = PoseNoise(3e-4, 3.5e-3)
FAR = Pose(0.0, 0.0, 0.0)
DT = 1.0 / 120.0

speeds = st.one_of(st.floats(0.001, 0.019), st.floats(0.021, 0.3))
angles = st.floats(-math.pi, math.pi)


def some_belief(speed: float, heading: float) -> Gaussian:
    root = np.random.default_rng(3).normal(size=(5, 5)) * [0.01, 0.01, 0.02, 0.02, 0.3]
    mean = np.array([1.0, 2.0, speed * math.cos(heading), speed * math.sin(heading), 0.4])
    return Gaussian.of(mean, root.T @ root)


def under(mean: Vector) -> Vector:
    """State of the leader under a body."""
    return robot_under(Gaussian.of(mean, np.eye(5)), LEVER, LIMITS.v_eps).mean


@given(speeds, angles, st.floats(-1.0, 1.0))
def test_the_covariance_goes_by_the_derivative_of_the_way_to_the_robot(
    speed: float, heading: float, u: float
) -> None:
    belief = some_belief(speed, heading)._replace(u=u)
    jacobian = np.column_stack(
        [(under(belief.mean + step) - under(belief.mean - step)) / 2e-7 for step in 1e-7 * np.eye(5)]
    )
    expected = jacobian @ belief.covariance @ jacobian.T
    found = robot_under(belief, LEVER, LIMITS.v_eps).covariance
    assert found == pytest.approx(expected, rel=1e-4, abs=1e-6 * float(np.abs(expected).max()))


@given(st.floats(0.03, 0.3), angles, st.floats(-0.7, 0.7))
def test_a_body_on_a_turning_robot_tells_its_speed_and_direction(v: float, psi: float, u: float) -> None:
    cos, sin = math.cos(psi), math.sin(psi)
    ahead, left = v - u * LEVER.y, u * LEVER.x
    moved = np.array([1.0, 2.0, cos * ahead - sin * left, sin * ahead + cos * left, u])
    if math.hypot(moved[2], moved[3]) < LIMITS.v_eps or ahead < 0.5 * LIMITS.v_eps:
        return
    x, y = 1.0 - (cos * LEVER.x - sin * LEVER.y), 2.0 - (sin * LEVER.x + cos * LEVER.y)
    assert under(moved) == pytest.approx([x, y, v * cos, v * sin, u], abs=1e-9)


@given(st.floats(0.0, 0.3), angles, st.floats(-20.0, 20.0))
def test_the_way_to_the_robot_has_an_end_at_any_speed_and_turn(
    speed: float, heading: float, u: float
) -> None:
    found = robot_under(some_belief(speed, heading)._replace(u=u), LEVER, LIMITS.v_eps)
    assert np.isfinite(np.array(found[:20])).all()
    assert math.hypot(found.x - 1.0, found.y - 2.0) <= math.hypot(*LEVER) + 1e-9


def test_a_leader_that_stands_is_as_uncertain_as_its_velocity_leaves_the_arm() -> None:
    estimator, seen = filter_of(Kind.EKF, MODEL), measure_world(0, (1.0, 2.0), FAR, NOISE, STILL)
    leader = estimator.leader(estimator.start(seen), seen)
    assert (leader.x, leader.y) == (1.0, 2.0)
    assert math.sqrt(leader.x_x) > math.hypot(*LEVER)


def tracks(kind: Kind, lever: Lever, seed: int, seconds: float = 6.0) -> tuple[FloatArray, FloatArray]:
    """Errors (n, 5) of the state in the second half of a winding drive, and their deviations."""
    model = Model(FrontEnd.WORLD, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5), lever=lever)
    estimator, random = filter_of(kind, model), np.random.default_rng(seed)
    x, y, psi, v = 0.0, 0.0, 1.0, 0.08
    belief: Gaussian | None = None
    errors, deviations = [], []
    for k in range(round(seconds / DT)):
        u = 0.7 * math.sin(math.pi * k * DT / 2.0 + 0.3 * seed)
        mid = psi + 0.5 * u * DT
        x, y, psi = x + v * DT * math.cos(mid), y + v * DT * math.sin(mid), psi + u * DT
        cos, sin = math.cos(psi), math.sin(psi)
        bx, by = x + cos * LEVER.x - sin * LEVER.y, y + sin * LEVER.x + cos * LEVER.y
        seen = (bx + 3e-4 * random.normal(), by + 3e-4 * random.normal())
        measurement = measure_world(round(k * DT * 1e9), seen, FAR, NOISE, STILL)
        if belief is None:
            belief = estimator.start(measurement)
        else:
            belief = estimator.step(belief, DT, STILL, measurement, math.inf).belief
        if k * DT > 0.5 * seconds:
            leader = estimator.leader(belief, measurement)
            errors.append(leader.mean - [x, y, v * cos, v * sin, u])
            deviations.append(np.sqrt(np.diag(leader.covariance)))
    return np.array(errors), np.array(deviations)


@pytest.mark.parametrize("kind", [Kind.EKF, Kind.UKF])
def test_a_filter_that_knows_the_lever_finds_the_robot_under_the_body(kind: Kind) -> None:
    drives = [tracks(kind, LEVER, seed) for seed in range(4)]
    errors, deviations = (np.concatenate(parts) for parts in zip(*drives, strict=True))
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    # Without a lever the same drives give 0.15 mm, 3 mm/s and 0.14 rad/s.
    assert (rms < [1e-3, 1e-3, 3e-3, 3e-3, 0.14]).all()
    share = np.mean(np.abs(errors) < 3.0 * deviations, axis=0)
    assert (share > 0.99).all()


def test_a_filter_that_does_not_know_of_it_is_off_by_the_lever() -> None:
    errors, _ = tracks(Kind.EKF, Lever(0.0, 0.0), seed=0)
    assert np.sqrt(np.mean(np.square(errors[:, 0:2]).sum(axis=1))) > 0.05


def test_a_sighting_sees_the_robot_itself() -> None:
    estimator = filter_of(Kind.EKF, Model(FrontEnd.BODY, LIMITS, MODEL.noise, lever=LEVER))
    belief = some_belief(0.1, 0.5)
    same_bits(estimator.leader(belief, measure_body(0, 0.3, 1.0, 0.01, 0.02, STILL)), belief)


@entry
def stepped(estimator: Filter, belief: Gaussian, dt: float, seen: Measurement) -> Gaussian:
    """A step in compiled code, and what it says of the leader."""
    return estimator.leader(estimator.step(belief, dt, seen.motion, seen, 1e9).belief, seen)


@pytest.mark.parametrize("kind", [Kind.EKF, Kind.UKF])
@pytest.mark.parametrize("speed", [0.01, 0.1])
def test_compiled_and_plain_steps_agree_to_the_last_bit(kind: Kind, speed: float) -> None:
    estimator, belief = filter_of(kind, MODEL), some_belief(speed, 0.7)
    seen = measure_world(0, (1.05, 2.0), FAR, NOISE, STILL)
    plain = estimator.leader(estimator.step(belief, DT, STILL, seen, 1e9).belief, seen)
    same_bits(stepped(estimator, belief, DT, seen), plain)
