from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from estimation.consistency.cramer_rao import TruePath, cramer_rao, state_bound
from estimation.consistency.entries import carry_bounds
from estimation.consistency.information import Least, Terms
from estimation.filters.belief import Model
from estimation.models.coordinated_turn import LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, PoseNoise
from estimation.tracking.estimate import QUANTITIES
from formation.angles import FloatArray, wrap
from formation.kernel import interpreted
from formation.pose import Motion, Pose
from formation.records import columns_of, row_of, rows_of
from formation.shape import shape_of
from tests.formation.shape_rates import relative_rates

ComplexArray = NDArray[np.complex128]
DT = 1.0 / 120.0
LIMITS = LeaderLimits(v_eps=0.04, k_v=0.3, k_u=0.7)
MODEL = Model(FrontEnd.WORLD, LIMITS, ProcessNoise.by_rule(LIMITS, 0.5))
NOISE = PoseNoise(position=1e-3, heading=0.0035)
SD_V2, SD_U2 = 2e-3, 1e-2


def straight_path(count: int, dt: float = DT, speed: float = 0.2) -> TruePath:
    """Leader along x; follower abreast on its right at 0.5 m, at the same speed."""
    t = dt * np.arange(count)
    leader = np.zeros((count, 5))
    leader[:, 0], leader[:, 2] = speed * t, speed
    pose = np.column_stack([speed * t, np.full(count, -0.5), np.zeros(count)])
    return TruePath(
        np.rint(t * 1e9).astype(np.int64),
        leader,
        pose,
        np.column_stack([np.full(count, speed), np.zeros(count)]),
        np.ones(count, dtype=np.bool_),
    )


def never_turning(q_v: float) -> Model:
    """Constant velocity: no turn rate at all, and with v_eps far above any speed isotropic noise of w."""
    limits = LeaderLimits(v_eps=1e4, k_v=0.3, k_u=0.0)
    return Model(FrontEnd.WORLD, limits, ProcessNoise(q_v, 0.0, limits.v_eps))


def test_the_constant_velocity_limit_is_the_riccati_solution() -> None:
    q_v, dt = 9e-4, 1.0 / 120.0
    bound = state_bound(straight_path(600), never_turning(q_v), NOISE.position)[-1]
    move = np.array([[1.0, dt], [0.0, 1.0]])
    drive = q_v * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    see = np.array([[1.0, 0.0]])
    before = solve_discrete_are(move.T, see.T, drive, np.array([[NOISE.position**2]]))
    after = np.linalg.inv(np.linalg.inv(before) + see.T @ see / NOISE.position**2)
    for axis in (0, 1):
        assert bound[np.ix_([axis, axis + 2], [axis, axis + 2])] == pytest.approx(after, rel=1e-5)


def test_at_high_rates_the_constant_velocity_limit_is_the_kalman_bucy_filter() -> None:
    # Double integrator driven by white noise q, seen through white noise of density r = sigma^2 dt.
    q, dt = 9e-4, 1e-3
    r = NOISE.position**2 * dt
    bound = cramer_rao(straight_path(3000, dt), never_turning(q), NOISE, SD_V2, SD_U2)
    assert bound["v1"][-1] == pytest.approx(math.sqrt(math.sqrt(2.0) * q**0.75 * r**0.25), rel=0.01)


def test_without_measurements_the_bound_grows_by_the_process_noise_alone() -> None:
    path = straight_path(400)
    measured = path.measured.copy()
    measured[300:] = False
    q_v = 9e-4
    model = never_turning(q_v)
    gap = cramer_rao(replace(path, measured=measured), model, NOISE, SD_V2, SD_U2)["v1"]
    whole = cramer_rao(path, model, NOISE, SD_V2, SD_U2)["v1"]
    assert gap[:300].tolist() == whole[:300].tolist()
    assert gap[399] ** 2 - gap[299] ** 2 == pytest.approx(100 * DT * q_v, rel=1e-4)


def test_what_is_not_yet_seen_has_no_bound() -> None:
    path = straight_path(10)
    measured = np.arange(10) >= 4
    bound = cramer_rao(replace(path, measured=measured), MODEL, NOISE, SD_V2, SD_U2)
    for name, deviations in bound.items():
        assert np.isinf(deviations[:4]).all(), name
        assert np.isfinite(deviations[4:]).all(), name
    assert bound["v1"][4] == pytest.approx(LIMITS.k_v)
    assert bound["u1"][4] == pytest.approx(LIMITS.k_u)


def test_better_mocap_and_more_frames_never_hurt() -> None:
    path = straight_path(240)
    every_third = replace(path, measured=np.arange(240) % 3 == 0)
    fine = cramer_rao(path, MODEL, PoseNoise(3e-4, 0.0035), SD_V2, SD_U2)
    coarse = cramer_rao(path, MODEL, NOISE, SD_V2, SD_U2)
    rare = cramer_rao(every_third, MODEL, NOISE, SD_V2, SD_U2)
    for name in QUANTITIES:
        assert np.all(fine[name] <= coarse[name] * (1.0 + 1e-12)), name
        assert np.all(coarse[name] <= rare[name] * (1.0 + 1e-12)), name


@dataclass
class Leaders:
    """Many leaders at once in complex numbers: position p, velocity w, turn rate u, each (runs,)."""

    p: ComplexArray
    w: ComplexArray
    u: FloatArray

    def turn(self, dt: float) -> tuple[ComplexArray, ComplexArray, ComplexArray, ComplexArray]:
        """Factors that carry w into w and into p over dt, and their derivatives with respect to u."""
        a = np.asarray(1j * self.u * dt, dtype=np.complex128)
        near = np.abs(a) < 1e-4
        safe = np.where(near, np.complex128(1.0), a)
        factor: ComplexArray = np.where(near, (1.0 + a / 2.0) * dt, (np.exp(a) - 1.0) / safe * dt)
        slope = np.where(near, 0.5 + a / 3.0, (np.exp(a) * (a - 1.0) + 1.0) / safe**2) * 1j * dt**2
        spin: ComplexArray = np.exp(a)
        return spin, factor, 1j * dt * spin, slope

    def moved(self, dt: float) -> Leaders:
        spin, factor, _, _ = self.turn(dt)
        return Leaders(self.p + factor * self.w, spin * self.w, self.u)

    def jacobian(self, dt: float) -> FloatArray:
        spin, factor, spin_slope, slope = self.turn(dt)
        result = np.tile(np.eye(5), (len(self.u), 1, 1))
        for row, gain, by_u in ((0, factor, slope * self.w), (2, spin, spin_slope * self.w)):
            result[:, row, 2], result[:, row, 3] = gain.real, -gain.imag
            result[:, row + 1, 2], result[:, row + 1, 3] = gain.imag, gain.real
            result[:, row, 4], result[:, row + 1, 4] = by_u.real, by_u.imag
        return result

    def drive(self, dt: float) -> FloatArray:
        """Process noise, assembled from the factor along w: an integrated random walk."""
        noise = MODEL.noise
        w = np.stack([self.w.real, self.w.imag], axis=1)
        along = noise.q_v * (w[:, :, None] * w[:, None, :] + noise.v_eps**2 * np.eye(2))
        along /= (np.abs(self.w) ** 2 + noise.v_eps**2)[:, None, None]
        result = np.zeros((len(self.u), 5, 5))
        time = np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
        result[:, :4, :4] = np.einsum("ij,kab->kiajb", time, along).reshape(-1, 4, 4)
        result[:, 4, 4] = noise.q_u * dt
        return result

    def stacked(self) -> FloatArray:
        return np.stack([self.p.real, self.p.imag, self.w.real, self.w.imag, self.u], axis=1)

    @staticmethod
    def unstacked(x: FloatArray) -> Leaders:
        return Leaders(_complex(x[:, 0], x[:, 1]), _complex(x[:, 2], x[:, 3]), x[:, 4])


def _complex(real: FloatArray, imaginary: FloatArray) -> NDArray[np.complex128]:
    """Put the parts together without arithmetic, whose result types differ between numpy's versions."""
    whole = np.zeros(len(real), dtype=np.complex128)
    whole.real, whole.imag = real, imaginary
    return whole


def random_leaders(generator: np.random.Generator, runs: int, steps: int) -> FloatArray:
    """True states (steps, runs, 5) of leaders that move as the model's own process noise says."""
    heading = generator.uniform(-math.pi, math.pi, runs)
    velocity = _complex(0.2 * np.cos(heading), 0.2 * np.sin(heading))
    leaders = Leaders(np.zeros(runs, complex), velocity, generator.uniform(-0.5, 0.5, runs))
    states = [leaders.stacked()]
    for _ in range(steps - 1):
        shocks = np.linalg.cholesky(leaders.drive(DT)) @ generator.standard_normal((runs, 5, 1))
        leaders = Leaders.unstacked(leaders.moved(DT).stacked() + shocks[:, :, 0])
        states.append(leaders.stacked())
    return np.stack(states)


def filtered(generator: np.random.Generator, truth: FloatArray, sigma: float) -> FloatArray:
    """Estimates (steps, runs, 5) of a plain EKF, written apart from the package."""
    steps, runs, _ = truth.shape
    seen = truth[:, :, 0:2] + sigma * generator.standard_normal((steps, runs, 2))
    x = np.concatenate([seen[0], np.zeros((runs, 3))], axis=1)
    spread = np.array([sigma, sigma, LIMITS.k_v, LIMITS.k_v, LIMITS.k_u])
    covariance = np.tile(np.diag(spread**2), (runs, 1, 1))
    estimates = [x]
    for z in seen[1:]:
        leaders = Leaders.unstacked(x)
        jacobian = leaders.jacobian(DT)
        covariance = jacobian @ covariance @ jacobian.transpose(0, 2, 1) + leaders.drive(DT)
        x = leaders.moved(DT).stacked()
        gain = covariance[:, :, 0:2] @ np.linalg.inv(covariance[:, 0:2, 0:2] + sigma**2 * np.eye(2))
        x = x + np.einsum("kij,kj->ki", gain, z - x[:, 0:2])
        covariance = covariance - gain @ covariance[:, 0:2, :]
        estimates.append(x)
    return np.stack(estimates)


def quantities(state: FloatArray, pose: FloatArray, v2: FloatArray, u2: FloatArray) -> FloatArray:
    """rho_dot, alpha2_dot, v1, alpha1, u1 (..., 5) of leader states seen from follower poses."""
    line = state[..., 0] + 1j * state[..., 1] - pose[..., 0] - 1j * pose[..., 1]
    w = state[..., 2] + 1j * state[..., 3]
    seen = (w - v2 * np.exp(1j * pose[..., 2])) * np.conj(line) / np.abs(line)
    alpha1 = np.angle(-line * np.conj(w))
    return np.stack([seen.real, seen.imag / np.abs(line) - u2, np.abs(w), alpha1, state[..., 4]], axis=-1)


@pytest.mark.slow
def test_an_independent_filter_on_random_leaders_comes_close_to_the_bound_and_not_below() -> None:
    generator = np.random.default_rng(11)
    runs, steps, late = 150, 300, 180
    truth = random_leaders(generator, runs, steps)
    estimates = filtered(generator, truth, NOISE.position)
    # The follower turns on a circle beside where the leaders start.
    t = DT * np.arange(steps)
    pose = np.stack([0.5 * np.sin(0.4 * t), -1.0 - 0.5 * np.cos(0.4 * t), 0.4 * t], axis=1)
    v2, u2 = np.full(steps, 0.2), np.full(steps, 0.4)
    capture_ns = np.rint(t * 1e9).astype(np.int64)
    measured = np.ones(steps, dtype=np.bool_)
    deviations = []
    for run in range(0, runs, 3):
        path = TruePath(capture_ns, truth[:, run], pose, np.column_stack([v2, u2]), measured)
        bound = cramer_rao(path, MODEL, NOISE, SD_V2, SD_U2, np.arange(steps) >= late)
        deviations.append(np.stack([bound[name] for name in QUANTITIES], axis=1))

    shaking = np.array([NOISE.position, NOISE.position, NOISE.heading])
    seen_pose = pose[:, None, :] + shaking * generator.standard_normal((steps, runs, 3))
    seen_v2 = v2[:, None] + SD_V2 * generator.standard_normal((steps, runs))
    seen_u2 = u2[:, None] + SD_U2 * generator.standard_normal((steps, runs))
    believed = quantities(estimates, seen_pose, seen_v2, seen_u2)
    errors = believed - quantities(truth, pose[:, None, :], v2[:, None], u2[:, None])
    errors[..., 3] = wrap(errors[..., 3])
    rmse = np.sqrt(np.mean(errors[late:] ** 2, axis=(0, 1)))
    ratio = rmse / np.sqrt(np.mean(np.square(deviations), axis=(0, 1)))
    # Of these runs' time about 450 samples are independent: three standard errors of a ratio are 10 %.
    assert np.all((ratio > 0.9) & (ratio < 1.1)), dict(zip(QUANTITIES, ratio.tolist(), strict=True))


def test_every_source_of_noise_reaches_the_quantities_by_their_derivatives() -> None:
    noise, sd_v2, sd_u2 = PoseNoise(5e-3, 0.05), 0.03, 0.1
    truth = random_leaders(np.random.default_rng(5), 1, 60)[:, 0]
    pose, motion = np.tile([0.4, -0.6, 0.3], (60, 1)), np.tile([0.15, 0.3], (60, 1))
    path = TruePath(
        np.rint(DT * np.arange(60) * 1e9).astype(np.int64), truth, pose, motion, np.ones(60, dtype=np.bool_)
    )
    inputs = np.concatenate([truth[-1], pose[-1], motion[-1]])
    steps = 1e-6 * np.eye(10)
    ahead, behind = inputs + steps, inputs - steps
    slopes = np.stack(
        [
            (quantities(a[:5], a[5:8], a[8], a[9]) - quantities(b[:5], b[5:8], b[8], b[9])) / 2e-6
            for a, b in zip(ahead, behind, strict=True)
        ],
        axis=1,
    )
    covariance = np.diag([0.0] * 5 + [noise.position, noise.position, noise.heading, sd_v2, sd_u2]) ** 2
    covariance[:5, :5] = state_bound(path, MODEL, noise.position)[-1]
    expected = np.sqrt(np.diag(slopes @ covariance @ slopes.T))
    bound = cramer_rao(path, MODEL, noise, sd_v2, sd_u2)
    assert [bound[name][-1] for name in QUANTITIES] == pytest.approx(expected.tolist(), rel=1e-6)


def test_the_mapping_agrees_with_the_shape_dynamics() -> None:
    # The reference used above, checked against the paper's own equations at one moment.
    leader, follower = Pose(0.3, 0.2, 0.7), Pose(0.6, -0.3, 0.4)
    state = np.array([leader.x, leader.y, 0.2 * math.cos(0.7), 0.2 * math.sin(0.7), 0.5])
    pose = np.array([follower.x, follower.y, follower.theta])
    shape = shape_of(leader, follower)
    expected = relative_rates(shape.rho, shape.alpha2, 0.2, shape.alpha1, Motion(0.15, 0.3))
    rho_dot, alpha2_dot, v1, alpha1, _ = quantities(state, pose, np.array(0.15), np.array(0.3)).tolist()
    assert (rho_dot, alpha2_dot) == pytest.approx(expected)
    assert (v1, alpha1) == pytest.approx((0.2, shape.alpha1))


def test_paths_that_cannot_be_are_refused() -> None:
    path = straight_path(5)
    with pytest.raises(ValueError, match="backwards"):
        replace(path, capture_ns=path.capture_ns[::-1])
    with pytest.raises(ValueError, match=r"leader has shape \(5, 4\), expected \(5, 5\)"):
        replace(path, leader=path.leader[:, :4])
    with pytest.raises(ValueError, match="measured"):
        replace(path, measured=path.measured[:3])
    with pytest.raises(ValueError, match="'body', expected 'world'"):
        state_bound(path, replace(MODEL, front_end=FrontEnd.BODY), 1e-3)


def test_the_bound_is_carried_to_the_same_bits_compiled_or_not() -> None:
    truth = random_leaders(np.random.default_rng(5), 1, 40)[:, 0]
    pose, motion = np.tile([0.4, -0.6, 0.3], (40, 1)), np.tile([0.15, 0.3], (40, 1))
    capture_ns, measured = np.rint(DT * np.arange(40) * 1e9).astype(np.int64), np.arange(40) % 5 > 0
    terms = row_of(Terms(MODEL.limits, MODEL.noise, NOISE, SD_V2, SD_U2))
    wanted = np.arange(40) % 3 == 0
    compiled, plain = rows_of(Least, 14), rows_of(Least, 14)
    given = (capture_ns, truth.copy(), pose, motion, measured, wanted, terms)
    carry_bounds(*given, compiled)
    interpreted(carry_bounds)(*given, plain)
    assert columns_of(compiled).tobytes() == columns_of(plain).tobytes()
