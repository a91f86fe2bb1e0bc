from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

from controllers.attraction import settling_map
from controllers.gain_design import PHASE_MARGIN, design
from controllers.gain_task import Task
from controllers.laws import Gains
from controllers.limits import Limits
from formation.invariant_set import Disturbed, invariant_set
from formation.spacing import Spacing
from formation.speed_range import SpeedRange

TASK = Task(
    rho_0=0.2,
    limits=Limits(0.22, 2.84),
    speeds=SpeedRange(0.08, 0.08),
    k_u=0.7,
    delay=0.13,
    sd_v1=0.002,
    sd_alpha1=0.02,
    sd_rho=0.0004,
    sd_alpha2=0.004,
    M_alpha2=0.13,
)
LATE = replace(TASK, delay=0.9)


def gains(task: Task) -> tuple[float, float, float]:
    found = design(task)
    assert found.gains is not None, found.why
    return found.gains


@pytest.mark.parametrize(
    "task", [TASK, LATE, replace(TASK, speeds=SpeedRange(0.07, 0.09)), replace(TASK, band=0.3)]
)
def test_the_proposed_gains_do_what_is_asked(task: Task) -> None:
    mu1, mu2, mu_rho = gains(task)
    found = design(task)
    for name, value in (("mu1", mu1), ("mu2", mu2), ("mu_rho", mu_rho)):
        bound = found.bounds[name]
        assert bound.least <= value * (1.0 + 1e-12)
        assert value <= bound.most * (1.0 + 1e-12)
    kept = invariant_set(Disturbed(mu1, Spacing(task.rho_0, mu_rho), task.speeds, task.k_u))
    assert kept is not None
    assert (1.0 - task.band) * task.rho_0 <= kept.rho_min < kept.rho_max <= (1.0 + task.band) * task.rho_0
    assert found.phase_margin >= PHASE_MARGIN - 1e-9


@pytest.mark.parametrize("limits", [TASK.limits, Limits(0.6, 6.0)])
def test_pairs_come_together_from_afar_and_would_not_with_a_harder_pull(limits: Limits) -> None:
    mu1, mu2, mu_rho = gains(replace(TASK, limits=limits))
    rho, alpha1 = TASK.rho_0 * np.array([2.0, 5.0, 25.0]), np.linspace(-2.6, 3.1, 6)

    def settled(pull: float) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        with_gains = Gains(mu1, mu2, Spacing(TASK.rho_0, pull * mu_rho))
        found = settling_map(with_gains, limits, 0.08, rho, alpha1, 0.5 * math.pi, 300.0)
        return np.isfinite(found.settled_s)

    assert np.all(settled(1.0))
    assert not np.any(settled(1.4)[1:])


def test_where_only_a_hard_pull_keeps_the_formation_it_is_noted() -> None:
    found = design(replace(TASK, speeds=SpeedRange(0.06, 0.09), band=0.25))
    assert found.gains is not None, found.why
    assert found.note is not None
    assert "start near the formation" in found.note


def test_with_the_delay_of_the_margin_the_loop_swings_for_ever() -> None:
    """At the edge of stability the characteristic equation has an imaginary root."""
    mu1, _, mu_rho = gains(TASK)
    margin, v = design(TASK).delay_margin, TASK.speeds.highest
    square = 2.0 * mu_rho * v * v / TASK.rho_0
    # The root is where the loop's gain is 1; found here by bisection, not by the formula.
    low, high = 0.0, 100.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if abs(complex(square, mu1 * middle)) > middle**2 else (low, middle)
    s = 1j * low
    assert abs(s * s + (mu1 * s + square) * cmath.exp(-s * margin)) < 1e-9


def test_delay_and_noise_lower_the_gains() -> None:
    for worse in (LATE, replace(TASK, sd_alpha1=0.14), replace(TASK, sd_rho=0.01)):
        assert gains(worse)[0] < gains(TASK)[0]
        assert gains(worse)[2] < gains(TASK)[2]
    assert gains(replace(TASK, M_alpha2=0.8))[1] > gains(TASK)[1]


@pytest.mark.parametrize(
    ("task", "why"),
    [
        (replace(TASK, limits=Limits(0.08, 2.84)), "fall behind"),
        (replace(TASK, limits=Limits(0.22, 0.7)), "the follower at most 0.7"),
        (replace(TASK, k_u=1.0), "tightest circle, 0.08 m"),
        (replace(TASK, delay=2.0), "phase margin of 45 deg with the 400 ms"),
        (replace(TASK, sd_alpha1=0.3), "noise in v2"),
        (replace(TASK, sd_v1=0.1), "noise in v2"),
        (replace(TASK, sd_alpha2=1.0), "noise in u2"),
        (
            replace(TASK, speeds=SpeedRange(0.001, 0.15), rho_0=0.1),
            "whatever a leader within 0.7 rad/s steers",
        ),
    ],
)
def test_where_nothing_works_it_is_said_why(task: Task, why: str) -> None:
    found = design(task)
    assert found.gains is None
    assert found.why is not None
    assert why in found.why


def test_a_leader_that_is_too_fast_in_lasting_turns_is_noted() -> None:
    assert design(TASK).note is None
    noted = design(replace(TASK, speeds=SpeedRange(0.08, 0.1))).note
    assert noted is not None
    assert "lasting turns of up to 0.6 rad/s" in noted


def test_a_leader_that_hardly_turns_still_gives_a_pair_that_closes_in() -> None:
    mu1, _, mu_rho = gains(replace(TASK, k_u=1e-3))
    assert "closes in" in design(replace(TASK, k_u=1e-3)).bounds["mu_rho"].why_least
    assert mu_rho * TASK.rho_0 > 0.3
    assert math.isfinite(mu1)


@pytest.mark.parametrize(
    "task",
    [replace(TASK, sd_alpha1=0.14), replace(TASK, sd_rho=0.01), replace(TASK, sd_alpha1=0.08, sd_rho=0.006)],
)
def test_noise_in_the_speed_fills_what_the_limit_leaves_where_it_ends_the_gains(task: Task) -> None:
    """By the errors of law (8) near the formation: of v1, of alpha1 by rho_0 mu1, of rho by v1 2 mu_rho."""
    bounds = design(task).bounds
    assert "noise in v2" in bounds["mu1"].why_most
    mu1, growth = bounds["mu1"].most, bounds["mu1"].most / bounds["mu1"].least
    mu_rho = growth**2 * bounds["mu_rho"].least
    by_angle, by_distance = 0.2 * mu1 * task.sd_alpha1, 2.0 * 0.08 * mu_rho * task.sd_rho
    noise = math.sqrt(task.sd_v1**2 + by_angle**2 + by_distance**2)
    assert 3.0 * noise == pytest.approx(0.22 - 0.08, rel=1e-9)


def test_noise_in_the_turn_rate_fills_what_the_limit_leaves_or_delay_ends_mu2_first() -> None:
    loud = design(replace(TASK, sd_alpha2=0.1)).bounds
    assert "noise in u2" in loud["mu2"].why_most
    assert 3.0 * (0.1 * loud["mu2"].most + 0.02 * loud["mu1"].least) == pytest.approx(2.84 - 0.7)
    late = design(LATE).bounds["mu2"]
    assert "phase margin" in late.why_most
    # A loop mu2 / s with the delay that is left keeps 45 degrees.
    assert 0.5 * math.pi - late.most * 0.2 * 0.9 == pytest.approx(PHASE_MARGIN)
    assert design(replace(TASK, delay=0.0, sd_alpha2=0.0)).bounds["mu2"].most == math.inf


def test_the_phase_margin_ends_the_gains_where_the_delay_does() -> None:
    bounds = design(replace(TASK, delay=0.8, limits=Limits(0.6, 6.0))).bounds
    assert "phase margin" in bounds["mu1"].why_most
    growth = bounds["mu1"].most / bounds["mu1"].least
    mu1, mu_rho = bounds["mu1"].most, growth**2 * bounds["mu_rho"].least
    square = 2.0 * mu_rho * 0.08**2 / 0.2
    # Where the open loop (mu1 s + w^2) / s^2 has the gain 1, at its least; both grow as the docs say.
    roots = np.roots([1.0, 0.0, -((mu1 / growth) ** 2), 0.0, -((square / growth**2) ** 2)])
    crossover = max(root.real for root in roots)
    phase = cmath.phase(complex(square / growth**2, mu1 / growth * crossover))
    assert phase - growth * crossover * 0.2 * 0.8 == pytest.approx(PHASE_MARGIN, rel=1e-6)


def test_alpha1_half_a_radian_off_calls_for_no_more_than_the_speed_limit() -> None:
    bound = design(replace(TASK, delay=0.0)).bounds["mu1"]
    assert "alpha1 0.5 rad off" in bound.why_most
    assert 0.5 * 0.2 * bound.most == pytest.approx(0.22)
