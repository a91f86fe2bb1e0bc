from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from formation.error_set import ErrorSet, error_set
from formation.error_set_kernels import ErrorModel, Half, largest_push, push_at, worst_outward
from formation.invariant_set import Disturbed, invariant_set
from formation.kernel import interpreted
from formation.pose import Motion
from formation.shape import ABREAST_ALPHA1
from formation.spacing import Spacing
from formation.speed_range import SpeedRange
from tests.bits import same_bits
from tests.formation.shape_rates import reduced_rates

SPACING = Spacing(0.2, 20.0)
TURTLEBOT3 = ErrorModel(1.5, 0.2, 20.0, 0.08, 0.7, 0.0205)


def found(model: ErrorModel) -> ErrorSet:
    result = error_set(model)
    assert result is not None
    return result


def rates(rho: float, alpha1: float, error: complex, u1: float) -> tuple[float, float]:
    """The paper's (5) under law (8) on a wrong velocity, written out: complex numbers along the line."""
    model, velocity = TURTLEBOT3, TURTLEBOT3.v1 * np.exp(1j * alpha1)
    seen = velocity + error
    v1, angle = abs(seen), float(np.angle(seen))
    asked = -v1 * math.sin(angle) + rho * (-model.mu1 * math.cos(angle) + v1 * SPACING.f(rho))
    return reduced_rates(rho, alpha1, Motion(model.v1, u1), asked)


def test_the_robot_experiment_with_wrong_estimates_keeps_its_distance() -> None:
    held = found(TURTLEBOT3)
    assert held.inward > 0.0
    assert 0.11 <= held.inside.rho_min < held.inside.rho_max <= 0.45


@pytest.mark.parametrize("error", [0.01, 0.018])
def test_the_worst_motion_by_another_integrator_comes_near_the_edge_from_within(error: float) -> None:
    """scipy on the rates of the paper, the worst of a fine grid of errors taken at every moment."""
    model = TURTLEBOT3._replace(W=error)
    rim = error * np.exp(2j * math.pi * np.arange(720) / 720)

    def worst(_t: float, state: np.ndarray) -> list[float]:
        rho, theta = float(state[0]), float(state[1])
        seen = model.v1 * np.exp(1j * (theta - 0.5 * math.pi)) + rim
        pulls = -rim.imag / rho - model.mu1 * seen.real / np.abs(seen) + np.abs(seen) * SPACING.f(rho)
        push = np.max(pulls) + model.k_u if theta >= 0.0 else np.min(pulls) - model.k_u
        return [-model.v1 * math.sin(theta), float(push)]

    # It creeps into a corner of the set far out, and goes on from there when the worst changes sides.
    first = solve_ivp(worst, (0.0, 40.0), [0.2, 1e-6], max_step=0.02, rtol=1e-6).y
    second = solve_ivp(worst, (0.0, 20.0), [first[0].max(), 1e-3], max_step=0.02, rtol=1e-6).y
    inside = found(model).inside
    rho, theta = np.concatenate([first, second], axis=1)
    assert np.all(inside.contains(rho, theta + ABREAST_ALPHA1, 1e-6))
    assert rho.min() < inside.rho_min + 0.002
    assert rho.max() > inside.rho_max - 0.005
    assert theta.max() > inside.alpha1_max - ABREAST_ALPHA1 - 0.2


def test_no_admitted_motion_points_out_of_the_polygon() -> None:
    """Drawn errors, whole disc and rim, at drawn places of the boundary's pieces."""
    inside, random = found(TURTLEBOT3).inside, np.random.default_rng(3)
    for (curve_rho, curve_psi), side in ((inside.inward, 1.0), (inside.outward, -1.0)):
        for k in random.integers(1, len(curve_rho) - 2, 400).tolist():
            ends = np.array([[curve_rho[k + j], side * curve_psi[k + j]] for j in (0, 1)])
            rho, theta = ends[0] + random.random() * (ends[1] - ends[0])
            along = ends[1] - ends[0]
            outward = np.array([-side * along[1], side * along[0]]) / np.linalg.norm(along)
            for u1 in (-0.7, 0.7, random.uniform(-0.7, 0.7)):
                error = (
                    0.0205 * random.choice([1.0, random.random()]) * np.exp(2j * math.pi * random.random())
                )
                assert outward @ rates(rho, theta + ABREAST_ALPHA1, error, u1) < 1e-9


@settings(deadline=None, max_examples=60)
@given(st.floats(0.1, 0.6), st.floats(0.0, 3.1), st.sampled_from([-1.0, 1.0]), st.floats(1e-4, 0.06))
def test_the_push_is_bounded_from_above_and_closely(
    rho: float, psi: float, side: float, error: float
) -> None:
    model = TURTLEBOT3._replace(W=error)
    circle = error * np.exp(2j * math.pi * np.arange(3000) / 3000)
    rim = np.concatenate([0.5 * circle, circle])
    seen = model.v1 * np.exp(1j * (side * psi - 0.5 * math.pi)) + rim
    pulls = -rim.imag / rho - model.mu1 * seen.real / np.abs(seen) + np.abs(seen) * SPACING.f(rho)
    brute = float(np.max(side * pulls)) + model.k_u
    bound = push_at(rho, psi, side, model)
    assert brute <= bound + 1e-12
    turned = error / (model.v1 - error)
    bend = error / rho + 1.5 * (turned + 3.0 * turned**2) + abs(SPACING.f(rho)) * turned * (0.08 + error)
    assert bound <= brute + 0.125 * (2.0 * math.pi / 480) ** 2 * bend + 1e-4


def test_the_bound_is_the_same_compiled_or_not() -> None:
    for rho, psi, side in ((0.12, 1.3, 1.0), (0.3, 0.2, -1.0), (0.43, 0.0, -1.0)):
        plain = interpreted(largest_push)(TURTLEBOT3, Half(side, rho, psi))
        same_bits(push_at(rho, psi, side, TURTLEBOT3), plain)


def test_without_error_it_is_the_invariant_set_of_exact_estimates() -> None:
    exact = invariant_set(Disturbed(1.5, SPACING, SpeedRange(0.08, 0.08), 0.7))
    assert exact is not None
    nearly = found(TURTLEBOT3._replace(W=1e-7)).inside
    assert nearly.rho_min == pytest.approx(exact.rho_min, abs=5e-4)
    assert nearly.rho_max == pytest.approx(exact.rho_max, abs=1e-3)
    assert nearly.rho_min < exact.rho_min < exact.rho_max < nearly.rho_max


def test_a_smaller_error_has_a_smaller_set_inside() -> None:
    large, small = found(TURTLEBOT3).inside, found(TURTLEBOT3._replace(W=0.015)).inside
    for (rho, psi), side in ((small.inward, 1.0), (small.outward, -1.0)):
        assert np.all(large.contains(rho, ABREAST_ALPHA1 + side * psi, 1e-9))


@pytest.mark.parametrize("change", [{"W": 0.0215}, {"W": 0.09}, {"k_u": 1.25}, {"W": 0.0206, "k_u": 0.75}])
def test_what_cannot_be_held_is_not_claimed(change: dict[str, float]) -> None:
    assert error_set(TURTLEBOT3._replace(**change)) is None


def test_a_boundary_that_is_drawn_in_is_refused() -> None:
    """The proof is of the boundary that it is given: one a thousandth too narrow does not pass."""
    inside = found(TURTLEBOT3).inside
    rho, psi = inside.outward
    spoilt = rho, np.ascontiguousarray(psi * (1.0 - 2e-3))
    assert worst_outward(np.ascontiguousarray(rho), psi, len(rho), -1.0, TURTLEBOT3) < 0.0
    assert worst_outward(*spoilt, len(rho), -1.0, TURTLEBOT3) > 0.0
