from __future__ import annotations

import math
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from estimation.bounds.assumptions import Assumptions
from estimation.bounds.bound_check import SpeedInputs, h_of
from estimation.bounds.certificate import certify
from estimation.bounds.window_difference import best_line
from formation.error_set_kernels import ErrorModel
from formation.invariant_set import Disturbed, InvariantSet, invariant_set
from formation.joint_set import Aside, joint_set
from formation.spacing import Spacing
from formation.speed_range import SpeedRange
from formation.station import Side
from formation.steering_margin import steering_margin

TURTLEBOT3 = Assumptions(
    eps=1.5e-3,
    step=1.0 / 120.0,
    v_eps=0.04,
    k_v=0.1,
    k_u=0.7,
    speeds=SpeedRange(0.08, 0.08),
    mu1=1.5,
    mu2=2.0,
    spacing=Spacing(0.2, 20.0),
    noise="5 sigma",
)


def test_the_chain_of_the_robot_experiment() -> None:
    found = certify(TURTLEBOT3)
    rate = 2.0 * math.sqrt(1.5e-3 * 0.07)
    assert found.velocity_error == pytest.approx(rate, rel=1e-3)
    assert found.rates.figures["M_rho"] == found.estimates.figures["M_v1"] == found.velocity_error
    nearest = found.formation.figures["rho_min"]
    assert nearest == pytest.approx(0.157, abs=1e-3)
    assert found.formation.figures["rho_max"] == pytest.approx(0.267, abs=1e-3)
    assert found.rates.figures["M_alpha2"] == pytest.approx(rate / nearest, rel=1e-3)
    assert found.estimates.figures["M_alpha1"] == pytest.approx(math.asin(rate / 0.04), rel=1e-3)
    assert found.alpha2_ultimate.figures["value"] == pytest.approx(math.asin(rate / nearest / 2.0), rel=1e-3)
    assert 0.80 <= found.k_u_star.figures["lower"] <= found.k_u_star.figures["upper"] <= 1.48


def test_every_claim_says_what_it_assumes_and_why_it_has_no_figures() -> None:
    for given in (TURTLEBOT3, replace(TURTLEBOT3, eps=0.1, k_u=3.0, speeds=SpeedRange(0.05, 0.1))):
        for name, claim in certify(given).claims().items():
            assert claim.assumes, name
            assert claim.figures or claim.why, name


@pytest.mark.parametrize(
    ("change", "claim", "word"),
    [
        ({"k_u": 1.7}, "formation", "constant turn"),
        ({"k_u": 1.3}, "formation", "saddle"),
        ({"eps": 0.5}, "alpha2_ultimate", "M_alpha2"),
        ({"eps": 6e-3}, "estimates", "v_eps"),
        ({"speeds": SpeedRange(0.06, 0.1)}, "k_u_star", "constant speed"),
        ({"eps": 1.6e-3}, "formation_with_errors", "worst belief"),
        ({"speeds": SpeedRange(0.079, 0.081)}, "formation_with_errors", "constant turn"),
        ({}, "formation_any_speed", "saddle"),
        ({}, "formation_with_alpha2", "up to 0.0152 m/s"),
        ({"mu2": 0.05}, "formation_with_alpha2", "computed, not proved"),
        ({"speeds": SpeedRange(0.079, 0.081)}, "formation_with_alpha2", "constant speed"),
        ({"unknown_steering": "other steering"}, "formation_with_alpha2", "other steering"),
    ],
)
def test_what_cannot_be_guaranteed_is_not(change: dict[str, Any], claim: str, word: str) -> None:
    found = certify(replace(TURTLEBOT3, **change)).claims()[claim]
    assert found.why is not None
    assert word in found.why
    assert not set(found.figures) - {"M_v1"}


def test_the_sound_bound_of_h_covers_every_velocity_error_within_the_set() -> None:
    """Wrong velocities by the guaranteed error, anywhere in the certified set, in any direction."""
    found, random = certify(TURTLEBOT3), np.random.default_rng(4)
    held = invariant_set(Disturbed(1.5, TURTLEBOT3.spacing, TURTLEBOT3.speeds, TURTLEBOT3.k_u))
    assert held is not None
    rho = random.uniform(held.rho_min, held.rho_max, 100_000)
    alpha1 = random.uniform(*held.span(rho))
    v1 = random.uniform(TURTLEBOT3.v_eps, TURTLEBOT3.k_v, len(rho))
    wrong = v1 * np.exp(1j * alpha1) + found.velocity_error * np.exp(
        1j * random.uniform(-math.pi, math.pi, len(rho))
    )
    truth, believed = SpeedInputs(rho, v1, alpha1), SpeedInputs(rho, np.abs(wrong), np.angle(wrong))
    spacing = TURTLEBOT3.spacing
    errors = np.abs(h_of(truth, believed, 1.5, spacing) - h_of(truth, truth, 1.5, spacing))
    assert float(errors.max()) <= found.h.figures["sound"]
    assert float(errors.max()) > 0.5 * found.h.figures["sound"]


def test_with_little_noise_the_formation_is_guaranteed_with_wrong_estimates_too() -> None:
    found = certify(replace(TURTLEBOT3, eps=5e-5))
    exact, wrong = found.formation.figures, found.formation_with_errors.figures
    assert wrong["rho_min"] < exact["rho_min"]
    assert exact["rho_max"] < wrong["rho_max"]


def test_sparser_measurements_guarantee_less() -> None:
    sparse = certify(replace(TURTLEBOT3, step=1.0))
    assert sparse.velocity_error > 1.5 * certify(TURTLEBOT3).velocity_error


QUIET = replace(TURTLEBOT3, eps=5e-5)
"""So little noise that the set holds with wrong estimates too."""

UNHELD = replace(TURTLEBOT3, k_u=1.7)
"""A leader that turns too hard for any set."""


def held_of(given: Assumptions, steered: float) -> InvariantSet:
    held = invariant_set(Disturbed(given.mu1, given.spacing, given.speeds, steered))
    assert held is not None
    return held


def largest_h(given: Assumptions, error: float, held: InvariantSet) -> tuple[float, float]:
    """Bounds of h, printed and sound, by hand: a dense maximum over believed states and directions."""
    off = math.asin(error / given.v_eps)
    ends = np.array([held.rho_min, held.rho_max])
    rho = np.unique(np.concatenate([ends, np.linspace(held.rho_min, held.rho_max, 101)]))
    lowest, highest = held.span(rho)
    shares = np.linspace(0.0, 1.0, 201)[:, np.newaxis]
    believed = (lowest - off) * (1.0 - shares) + (highest + off) * shares
    f = given.spacing.mu_rho * (1.0 - (given.spacing.rho_0 / rho) ** 2)
    turned = np.linspace(-off, off, 41)
    change = np.max([np.abs(np.cos(believed + each) - np.cos(believed)) for each in turned], axis=0)
    sound = error / rho + given.mu1 * change + np.abs(f) * error
    printed = error / rho + given.mu1 + f * math.sqrt(2.0) * error
    return float(printed.max()), float(sound.max())


@pytest.mark.parametrize("given", [TURTLEBOT3, QUIET, replace(TURTLEBOT3, k_u=0.3, mu1=0.8, v_eps=0.06)])
def test_the_bounds_of_h_are_the_dense_maximum_over_what_may_be_believed_in_the_set(
    given: Assumptions,
) -> None:
    found = certify(given)
    printed, sound = largest_h(given, found.velocity_error, held_of(given, given.k_u))
    assert found.h.figures["sound"] == pytest.approx(sound, rel=2e-3)
    assert found.h.figures["paper"] == pytest.approx(printed, rel=1e-9)
    assert "worst over the certified formation" in found.h.assumes


@pytest.mark.parametrize("given", [UNHELD, replace(TURTLEBOT3, unproved="a station not abreast")])
def test_without_a_set_the_bounds_of_h_are_a_sum_at_the_station(given: Assumptions) -> None:
    found = certify(given)
    error, rho_0 = found.velocity_error, given.spacing.rho_0
    half = 0.5 * math.asin(error / given.v_eps)
    # A sine changes most across zero: from half the possible error on one side to half on the other.
    assert found.h.figures["sound"] == pytest.approx(
        error / rho_0 + given.mu1 * 2.0 * math.sin(half), rel=1e-12
    )
    assert found.h.figures["paper"] == pytest.approx(error / rho_0 + given.mu1, rel=1e-12)
    assert found.rates.figures["M_alpha2"] == pytest.approx(error / rho_0, rel=1e-12)
    assert "desired distance" in found.rates.assumes[-1]
    assert "its station" in found.h.assumes[-1]


def test_a_velocity_error_that_reaches_the_least_speed_leaves_every_direction_possible() -> None:
    given = replace(UNHELD, v_eps=0.01)
    found = certify(given)
    error = found.velocity_error
    assert given.v_eps < error
    assert found.h.figures["sound"] == pytest.approx(error / 0.2 + 2.0 * given.mu1, rel=1e-9)
    assert found.estimates.figures == {"M_v1": error}
    exactly = replace(given, v_eps=error)
    assert certify(exactly).estimates.figures == {"M_v1": error}
    assert certify(exactly).h.figures["sound"] == found.h.figures["sound"]
    barely = certify(replace(given, v_eps=error * (1.0 + 1e-9))).estimates.figures
    assert barely["M_alpha1"] == pytest.approx(0.5 * math.pi, abs=1e-4)


def test_the_rates_are_a_sum_done_by_hand() -> None:
    figures = certify(TURTLEBOT3).rates.figures
    error = TURTLEBOT3.velocity_error
    assert figures == {
        "M_rho": error,
        "M_alpha2": pytest.approx(error / held_of(TURTLEBOT3, 0.7).rho_min, rel=1e-12),
        "closed_form": pytest.approx(2.0 * math.sqrt(1.5e-3 * 0.1 * 0.7), rel=1e-12),
        "eps": 1.5e-3,
        "acceleration": pytest.approx(0.1 * 0.7, rel=1e-12),
    }
    assert "certified formation" in certify(TURTLEBOT3).rates.assumes[-1]


def test_the_set_with_errors_of_the_robot_experiment_is_proved() -> None:
    claim = certify(TURTLEBOT3).formation_with_errors
    assert set(claim.figures) == {"rho_min", "rho_max", "alpha1_min", "alpha1_max", "W"}
    assert claim.figures["W"] == TURTLEBOT3.velocity_error
    assert 0.11 < claim.figures["rho_min"] < 0.1176
    assert 0.4353 < claim.figures["rho_max"] < 0.45
    assert any("along the whole boundary" in each for each in claim.assumes)
    assert any("not safety" in each and "0.178" in each for each in claim.assumes)


def test_alpha2_is_said_to_move_by_what_its_rate_errs() -> None:
    found = certify(TURTLEBOT3).formation_with_errors
    rate = TURTLEBOT3.velocity_error / found.figures["rho_min"]
    assert f"within {math.asin(rate / TURTLEBOT3.mu2):.3g} rad" in found.assumes[-1]
    weak = certify(replace(TURTLEBOT3, mu2=0.9 * rate)).formation_with_errors
    assert "does not outweigh" in weak.assumes[-1]


VARYING = replace(QUIET, speeds=SpeedRange(0.0795, 0.0805))
"""A leader whose speed is not quite constant: for it the set goes by the bound of h."""


def test_at_varying_speed_the_set_with_errors_is_the_one_whose_errors_enlarge_it_to_itself() -> None:
    found = certify(VARYING)
    steered = VARYING.k_u
    for _ in range(15):
        steered = VARYING.k_u + largest_h(VARYING, found.velocity_error, held_of(VARYING, steered))[1]
    figures, held = found.formation_with_errors.figures, held_of(VARYING, steered)
    assert figures["rho_min"] == pytest.approx(held.rho_min, rel=1e-3)
    assert figures["rho_max"] == pytest.approx(held.rho_max, rel=1e-3)
    assert figures["alpha1_min"] == pytest.approx(held.alpha1_min, rel=1e-3)
    assert figures["alpha1_max"] == pytest.approx(held.alpha1_max, rel=1e-3)
    # What is printed is closed in itself: no steering is left in it that it was not made for.
    said = float(found.formation_with_errors.assumes[2].rpartition(", ")[2].removesuffix(" rad/s"))
    assert said == pytest.approx(steered - VARYING.k_u, rel=1e-2)
    # One error in all terms at once is worth a smaller set than the sum of their bounds.
    joint = certify(QUIET).formation_with_errors.figures
    assert figures["rho_min"] < joint["rho_min"] < joint["rho_max"] < figures["rho_max"]


def mirrored(figures: dict[str, float]) -> dict[str, float]:
    low, high = figures["alpha1_min"], figures["alpha1_max"]
    return figures | {"alpha1_min": -high, "alpha1_max": -low}


def test_on_the_left_the_formation_is_the_mirror_image() -> None:
    right, left = certify(QUIET), certify(replace(QUIET, side=Side.LEFT))
    held = held_of(QUIET, QUIET.k_u)
    assert right.formation.figures == {
        "rho_min": held.rho_min,
        "rho_max": held.rho_max,
        "alpha1_min": held.alpha1_min,
        "alpha1_max": held.alpha1_max,
    }
    for name in ("formation", "formation_with_errors"):
        assert left.claims()[name].figures == mirrored(right.claims()[name].figures)
    assert (left.h, left.rates) == (right.h, right.rates)


def test_the_set_with_alpha2_is_that_of_its_model_and_wider_than_without() -> None:
    given = replace(TURTLEBOT3, eps=4e-4)
    found = certify(given)
    model = ErrorModel(1.5, 0.2, 20.0, 0.08, 0.7, found.velocity_error)
    joint = joint_set(model, Aside(2.0))
    assert joint is not None
    figures, still = found.formation_with_alpha2.figures, found.formation_with_errors.figures
    assert figures == {
        "rho_min": joint.rho_min,
        "rho_max": joint.rho_max,
        "alpha1_min": joint.alpha1_min,
        "alpha1_max": joint.alpha1_max,
        "alpha2_within": joint.alpha2_within,
        "W": found.velocity_error,
    }
    assert figures["rho_min"] < still["rho_min"] < still["rho_max"] < figures["rho_max"]
    assumes = found.formation_with_alpha2.assumes
    assert assumes[3] == "the whole system (3) under laws (4) and (8), without limits or lag"
    assert f"within {joint.alpha2_within:.3g} rad" in assumes[-1]
    left = certify(replace(given, side=Side.LEFT)).formation_with_alpha2
    assert left.figures == mirrored(figures)


def test_where_noise_averages_out_the_robot_experiment_keeps_all_three() -> None:
    """What no set is known for if noise leans to one side for ever."""
    found = certify(TURTLEBOT3)
    figures = found.formation_independent_noise.figures
    joint = joint_set(ErrorModel(1.5, 0.2, 20.0, 0.08, 0.7, figures["W"]), Aside(2.0))
    assert joint is not None
    assert (figures["rho_min"], figures["alpha2_within"]) == (joint.rho_min, joint.alpha2_within)
    assert figures["W"] == best_line(1.5e-3, 0.07, 1.0 / 120.0).error < 0.6 * found.velocity_error
    assert "independent" in found.formation_independent_noise.assumes[-1]
    exact = found.formation.figures
    assert 0.12 < figures["rho_min"] < exact["rho_min"] < exact["rho_max"] < figures["rho_max"] < 0.4
    assert certify(replace(TURTLEBOT3, eps=5e-3)).formation_independent_noise.figures == {}


def test_any_speed_means_every_speed_that_the_leader_may_drive() -> None:
    given = replace(TURTLEBOT3, k_u=0.3)
    anywhere = certify(replace(given, speeds=SpeedRange(given.v_eps, given.k_v)))
    assert certify(given).formation_any_speed.figures == anywhere.formation.figures != {}
    assert "anywhere between 0.04 and 0.1" in certify(given).formation_any_speed.assumes[1]
    assert "constant" in certify(given).formation.assumes[1]


def test_the_margin_of_steering_is_that_of_a_constant_speed() -> None:
    margin = steering_margin(1.5, TURTLEBOT3.spacing, 0.08)
    assert certify(TURTLEBOT3).k_u_star.figures == {"lower": margin.lower, "upper": margin.upper}


def test_where_the_theory_does_not_speak_nothing_is_said_of_the_formation() -> None:
    found = certify(replace(QUIET, unproved="a station not abreast"))
    names = (
        "formation",
        "formation_any_speed",
        "formation_with_errors",
        "formation_with_alpha2",
        "formation_independent_noise",
        "k_u_star",
    )
    for name in names:
        assert (found.claims()[name].figures, found.claims()[name].why) == ({}, "a station not abreast")
    assert list(found.claims()) == ["rates", "estimates", "h", "alpha2_ultimate", *names]


def test_steering_that_noise_may_outweigh_has_no_ultimate_bound() -> None:
    M_alpha2 = certify(TURTLEBOT3).rates.figures["M_alpha2"]
    assert certify(replace(TURTLEBOT3, mu2=M_alpha2)).alpha2_ultimate.figures == {}
    just = certify(replace(TURTLEBOT3, mu2=M_alpha2 * (1.0 + 1e-9))).alpha2_ultimate.figures
    assert just["value"] == pytest.approx(0.5 * math.pi, abs=1e-4)


def test_a_turn_that_no_distance_balances_is_told_from_a_saddle() -> None:
    reach = TURTLEBOT3.spacing.mu_rho * 0.08
    balanced = certify(replace(TURTLEBOT3, k_u=math.nextafter(reach, 0.0))).formation.why
    assert "saddle" in str(balanced)
    assert "constant turn" in str(certify(replace(TURTLEBOT3, k_u=reach)).formation.why)


def test_a_set_that_keeps_growing_is_not_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[certify.__module__], "_ROUNDS", 1)
    found = certify(replace(VARYING, noise="in other words")).formation_with_errors
    assert found.figures == {}
    assert found.assumes == ("estimates as wrong as the sound bound of h allows",)
    assert "keep enlarging each other" in str(found.why)
