from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from estimation.bounds.bound_check import SpeedInputs, h_of
from estimation.bounds.certificate import certify
from estimation.bounds.premises import Premises
from formation.invariant_set import Disturbed, invariant_set
from formation.spacing import Spacing
from formation.speed_range import SpeedRange

TURTLEBOT3 = Premises(
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
        ({}, "formation_with_errors", "constant turn"),
        ({}, "formation_any_speed", "saddle"),
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
