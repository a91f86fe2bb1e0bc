from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from controllers.laws import Gains, independent
from formation.closed_loop import integrate
from formation.invariant_set import Disturbed, invariant_set
from formation.leader import LeaderProgram, Sinusoid, Table
from formation.periodic_orbit import find_orbit
from formation.pose import Motion
from formation.shape import ABREAST_ALPHA1, ABREAST_ALPHA2, Shape
from formation.spacing import Spacing
from formation.speed_range import SpeedRange
from formation.steering_margin import SteeringMargin, settles, settles_in_proof, steering_margin
from tests.formation.shape_rates import reduced_rates

MU1, SPACING, V1 = 1.5, Spacing(0.2, 20.0), 0.08
GAINS = Gains(MU1, 2.0, SPACING)


@pytest.fixture(scope="module")
def margin() -> SteeringMargin:
    return steering_margin(MU1, SPACING, V1)


def law(shape: Shape, v1: float, u1: float) -> Motion:
    return independent(shape, v1, u1, GAINS)


def motion(program: LeaderProgram, start: tuple[float, float], times: np.ndarray) -> np.ndarray:
    """States (rho, alpha1) of the reduced system under the published law."""

    def rates(t: float, state: np.ndarray) -> tuple[float, ...]:
        driven, rho, alpha1 = program(t), float(state[0]), float(state[1])
        return reduced_rates(rho, alpha1, driven, law(Shape(rho, alpha1, ABREAST_ALPHA2), driven.v, 0.0).v)

    return integrate(rates, np.array(start), times, program.longest_step)


def test_the_bracket_of_the_robot_experiment(margin: SteeringMargin) -> None:
    assert 1.15 < margin.lower < margin.upper <= 1.48
    assert margin.proved


@pytest.mark.slow
def test_where_no_metric_is_proved_the_constant_one_stays_and_is_not_called_proved() -> None:
    """A damping so strong that the set all but degenerates: nothing is found there."""
    found = steering_margin(30.0, SPACING, V1)
    assert not found.proved
    assert settles(Disturbed(30.0, SPACING, SpeedRange(V1, V1), found.lower))


def test_below_its_own_edge_a_constant_metric_shrinks_all_distances() -> None:
    """The matrices of the quick test themselves, over the whole set."""
    system = Disturbed(MU1, SPACING, SpeedRange(V1, V1), 1.0085)
    assert settles(system)
    assert not settles(replace(system, D=1.01))
    inside = invariant_set(system)
    assert inside is not None
    random = np.random.default_rng(5)
    rho = random.uniform(inside.rho_min, inside.rho_max, 4000)
    lowest, highest = inside.span(rho)
    theta = np.concatenate([random.uniform(lowest, highest), lowest, highest]) - ABREAST_ALPHA1
    rho = np.tile(rho, 3)
    largest, smallest = (
        math.sqrt(choose(SPACING.f_prime(rho) / np.cos(theta))) for choose in (np.max, np.min)
    )
    damping = MU1 / V1
    kappa = 0.5 * (largest**2 - damping * largest + smallest**2 + damping * smallest)
    P = np.array([[kappa + 0.5 * damping**2, -0.5 * damping], [-0.5 * damping, 1.0]])
    assert np.all(np.linalg.eigvalsh(P) > 0.0)
    c, slope = np.cos(theta), SPACING.f_prime(rho)
    J = np.empty((len(rho), 2, 2))
    J[:, 0, 0], J[:, 0, 1], J[:, 1, 0], J[:, 1, 1] = 0.0, -V1 * c, V1 * slope, -MU1 * c
    Q = P @ J + np.swapaxes(J, 1, 2) @ P
    assert float(np.linalg.eigvalsh(Q).max()) < 0.0


@pytest.mark.parametrize("omega", [0.3, 1.13, 4.0])
@pytest.mark.parametrize("mean", [-0.4, 0.0, 0.4])
def test_below_the_bracket_periodic_steering_has_one_stable_orbit(
    margin: SteeringMargin, omega: float, mean: float
) -> None:
    k_u = 0.99 * margin.lower
    program = Sinusoid(V1, mean * k_u, (1.0 - abs(mean)) * k_u, omega)
    orbit = find_orbit(program, law, SPACING.rho_0)
    assert orbit is not None
    assert orbit.largest_multiplier < 1.0
    inside = invariant_set(Disturbed(MU1, SPACING, SpeedRange(V1, V1), k_u))
    assert inside is not None
    assert np.all(inside.contains(orbit.rho, orbit.alpha1, 1e-6))


def swinging(k_u: float) -> Table:
    """Holds one limit for long, then the other, joined by a short ramp: a piece of a periodic steering."""
    return Table((0.0, 30.0, 30.02, 60.0), (V1,) * 4, (k_u, k_u, -k_u, -k_u))


@pytest.mark.slow
def test_above_the_bracket_a_swing_loses_the_formation(margin: SteeringMargin) -> None:
    times = np.linspace(0.0, 40.0, 401)
    for share, lost in ((0.98, False), (1.03, True)):
        end = motion(swinging(share * margin.upper), (SPACING.rho_0, ABREAST_ALPHA1), times)
        swing = np.abs(end[:, 1] - ABREAST_ALPHA1).max()
        assert bool(swing > math.pi) is lost, share


def test_what_is_proved_is_proved_below_too(margin: SteeringMargin) -> None:
    assert settles_in_proof(MU1, SPACING, V1, margin.lower)
    assert settles_in_proof(MU1, SPACING, V1, 0.7)
    assert not settles_in_proof(MU1, SPACING, V1, 1.199), "the set is kept there, but no metric is found"
    assert not settles_in_proof(MU1, SPACING, V1, 1.21)


def test_more_gain_never_narrows_the_proof() -> None:
    lowers = [steering_margin(mu1, SPACING, V1).lower for mu1 in (0.75, 1.5, 3.0)]
    assert lowers == sorted(lowers)
    assert steering_margin(30.0, SPACING, V1).upper <= SPACING.mu_rho * V1 * (1.0 + 1e-9)


def test_no_gain_holds_a_leader_that_turns_harder_than_mu_rho_v1() -> None:
    """What mu1 wins for k_u* is capped by the spacing, whose pull ends at mu_rho."""
    spacing = Spacing(0.2, 20.0)
    uppers = [steering_margin(mu1, spacing, 0.08).upper for mu1 in (1.5, 3.0, 20.0)]
    assert uppers[0] < uppers[1] <= uppers[2] <= 1.6 + 1e-3
