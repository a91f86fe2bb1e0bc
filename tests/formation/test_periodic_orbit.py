from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from controllers.laws import LAWS, Gains
from formation.angles import FloatArray
from formation.closed_loop import FollowerLaw, simulate_pair
from formation.leader import Constant, Sinusoid
from formation.periodic_orbit import find_orbit
from formation.pose import Pose
from formation.spacing import Spacing

FIG2 = (Sinusoid(0.5, 0.5, 1.0, math.pi), Gains(1.0, 2.0, Spacing(0.5, 2.0)))
ROBOTS = (Sinusoid(0.08, 0.2, 0.5, 0.5 * math.pi), Gains(1.5, 2.0, Spacing(0.2, 20.0)))
SETTINGS = pytest.mark.parametrize(("program", "gains"), [FIG2, ROBOTS], ids=["fig2", "robots"])


def with_gains(name: str, gains: Gains) -> FollowerLaw:
    return lambda shape, v1, u1: LAWS[name](shape, v1, u1, gains)


@SETTINGS
def test_orbit_is_where_a_long_run_ends(program: Sinusoid, gains: Gains) -> None:
    """The full system (3) from afar, against the orbit of the reduced system (5)."""
    law = with_gains("independent", gains)
    orbit = find_orbit(program, law, gains.spacing.rho_0)
    assert orbit is not None
    late = 30 * orbit.period
    times = np.concatenate([[0.0], late + orbit.t[::100]])
    run = simulate_pair(Pose(0.3, 0.0, 1.5), Pose(0.8, 0.7, -1.6), program, law, times)
    np.testing.assert_allclose(run.rho[1:], orbit.rho[::100], atol=1e-8)
    np.testing.assert_allclose(run.alpha1[1:], orbit.alpha1[::100], atol=1e-8)
    np.testing.assert_allclose(run.alpha2[1:], math.pi / 2, atol=1e-7)


def test_extremes_of_the_papers_simulation() -> None:
    """Against another integrator on other variables; a grid of 10 ms gives the figures known beforehand."""
    program, gains = FIG2
    orbit = find_orbit(program, with_gains("independent", gains), gains.spacing.rho_0)
    assert orbit is not None

    def rates(t: float, state: FloatArray) -> tuple[float, float]:
        rho, alpha1 = state.tolist()
        f = 2.0 * (rho**2 - 0.25) / rho**2
        return -0.5 * math.cos(alpha1), -0.5 - math.sin(math.pi * t) - math.cos(alpha1) + 0.5 * f

    times = np.linspace(78.0, 80.0, 2001)
    late = solve_ivp(
        rates, (0.0, 80.0), (1.0, math.pi / 4), method="LSODA", t_eval=times, rtol=1e-11, atol=1e-12
    )
    for known, ours in zip(late.y, (orbit.rho, orbit.alpha1), strict=True):
        np.testing.assert_allclose(ours, known, atol=1e-7)
    on_grid = [(float(column.min()), float(column.max())) for column in (orbit.rho[::10], orbit.alpha1[::10])]
    assert np.round(on_grid, 5).tolist() == [[0.65878, 0.76083], [-1.89506, -1.24631]]


@SETTINGS
def test_multipliers_obey_liouville(program: Sinusoid, gains: Gains) -> None:
    """Their product is exp of the integral of the trace, which is mu1 sin(alpha1) under Prop. 2."""
    orbit = find_orbit(program, with_gains("independent", gains), gains.spacing.rho_0)
    assert orbit is not None
    first, second = orbit.multipliers
    trace = gains.mu1 * float(np.mean(np.sin(orbit.alpha1[:-1]))) * orbit.period
    assert (first * second).real == pytest.approx(math.exp(trace), rel=1e-4)
    assert orbit.largest_multiplier == abs(first) >= abs(second)
    assert orbit.largest_multiplier < 1.0


@SETTINGS
def test_under_the_ideal_law_the_orbit_is_the_equilibrium(program: Sinusoid, gains: Gains) -> None:
    """There the multipliers are those of the Jacobian of the proof of Prop. 3."""
    orbit = find_orbit(program, with_gains("ideal", gains), gains.spacing.rho_0)
    assert orbit is not None
    np.testing.assert_allclose(orbit.rho, gains.spacing.rho_0, atol=1e-9)
    np.testing.assert_allclose(orbit.alpha1, -math.pi / 2, atol=1e-9)
    slope = gains.spacing.f_prime(gains.spacing.rho_0)
    jacobian = np.array([[0.0, -program.v], [program.v * slope, -gains.mu1]])
    expected = np.abs(np.linalg.eigvals(expm(jacobian * orbit.period)))
    assert [abs(m) for m in orbit.multipliers] == pytest.approx(sorted(expected, reverse=True), rel=1e-5)


def test_no_orbit_without_a_period() -> None:
    assert find_orbit(Constant(0.5, 0.1), with_gains("independent", FIG2[1]), 0.5) is None


@pytest.mark.parametrize("u_mean", [1.05, 1.3, 3.0])
def test_no_orbit_is_made_up_for_a_leader_that_turns_too_hard(u_mean: float) -> None:
    """A mean turn rate above mu_rho v1 leaves nothing to settle on."""
    assert find_orbit(Sinusoid(0.5, u_mean, 0.2, math.pi), with_gains("independent", FIG2[1]), 0.5) is None
