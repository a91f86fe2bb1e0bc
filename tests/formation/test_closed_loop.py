from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from controllers.laws import LAWS, Gains
from formation.angles import FloatArray, wrap
from formation.closed_loop import FollowerLaw, IntegrationError, simulate_pair
from formation.leader import Constant, Impulse, LeaderProgram, Sinusoid, Table
from formation.pose import Motion, Pose
from formation.shape import ABREAST_ALPHA1, ABREAST_ALPHA2, Shape, follower_pose, shape_of, shape_rates
from formation.spacing import Spacing, lyapunov

FIG2 = (
    Pose(0.0, 0.0, math.pi / 4),
    Pose(0.0, 1.0, math.pi),
    Sinusoid(0.5, 0.5, 1.0, math.pi),
    Gains(1.0, 2.0, Spacing(0.5, 2.0)),
)
ROBOTS = (
    Pose(0.287, 0.005, 1.553),
    Pose(0.767, 0.685, -1.574),
    Sinusoid(0.08, 0.2, 0.5, 0.5 * math.pi),
    Gains(1.5, 2.0, Spacing(0.2, 20.0)),
)
Vector = tuple[float, float]


def with_gains(name: str, gains: Gains) -> FollowerLaw:
    return lambda shape, v1, u1: LAWS[name](shape, v1, u1, gains)


def vector_law(name: str, gains: Gains) -> Callable[[FloatArray, Motion], Motion]:
    """The paper's laws written anew, on world poses and with cross and dot products instead of angles."""

    def law(state: FloatArray, leader: Motion) -> Motion:
        x1, y1, theta1, x2, y2, theta2 = state.tolist()
        rho = math.hypot(x2 - x1, y2 - y1)
        line: Vector = ((x2 - x1) / rho, (y2 - y1) / rho)
        heading1: Vector = (math.cos(theta1), math.sin(theta1))
        heading2: Vector = (math.cos(theta2), math.sin(theta2))
        cos1 = heading1[0] * line[0] + heading1[1] * line[1]
        sin1 = heading1[0] * line[1] - heading1[1] * line[0]
        cos2 = -(heading2[0] * line[0] + heading2[1] * line[1])
        sin2 = -(heading2[0] * line[1] - heading2[1] * line[0])
        rho_0, mu_rho = gains.spacing.rho_0, gains.spacing.mu_rho
        f = mu_rho * (rho**2 - rho_0**2) / rho**2
        u1 = leader.u if name == "ideal" else 0.0
        v2 = -leader.v * sin1 + rho * (u1 - gains.mu1 * cos1 + leader.v * f)
        u2 = -gains.mu2 * cos2 + (leader.v * sin1 + v2 * sin2) / rho
        return Motion(v2, u2)

    return law


def runge_kutta(
    leader: Pose,
    follower: Pose,
    program: LeaderProgram,
    law: Callable[[FloatArray, Motion], Motion],
    duration: float,
    steps: int,
) -> FloatArray:
    """World poses (x1, y1, theta1, x2, y2, theta2) of both robots at the end, by fixed steps of RK4."""

    def rates(t: float, state: FloatArray) -> FloatArray:
        leading = program(t)
        following = law(state, leading)
        c1, s1, c2, s2 = np.cos(state[2]), np.sin(state[2]), np.cos(state[5]), np.sin(state[5])
        return np.array(
            [leading.v * c1, leading.v * s1, leading.u, following.v * c2, following.v * s2, following.u]
        )

    state = np.array([leader.x, leader.y, leader.theta, follower.x, follower.y, follower.theta])
    h = duration / steps
    for step in range(steps):
        t = step * h
        k1 = rates(t, state)
        k2 = rates(t + h / 2, state + h / 2 * k1)
        k3 = rates(t + h / 2, state + h / 2 * k2)
        k4 = rates(t + h, state + h * k3)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return state


@pytest.mark.parametrize("name", ["ideal", "independent"])
@pytest.mark.parametrize(
    ("setting", "duration", "steps"), [(FIG2, 12.0, 6000), (ROBOTS, 30.0, 6000)], ids=["fig2", "robots"]
)
def test_agrees_with_fixed_steps_on_world_poses(
    setting: tuple[Pose, Pose, Sinusoid, Gains], duration: float, steps: int, name: str
) -> None:
    leader, follower, program, gains = setting
    run = simulate_pair(leader, follower, program, with_gains(name, gains), np.array([0.0, duration]))
    end = runge_kutta(leader, follower, program, vector_law(name, gains), duration, steps)
    np.testing.assert_allclose(run.leader[-1, :2], end[:2], atol=1e-9)
    np.testing.assert_allclose(run.follower[-1, :2], end[3:5], atol=1e-9)
    assert abs(wrap(float(run.leader[-1, 2] - end[2]))) < 1e-9
    assert abs(wrap(float(run.follower[-1, 2] - end[5]))) < 1e-9


@pytest.mark.parametrize("setting", [FIG2, ROBOTS], ids=["fig2", "robots"])
def test_columns_fit_together(setting: tuple[Pose, Pose, Sinusoid, Gains]) -> None:
    leader, follower, program, gains = setting
    times = np.linspace(0.0, 5.0, 101)
    run = simulate_pair(leader, follower, program, with_gains("independent", gains), times)
    for row, t in enumerate(times.tolist()):
        shape = shape_of(Pose(*run.leader[row].tolist()), Pose(*run.follower[row].tolist()))
        kept = run.shape_at(row)
        assert shape.rho == pytest.approx(kept.rho, rel=1e-12)
        assert abs(wrap(shape.alpha1 - kept.alpha1)) < 1e-12
        assert abs(wrap(shape.alpha2 - kept.alpha2)) < 1e-12
        assert Motion(float(run.v1[row]), float(run.u1[row])) == program(t)
        answer = LAWS["independent"](kept, float(run.v1[row]), float(run.u1[row]), gains)
        assert (run.v2[row], run.u2[row]) == pytest.approx((answer.v, answer.u), abs=1e-9)


@pytest.mark.parametrize("name", ["ideal", "independent"])
def test_alpha2_follows_its_closed_form(name: str) -> None:
    leader, follower, program, gains = ROBOTS
    times = np.linspace(0.0, 10.0, 200)
    run = simulate_pair(leader, follower, program, with_gains(name, gains), times)
    known = np.tanh(gains.mu2 * times + np.arctanh(np.sin(run.alpha2[0])))
    np.testing.assert_allclose(np.sin(run.alpha2), known, atol=1e-9)


def test_lyapunov_function_never_rises_under_the_ideal_law() -> None:
    leader, follower, program, gains = FIG2
    run = simulate_pair(leader, follower, program, with_gains("ideal", gains), np.linspace(0.0, 12.0, 600))
    values = [lyapunov(run.shape_at(row), gains.spacing) for row in range(len(run.t))]
    assert max(np.diff(values)) <= 1e-10
    assert values[-1] < 1e-3


def test_mirrored_leader_and_start_need_a_mirrored_law() -> None:
    """The plant knows no side: with every sign flipped, the pair drives the mirror image."""
    leader, follower, program, gains = ROBOTS
    law, times = with_gains("independent", gains), np.linspace(0.0, 10.0, 50)

    def mirrored_law(shape: Shape, v1: float, u1: float) -> Motion:
        motion = law(Shape(shape.rho, -shape.alpha1, -shape.alpha2), v1, -u1)
        return Motion(motion.v, -motion.u)

    run = simulate_pair(leader, follower, program, law, times)
    image = simulate_pair(
        Pose(leader.x, -leader.y, -leader.theta),
        Pose(follower.x, -follower.y, -follower.theta),
        Sinusoid(program.v, -program.u_mean, -program.u_amplitude, program.omega),
        mirrored_law,
        times,
    )
    np.testing.assert_allclose(image.follower[:, 0], run.follower[:, 0], atol=1e-9)
    np.testing.assert_allclose(image.follower[:, 1], -run.follower[:, 1], atol=1e-9)


def test_literal_arctan_drives_the_pair_apart() -> None:
    """With alpha1 = arctan(Y/X) as printed in Eq. (7) the robots of the experiment never get together."""
    leader, follower, program, gains = ROBOTS

    def literal(state: FloatArray, leading: Motion) -> Motion:
        shape = shape_of(Pose(*state[:3].tolist()), Pose(*state[3:].tolist()))
        folded = Shape(shape.rho, math.atan(math.tan(shape.alpha1)), shape.alpha2)
        return LAWS["independent"](folded, leading.v, leading.u, gains)

    end = runge_kutta(leader, follower, program, literal, 30.0, 3000)
    assert math.hypot(end[3] - end[0], end[4] - end[1]) > 0.8


def test_constant_turn_beyond_mu_rho_v1_cannot_be_held() -> None:
    """Input-to-state stability is local: f stays below mu_rho, so there is no equilibrium."""
    leader, follower, _, gains = FIG2
    law, times = with_gains("independent", gains), np.array([0.0, 200.0, 400.0])
    lost = simulate_pair(leader, follower, Constant(0.5, 1.1), law, times)
    assert lost.rho[1] < lost.rho[2] == pytest.approx(22.0, abs=0.5)
    held = simulate_pair(leader, follower, Constant(0.5, 0.9), law, times)
    balance = gains.spacing.rho_0 / math.sqrt(1.0 - 0.9 / (0.5 * gains.spacing.mu_rho))
    assert held.rho[2] == pytest.approx(balance, rel=1e-6)


def test_a_late_impulse_is_not_stepped_over() -> None:
    """From rest in formation the integrator would stride past a short bell."""
    _, _, _, gains = FIG2
    leader = Pose(0.0, 0.0, 0.0)
    follower = follower_pose(Shape(0.5, ABREAST_ALPHA1, ABREAST_ALPHA2), leader)
    impulse = Impulse(0.5, 1.0, 50.0, 0.05)
    run = simulate_pair(leader, follower, impulse, with_gains("ideal", gains), np.array([0.0, 100.0]))
    assert run.leader[-1, 2] == pytest.approx(0.05 * math.sqrt(2.0 * math.pi), abs=1e-9)


def test_robots_that_meet_end_the_simulation_with_a_word() -> None:
    def head_on(shape: Shape, v1: float, u1: float) -> Motion:
        return Motion(1.0, 0.0)

    with pytest.raises(IntegrationError, match="breaks down"):
        simulate_pair(Pose(0, 0, 0), Pose(1, 0, math.pi), Constant(1.0), head_on, np.array([0.0, 2.0]))


def test_times_must_increase() -> None:
    leader, follower, program, gains = FIG2
    with pytest.raises(ValueError, match="increasing"):
        simulate_pair(leader, follower, program, with_gains("ideal", gains), np.array([1.0, 1.0]))


def at_constant_speed(v2: float, mu2: float = 2.0) -> FollowerLaw:
    """Steering (4) alone: a follower that does not regulate its speed."""

    def law(shape: Shape, v1: float, _u1: float) -> Motion:
        across = (v1 * math.sin(shape.alpha1) + v2 * math.sin(shape.alpha2)) / shape.rho
        return Motion(v2, -mu2 * math.cos(shape.alpha2) + across)

    return law


@pytest.mark.parametrize(("v2", "u1"), [(0.5, 0.0), (0.5, 0.1), (0.65, 0.3), (0.4, -0.2)])
def test_a_follower_of_constant_speed_attracts_no_distance(v2: float, u1: float) -> None:
    """Remark 2: abreast, v1 rho sin(alpha1) + v2 rho - u1 rho^2 / 2 never changes, whatever the steering."""
    leader, times = Pose(0.0, 0.0, 0.0), np.linspace(0.0, 6.0, 61)
    levels = []
    for rho in (0.45, 0.5, 0.6):
        follower = follower_pose(Shape(rho, ABREAST_ALPHA1 + 0.1, ABREAST_ALPHA2), leader)
        found = simulate_pair(leader, follower, Constant(0.5, u1), at_constant_speed(v2), times)
        level = 0.5 * found.rho * np.sin(found.alpha1) + v2 * found.rho - 0.5 * u1 * found.rho**2
        assert level == pytest.approx(np.full(len(times), level[0]), abs=1e-8)
        levels.append(level[0])
    # Three starts on three levels: no two of them can come to the same shape.
    assert len({round(level, 6) for level in levels}) == 3
    kept = simulate_pair(
        leader,
        follower_pose(Shape(0.6, ABREAST_ALPHA1, ABREAST_ALPHA2), leader),
        Constant(0.5, 0.0),
        with_gains("independent", FIG2[3]),
        np.linspace(0.0, 40.0, 41),
    )
    assert kept.rho[-1] == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize("gains", [FIG2[3], ROBOTS[3]], ids=["fig2", "robots"])
def test_once_the_leader_drives_straight_the_error_decays(gains: Gains) -> None:
    """After Prop. 2: from a swinging orbit V1 falls for good, at the rate of the slowest eigenvalue."""
    v1 = 0.5 if gains.spacing.rho_0 == 0.5 else 0.08
    turning = np.linspace(0.0, 20.0, 201)
    program = Table([*turning, 20.01, 60.0], [v1] * 203, [*(0.4 * np.sin(turning)), 0.0, 0.0])
    leader, rho_0 = Pose(0.0, 0.0, 0.0), gains.spacing.rho_0
    follower = follower_pose(Shape(rho_0, ABREAST_ALPHA1, ABREAST_ALPHA2), leader)
    times = np.linspace(0.0, 60.0, 601)
    found = simulate_pair(leader, follower, program, with_gains("independent", gains), times)
    straight = times > 20.05
    value = np.array([lyapunov(found.shape_at(k), gains.spacing) for k in np.flatnonzero(straight).tolist()])
    assert np.all(np.diff(value) <= 1e-12)
    off = np.hypot(found.rho / rho_0 - 1.0, found.alpha1 - ABREAST_ALPHA1)
    assert off[times < 20.0].max() > 0.1
    assert off[-1] < 1e-5
    reduced = np.array([[0.0, -v1], [v1 * gains.spacing.f_prime(rho_0), -gains.mu1]])
    slowest = float(np.linalg.eigvals(reduced).real.max())
    between = (int(np.searchsorted(times, 25.0)), int(np.searchsorted(times, 35.0)))
    seen = math.log(off[between[1]] / off[between[0]]) / 10.0
    assert seen == pytest.approx(slowest, rel=0.25)


@pytest.mark.parametrize("mu2", [0.05, 1.0, 30.0])
def test_near_the_formation_any_mu2_will_do(mu2: float) -> None:
    """Remark 1 asks for a large one: at the equilibrium alpha2 does not feel the rest, whatever mu2 is."""
    gains = Gains(1.5, mu2, Spacing(0.2, 20.0))
    law, steady = with_gains("independent", gains), np.array([0.2, ABREAST_ALPHA1, ABREAST_ALPHA2])

    def rates(state: FloatArray) -> FloatArray:
        shape = Shape(*state.tolist())
        return np.array(shape_rates(shape, Motion(0.08, 0.0), law(shape, 0.08, 0.0)))

    steps = 1e-6 * np.eye(3)
    jacobian = np.column_stack([(rates(steady + d) - rates(steady - d)) / 2e-6 for d in steps])
    assert jacobian[2, :2] == pytest.approx(np.zeros(2), abs=1e-7)
    assert jacobian[2, 2] == pytest.approx(-mu2, rel=1e-6)
    assert np.linalg.eigvals(jacobian).real.max() < 0.0


def test_far_from_the_manifold_twice_the_mu2_halves_what_it_costs() -> None:
    """Of first order in 1 / mu2, as Remark 1 has it: what a start off the manifold does to the distance."""
    leader, times = Pose(0.0, 0.0, 0.0), np.linspace(0.0, 8.0, 401)

    def distances(mu2: float, alpha2: float) -> FloatArray:
        follower = follower_pose(Shape(0.25, ABREAST_ALPHA1, alpha2), leader)
        law = with_gains("independent", Gains(1.5, mu2, Spacing(0.2, 20.0)))
        return simulate_pair(leader, follower, Constant(0.08, 0.2), law, times).rho

    costs = [
        float(np.abs(distances(mu2, ABREAST_ALPHA2 + 0.5) - distances(mu2, ABREAST_ALPHA2)).max())
        for mu2 in (25.0, 50.0, 100.0)
    ]
    assert costs[0] / costs[1] == pytest.approx(2.0, abs=0.3)
    assert costs[1] / costs[2] == pytest.approx(2.0, abs=0.2)
