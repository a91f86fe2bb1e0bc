from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from estimation.filters.belief import Model
from estimation.filters.filter import Kind, filter_of
from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import (
    FrontEnd,
    Measurement,
    PoseNoise,
    measure_body_from_mocap,
    measure_world,
)
from estimation.models.motion import Matrix, Vector
from estimation.tracking.estimate import (
    GUESSED,
    QUANTITIES,
    Estimate,
    estimate_at,
    estimate_of,
    guessed_if_standing,
    guessed_when_slow,
)
from estimation.tracking.track_point import NO_JUMP, JumpUncertainty, begun
from estimation.tracking.tracker import Status
from formation.angles import wrap
from formation.pose import Motion, Pose
from formation.shape import leader_velocity, polar_velocity, shape_of, shape_rates

NOISE = PoseNoise(0.002, 0.01)
angles = st.floats(-math.pi, math.pi, exclude_min=True)
poses = st.builds(Pose, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), angles)
leader_motions = st.builds(Motion, st.floats(0.02, 1.0), st.floats(-2.0, 2.0))
follower_motions = st.builds(Motion, st.floats(-1.0, 1.0), st.floats(-2.0, 2.0))
SPREAD = np.diag([1e-6, 2e-6, 4e-4, 3e-4, 0.01]) + 1e-7


def world_belief(leader: Pose, driven: Motion, covariance: Matrix = SPREAD) -> Gaussian:
    velocity = driven.v * np.exp(1j * leader.theta)
    return Gaussian.of(np.array([leader.x, leader.y, velocity.real, velocity.imag, driven.u]), covariance)


def mocap_moment(leader: Pose, follower: Pose, motion: Motion, sd: tuple[float, float]) -> Measurement:
    given_motion = FollowerMotion(motion.v, motion.u, *sd)
    return measure_world(5_000, (leader.x, leader.y), follower, NOISE, given_motion)


def estimated(belief: Gaussian, measurement: Measurement) -> Estimate:
    return estimate_of(belief, measurement, Status.TRACKING, 1.5, 4_000, NO_JUMP)


@given(poses, leader_motions, poses, follower_motions)
@settings(deadline=None)
def test_exact_belief_gives_shape_and_rates_of_the_paper(
    leader: Pose, driven: Motion, follower: Pose, own: Motion
) -> None:
    assume(math.dist((leader.x, leader.y), (follower.x, follower.y)) > 0.05)
    found = estimated(world_belief(leader, driven), mocap_moment(leader, follower, own, (0.0, 0.0)))
    shape = shape_of(leader, follower)
    rates = shape_rates(shape, driven, own)
    assert (found.rho, found.v1, found.u1) == pytest.approx((shape.rho, driven.v, driven.u), abs=1e-12)
    assert abs(wrap(found.alpha1 - shape.alpha1)) < 1e-12
    assert abs(wrap(found.alpha2 - shape.alpha2)) < 1e-12
    assert found.rho_dot == pytest.approx(rates.rho_dot, abs=1e-12)
    assert found.alpha2_dot == pytest.approx(rates.alpha2_dot, abs=1e-11)


@given(poses, leader_motions, poses, follower_motions)
@settings(deadline=None)
def test_the_rates_lead_back_to_the_leader_whatever_the_follower_measured_of_itself(
    leader: Pose, driven: Motion, follower: Pose, own: Motion
) -> None:
    assume(math.dist((leader.x, leader.y), (follower.x, follower.y)) > 0.05)
    found = estimated(world_belief(leader, driven), mocap_moment(leader, follower, own, (0.1, 0.1)))
    x, y = leader_velocity(found.rho, found.alpha2, found.rho_dot, found.alpha2_dot, own)
    v1, alpha1 = polar_velocity(x, y)
    assert v1 == pytest.approx(found.v1, abs=1e-12)
    assert abs(wrap(alpha1 - found.alpha1)) < 1e-10


@given(poses, leader_motions, poses, follower_motions)
@settings(deadline=None)
def test_body_and_world_frame_agree(leader: Pose, driven: Motion, follower: Pose, own: Motion) -> None:
    assume(math.dist((leader.x, leader.y), (follower.x, follower.y)) > 0.05)
    world = world_belief(leader, driven)
    turn = np.exp(-1j * follower.theta)
    position = complex(leader.x - follower.x, leader.y - follower.y) * turn
    velocity = driven.v * np.exp(1j * leader.theta) * turn
    mean = np.array([position.real, position.imag, velocity.real, velocity.imag, driven.u])
    motion = FollowerMotion(own.v, own.u, 0.01, 0.02)
    sighting = measure_body_from_mocap(5_000, (leader.x, leader.y), follower, NOISE, motion)
    body = estimated(Gaussian.of(mean, SPREAD), sighting)
    mocap = estimated(world, mocap_moment(leader, follower, own, (0.01, 0.02)))
    for name in ("rho", "rho_dot", "alpha2_dot", "v1", "u1"):
        assert getattr(body, name) == pytest.approx(getattr(mocap, name), abs=1e-11), name
    for name in ("alpha1", "alpha2"):
        assert abs(wrap(getattr(body, name) - getattr(mocap, name))) < 1e-11, name


def quantities(inputs: Vector) -> Vector:
    """QUANTITIES from (leader state, follower pose, v2, u2), by complex numbers."""
    line = complex(inputs[0] - inputs[5], inputs[1] - inputs[6])
    w = complex(inputs[2], inputs[3])
    seen = (w - inputs[8] * np.exp(1j * inputs[7])) * line.conjugate() / abs(line)
    alpha1 = np.angle(-line * w.conjugate())
    return np.array([seen.real, seen.imag / abs(line) - inputs[9], abs(w), alpha1, inputs[4]])


@given(st.floats(0.3, 2.0), angles, st.floats(0.05, 0.5), angles, follower_motions, angles)
@settings(deadline=None, max_examples=50)
def test_covariance_is_what_the_derivatives_carry_over(
    rho: float, bearing: float, speed: float, theta: float, own: Motion, heading: float
) -> None:
    leader = Pose(rho * math.cos(bearing), rho * math.sin(bearing), theta)
    follower = Pose(0.0, 0.0, heading)
    found = estimated(
        world_belief(leader, Motion(speed, 0.3)), mocap_moment(leader, follower, own, (0.01, 0.05))
    )
    state = world_belief(leader, Motion(speed, 0.3)).mean
    inputs = np.concatenate([state, [0.0, 0.0, heading, own.v, own.u]])
    columns = []
    for offset in 1e-6 * np.eye(10):
        change = quantities(inputs + offset) - quantities(inputs - offset)
        change[3] = wrap(float(change[3]))
        columns.append(change / 2e-6)
    slopes = np.column_stack(columns)
    spread = np.zeros((10, 10))
    spread[:5, :5] = SPREAD
    spread[5:, 5:] = np.diag([NOISE.position, NOISE.position, NOISE.heading, 0.01, 0.05]) ** 2
    assert found.covariance == pytest.approx(slopes @ spread @ slopes.T, rel=1e-5, abs=1e-9)


def test_covariance_is_the_spread_of_drawn_beliefs() -> None:
    generator = np.random.default_rng(8)
    leader, follower, own = Pose(0.5, 0.2, 0.8), Pose(-0.1, 0.3, -0.4), Motion(0.1, 0.4)
    covariance = np.diag([1e-6, 1e-6, 1e-5, 1e-5, 1e-3])
    moment = mocap_moment(leader, follower, own, (0.002, 0.01))
    claimed = estimated(world_belief(leader, Motion(0.2, 0.3), covariance), moment).covariance
    spread = np.zeros((10, 10))
    spread[:5, :5] = covariance
    spread[5:, 5:] = np.diag([NOISE.position, NOISE.position, NOISE.heading, 0.002, 0.01]) ** 2
    centre = np.concatenate([world_belief(leader, Motion(0.2, 0.3)).mean, [-0.1, 0.3, -0.4, 0.1, 0.4]])
    drawn = np.cov(
        np.stack([quantities(x) for x in generator.multivariate_normal(centre, spread, 20_000)]), rowvar=False
    )
    scale = np.sqrt(np.diag(drawn))
    assert np.max(np.abs(claimed - drawn) / np.outer(scale, scale)) < 0.05


def test_what_does_not_come_from_the_belief_is_passed_on() -> None:
    leader, follower = Pose(0.5, 0.2, 0.8), Pose(-0.1, 0.3, -0.4)
    moment = mocap_moment(leader, follower, Motion(0.1, 0.4), (0.0, 0.0))
    found = estimated(world_belief(leader, Motion(0.2, 0.3)), moment)
    assert (found.capture_ns, found.measured_ns, found.nis) == (5_000, 4_000, 1.5)
    assert (found.v2, found.u2, found.status) == (0.1, 0.4, Status.TRACKING)


@pytest.mark.parametrize("mean", [[0.0, 0.0, 0.1, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0, 0.0], [0.0] * 5])
def test_a_leader_on_the_spot_or_at_rest_gives_numbers(mean: list[float]) -> None:
    moment = Measurement.at(5_000, np.zeros(2), 1e-6 * np.eye(2), FollowerMotion(0.0, 0.0, 0.01, 0.01))
    found = estimated(Gaussian.of(np.array(mean), SPREAD), moment)
    values = [getattr(found, name) for name in (*QUANTITIES, "rho", "alpha2")]
    assert all(map(math.isfinite, values))
    assert np.isfinite(found.covariance).all()


@given(poses, leader_motions, poses, follower_motions)
@settings(deadline=None, max_examples=30)
def test_a_jump_is_uncertain_as_so_much_noise_of_the_followers_pose_would_be(
    leader: Pose, driven: Motion, follower: Pose, own: Motion
) -> None:
    assume(math.dist((leader.x, leader.y), (follower.x, follower.y)) > 0.05)
    belief, moment = world_belief(leader, driven), mocap_moment(leader, follower, own, (0.01, 0.02))
    jump = JumpUncertainty(0.03, 0.2, 7_000)
    found = estimate_of(belief, moment, Status.TRACKING, 1.5, 4_000, jump)
    noise = PoseNoise(math.hypot(NOISE.position, 0.03), math.hypot(NOISE.heading, 0.2))
    expected = estimated(belief, moment._replace(noise=noise))
    assert found.covariance == pytest.approx(expected.covariance, rel=1e-9, abs=1e-12)
    assert found.jump == jump
    assert found._replace(joint=expected.joint, jump=NO_JUMP) == expected


@pytest.mark.parametrize("known", [True, False])
def test_a_point_is_seen_from_the_pose_that_is_believed(known: bool) -> None:
    leader, follower, believed = Pose(0.5, 0.2, 0.8), Pose(-0.1, 0.3, -0.4), Pose(-0.2, 0.25, -0.5)
    limits = LeaderLimits(v_eps=0.04, k_v=0.1, k_u=0.7)
    estimator = filter_of(Kind.EKF, Model(FrontEnd.WORLD, limits, ProcessNoise.by_rule(limits, 0.5)))
    moment = mocap_moment(leader, follower, Motion(0.1, 0.4), (0.01, 0.02))
    point = begun(moment, estimator)
    point = point._replace(
        belief=world_belief(leader, Motion(0.2, 0.3)),
        nis=2.5,
        used_ns=3_000,
        jump=JumpUncertainty(0.01, 0.1, 2_000),
        check=point.check._replace(known=known, pose=believed),
    )
    seen = moment._replace(seen=moment.seen._replace(follower=believed)) if known else moment
    expected = estimate_of(point.belief, seen, Status.COASTING, 2.5, 3_000, point.jump)
    assert estimate_at(point, Status.COASTING) == expected


@given(poses, st.builds(Motion, st.floats(0.0, 0.3), st.floats(-2.0, 2.0)), poses, follower_motions)
@settings(deadline=None)
def test_below_v_eps_alpha1_is_a_guess_and_nothing_else_changes(
    leader: Pose, driven: Motion, follower: Pose, own: Motion
) -> None:
    assume(math.dist((leader.x, leader.y), (follower.x, follower.y)) > 0.05)
    told = estimated(world_belief(leader, driven), mocap_moment(leader, follower, own, (0.002, 0.01)))
    humble = guessed_when_slow(told, 0.05)
    if told.v1 >= 0.05:
        assert humble == told
        return
    # Uniform on the circle: a standard deviation of pi / sqrt(3).
    assert humble.joint.b_b == max(told.joint.b_b, math.pi**2 / 3.0)
    assert humble._replace(joint=told.joint) == told
    assert humble.joint._replace(b_b=told.joint.b_b) == told.joint
    assert pytest.approx(np.var(np.linspace(-math.pi, math.pi, 100_001)), rel=1e-4) == GUESSED
    least = np.linalg.eigvalsh(humble.covariance).min()
    assert least >= min(0.0, np.linalg.eigvalsh(told.covariance).min()) - 1e-12


@given(poses, poses, follower_motions, st.floats(0.0, 1.0))
@settings(deadline=None)
def test_alpha1_of_a_leader_that_may_stand_is_that_far_a_guess_and_nothing_else_changes(
    leader: Pose, follower: Pose, own: Motion, standing: float
) -> None:
    assume(math.dist((leader.x, leader.y), (follower.x, follower.y)) > 0.05)
    moment = mocap_moment(leader, follower, own, (0.002, 0.01))
    told = estimated(world_belief(leader, Motion(0.1, 0.2)), moment)
    doubted = guessed_if_standing(told, standing)
    # The variance of a mixture of two with the same mean, of which v1 is the mean of zero and another.
    driving = (1.0 - standing) ** 2 * told.joint.b_b
    mixed = (1.0 - standing) * driving + standing * GUESSED
    assert doubted.joint.b_b == pytest.approx(max(driving, mixed), rel=1e-12)
    others = [0, 1, 2, 4]
    kept, was = doubted.covariance[np.ix_(others, others)], told.covariance[np.ix_(others, others)]
    np.testing.assert_array_equal(kept, was)
    np.testing.assert_allclose(doubted.covariance[3, others], (1.0 - standing) * told.covariance[3, others])
    least = np.linalg.eigvalsh(doubted.covariance).min()
    assert least >= min(0.0, np.linalg.eigvalsh(told.covariance).min()) - 1e-9
    assert doubted._replace(joint=told.joint) == told
