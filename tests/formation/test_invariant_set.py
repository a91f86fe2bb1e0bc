from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formation.closed_loop import integrate
from formation.invariant_set import Disturbed, InvariantSet, invariant_set
from formation.pose import Motion
from formation.shape import ABREAST_ALPHA1
from formation.spacing import Spacing
from formation.speed_range import SpeedRange
from tests.formation.shape_rates import reduced_rates

TURTLEBOT3 = Disturbed(1.5, Spacing(0.2, 20.0), SpeedRange(0.08, 0.08), 0.7)
FIG2 = Disturbed(1.0, Spacing(0.5, 2.0), SpeedRange(0.5, 0.5), 0.7)
ANY_SPEED = Disturbed(1.5, Spacing(0.2, 20.0), SpeedRange(0.07, 0.09), 0.7)


def found(system: Disturbed) -> InvariantSet:
    result = invariant_set(system)
    assert result is not None
    return result


def rates(system: Disturbed, rho: float, alpha1: float, v1: float, d: float) -> tuple[float, float]:
    """Reduced dynamics under law (8), written out from the paper."""
    spacing = system.spacing
    v2 = -v1 * math.sin(alpha1) + rho * (-system.mu1 * math.cos(alpha1) + v1 * spacing.f(rho))
    return reduced_rates(rho, alpha1, Motion(v1, -d), v2)


def test_the_robot_experiment_keeps_its_distance() -> None:
    inside = found(TURTLEBOT3)
    assert inside.rho_min == pytest.approx(0.157, abs=1e-3)
    assert inside.rho_max == pytest.approx(0.267, abs=1e-3)


@pytest.mark.parametrize("system", [TURTLEBOT3, FIG2], ids=["turtlebot3", "fig2"])
def test_the_boundary_is_the_cycle_of_the_worst_disturbance(system: Disturbed) -> None:
    """Against an independent integrator in time, from the equilibrium until it repeats."""

    def worst(_t: float, state: np.ndarray) -> tuple[float, ...]:
        d = system.D * math.copysign(1.0, math.cos(float(state[1])))
        return rates(system, float(state[0]), float(state[1]), system.speeds.lowest, d)

    times = np.linspace(0.0, 60.0, 6_001)
    first = np.array([system.spacing.rho_0, ABREAST_ALPHA1 + 1e-9])
    last = integrate(worst, first, times, 0.05)[4_000:]
    inside = found(system)
    assert last.min(axis=0) == pytest.approx([inside.rho_min, inside.alpha1_min], abs=2e-5)
    assert last.max(axis=0) == pytest.approx([inside.rho_max, inside.alpha1_max], abs=2e-5)


@pytest.mark.parametrize("system", [TURTLEBOT3, FIG2, ANY_SPEED], ids=["turtlebot3", "fig2", "any speed"])
def test_no_allowed_motion_points_out_of_the_set(system: Disturbed) -> None:
    inside, random = found(system), np.random.default_rng(2)
    for (curve_rho, curve_psi), side in ((inside.inward, 1.0), (inside.outward, -1.0)):
        for k in random.integers(1, len(curve_rho) - 2, 300).tolist():
            rho, psi = float(curve_rho[k]), float(curve_psi[k])
            along = np.array(
                [curve_rho[k + 1] - curve_rho[k - 1], side * (curve_psi[k + 1] - curve_psi[k - 1])]
            )
            outward = np.array([-side * along[1], side * along[0]]) / np.linalg.norm(along)
            for d in (-system.D, system.D, random.uniform(-system.D, system.D)):
                for v1 in (system.speeds.lowest, system.speeds.highest):
                    move = rates(system, rho, ABREAST_ALPHA1 + side * psi, v1, d)
                    assert outward @ move <= 2e-2 * float(np.linalg.norm(move))


@settings(max_examples=25, deadline=None)
@given(bound=st.floats(0.01, 0.7), share=st.floats(0.1, 0.95))
def test_a_weaker_disturbance_has_a_smaller_set_inside_the_larger(bound: float, share: float) -> None:
    large, small = found(replace(TURTLEBOT3, D=bound)), found(replace(TURTLEBOT3, D=share * bound))
    assert large.rho_min < small.rho_min < 0.2 < small.rho_max < large.rho_max
    for (rho, psi), side in ((small.inward, 1.0), (small.outward, -1.0)):
        assert np.all(large.contains(rho, ABREAST_ALPHA1 + side * psi, 1e-6))


def test_an_uncertain_speed_makes_the_set_larger() -> None:
    certain, uncertain = found(TURTLEBOT3), found(ANY_SPEED)
    assert uncertain.rho_min < certain.rho_min
    assert certain.rho_max < uncertain.rho_max


@pytest.mark.parametrize("bound", [1.25, 1.6, 3.0])
def test_nothing_holds_a_leader_that_turns_too_hard(bound: float) -> None:
    assert invariant_set(replace(TURTLEBOT3, D=bound)) is None


def test_contains_tells_inside_from_outside() -> None:
    inside = found(TURTLEBOT3)
    rho = np.array([0.2, 0.2, 0.2, 0.3, 0.26, 0.2])
    alpha1 = ABREAST_ALPHA1 + np.array([0.0, 0.65, 0.9, 0.0, 0.6, 2.0 * math.pi])
    assert inside.contains(rho, alpha1).tolist() == [True, True, False, False, False, True]


@pytest.mark.parametrize("speeds", [(0.0, 0.1), (0.2, 0.1), (0.1, math.inf), (math.nan, 0.1)])
def test_speeds_that_make_no_sense_are_refused(speeds: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="expected 0 < lowest <= highest"):
        SpeedRange(*speeds)
