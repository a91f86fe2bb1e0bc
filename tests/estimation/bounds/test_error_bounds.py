from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.bounds.error_bounds import (
    InputErrors,
    Perceived,
    RateErrors,
    extended_alpha1,
    extended_h,
    extended_v1,
    paper_alpha1,
    paper_h,
    sound_alpha1,
    sound_h,
    sound_v1,
)
from estimation.bounds.live_bounds import cosine_change
from formation.pose import Motion
from formation.shape import leader_velocity, polar_velocity
from formation.spacing import Spacing

TURTLEBOT3 = Spacing(rho_0=0.2, mu_rho=20.0)
MU1 = 1.5
V_EPS = 0.04

angles = st.floats(-math.pi, math.pi)
sizes = st.floats(0.0, 0.5)
moments = st.builds(
    Perceived.from_rates,
    rho=st.floats(0.05, 2.0),
    alpha2=angles,
    rho_dot=st.floats(-0.5, 0.5),
    alpha2_dot=st.floats(-2.0, 2.0),
    v2=st.floats(-0.5, 0.5),
    u2=st.floats(-2.0, 2.0),
)
rate_errors = st.builds(RateErrors, sizes, sizes)
input_errors = st.builds(InputErrors, st.floats(0.0, 0.04), sizes, sizes, sizes)


def moment(**changes: float) -> Perceived:
    abreast = Perceived(2.0, math.pi / 2, 0.0, 0.0, 1.0, -math.pi / 2, 0.5, 0.1)
    return replace(abreast, **changes)


def extended(perceived: Perceived, rates: RateErrors, inputs: InputErrors) -> dict[str, np.ndarray]:
    return {
        "v1": extended_v1(perceived, rates, inputs),
        "alpha1": extended_alpha1(perceived, rates, inputs, V_EPS),
        "h": extended_h(perceived, rates, inputs, V_EPS, MU1, TURTLEBOT3),
    }


def sound(perceived: Perceived, rates: RateErrors) -> dict[str, float]:
    """By the formulas of the docstrings, written apart from the package."""
    v1 = math.hypot(float(rates.M_rho), float(perceived.rho) * float(rates.M_alpha2))
    longest = max(float(perceived.v1), V_EPS)
    alpha1 = math.asin(v1 / longest) if v1 < longest else math.pi
    middle = float(perceived.alpha1)
    inner = [k * math.pi for k in range(-3, 4) if abs(k * math.pi - middle) <= alpha1]
    ends = [middle - alpha1, middle + alpha1, *inner]
    change = max(abs(math.cos(x) - math.cos(middle)) for x in ends)
    f = 20.0 * (1.0 - 0.04 / float(perceived.rho) ** 2)
    return {"v1": v1, "alpha1": alpha1, "h": float(rates.M_alpha2) + MU1 * change + abs(f) * v1}


def sound_form(perceived: Perceived, rates: RateErrors) -> dict[str, np.ndarray]:
    return {
        "v1": sound_v1(perceived, rates),
        "alpha1": sound_alpha1(perceived, rates, V_EPS),
        "h": sound_h(perceived, rates, V_EPS, MU1, TURTLEBOT3),
    }


def test_known_values_of_the_sound_form() -> None:
    rates = RateErrors(M_rho=0.3, M_alpha2=0.2)
    assert sound_v1(moment(), rates) == pytest.approx(0.5)
    assert sound_alpha1(moment(), rates, V_EPS) == pytest.approx(math.pi / 6)
    assert sound_alpha1(moment(v1=0.01), rates, 1.0) == pytest.approx(math.pi / 6)
    # At alpha1 = -pi/2 the cosine changes by sin(pi/6), and f(2) = 20 (1 - 0.01).
    assert sound_h(moment(), rates, V_EPS, MU1, TURTLEBOT3) == pytest.approx(0.2 + 0.5 * MU1 + 19.8 * 0.5)


def test_the_paper_is_kept_as_printed() -> None:
    rates = RateErrors(M_rho=0.3, M_alpha2=0.2)
    assert paper_alpha1(moment(), rates, 0.8) == pytest.approx(0.625)
    assert paper_alpha1(moment(), rates, 0.0) == math.inf
    assert paper_h(moment(), rates, MU1, TURTLEBOT3) == pytest.approx(0.2 + MU1 + 19.8 * 0.5)
    # f(0.1) = -60: the printed bound falls below zero when the follower is too close.
    assert paper_h(moment(rho=0.1), rates, MU1, TURTLEBOT3) < 0.0


@pytest.mark.parametrize("v1", [0.0, 0.3, 0.5])
def test_any_direction_is_possible_once_the_error_reaches_the_speed(v1: float) -> None:
    rates = RateErrors(M_rho=0.5, M_alpha2=0.0)
    assert sound_alpha1(moment(v1=v1), rates, 0.5) == math.pi
    assert extended_alpha1(moment(v1=v1), rates, InputErrors(), 0.5) == math.pi


@pytest.mark.parametrize("direction", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("rates", "inputs"),
    [
        (RateErrors(0.05, 0.0), InputErrors()),
        (RateErrors(0.0, 0.05), InputErrors()),
        (RateErrors(0.0, 0.0), InputErrors(E_rho=0.1)),
        (RateErrors(0.0, 0.0), InputErrors(E_alpha2=0.2)),
        (RateErrors(0.0, 0.0), InputErrors(E_v2=0.1)),
        (RateErrors(0.0, 0.0), InputErrors(E_u2=0.3)),
    ],
)
def test_each_error_alone_moves_the_velocity_by_exactly_the_bound(
    rates: RateErrors, inputs: InputErrors, direction: float
) -> None:
    believed = Perceived.from_rates(0.6, 1.2, 0.02, 0.3, 0.15, 0.4)
    x, y = leader_velocity(
        0.6 + direction * float(inputs.E_rho),
        1.2 + direction * float(inputs.E_alpha2),
        0.02 + direction * float(rates.M_rho),
        0.3 + direction * float(rates.M_alpha2),
        Motion(0.15 + direction * float(inputs.E_v2), 0.4 + direction * float(inputs.E_u2)),
    )
    believed_x, believed_y = leader_velocity(0.6, 1.2, 0.02, 0.3, Motion(0.15, 0.4))
    moved = math.hypot(x - believed_x, y - believed_y)
    assert moved == pytest.approx(float(extended_v1(believed, rates, inputs)), rel=1e-12)


def test_from_rates_is_the_estimate_of_the_appendix() -> None:
    believed = Perceived.from_rates(0.6, 1.2, 0.02, 0.3, 0.15, 0.4)
    v1, alpha1 = polar_velocity(*leader_velocity(0.6, 1.2, 0.02, 0.3, Motion(0.15, 0.4)))
    assert (believed.v1, believed.alpha1) == pytest.approx((v1, alpha1))


@given(angle=st.floats(-10.0, 10.0), span=st.floats(0.0, math.pi))
def test_cosine_change_is_the_maximum_found_by_search(angle: float, span: float) -> None:
    # Extremes of a cosine within a span: its ends, and the multiples of pi that lie inside.
    candidates = [angle - span, angle + span]
    candidates += [k * math.pi for k in range(-5, 6) if abs(k * math.pi - angle) <= span]
    searched = max(abs(math.cos(x) - math.cos(angle)) for x in candidates)
    assert cosine_change(angle, span) == pytest.approx(searched, abs=1e-14)


@given(perceived=moments, rates=rate_errors)
def test_without_input_errors_the_extended_form_is_the_sound_form(
    perceived: Perceived, rates: RateErrors
) -> None:
    expected, found = sound(perceived, rates), sound_form(perceived, rates)
    for name, bound in extended(perceived, rates, InputErrors()).items():
        assert bound == pytest.approx(float(found[name]), rel=1e-14), name
        assert bound == pytest.approx(expected[name], rel=1e-9, abs=1e-14), name


@given(perceived=moments, rates=rate_errors, inputs=input_errors, more=st.floats(0.0, 0.3))
def test_no_bound_shrinks_when_an_error_grows(
    perceived: Perceived, rates: RateErrors, inputs: InputErrors, more: float
) -> None:
    base = extended(perceived, rates, inputs)
    grown = [
        extended(perceived, replace(rates, **{f.name: getattr(rates, f.name) + more}), inputs)
        for f in fields(rates)
    ] + [
        extended(perceived, rates, replace(inputs, **{f.name: getattr(inputs, f.name) + more}))
        for f in fields(inputs)
    ]
    for larger in grown:
        for name, bound in base.items():
            assert larger[name] >= bound * (1.0 - 1e-12) - 1e-15, name


@given(perceived=st.lists(moments, min_size=1, max_size=5), rates=rate_errors, inputs=input_errors)
def test_an_array_gives_what_its_elements_give(
    perceived: list[Perceived], rates: RateErrors, inputs: InputErrors
) -> None:
    stacked = Perceived(
        **{f.name: np.array([getattr(one, f.name) for one in perceived]) for f in fields(Perceived)}
    )
    arrays = extended(stacked, rates, inputs) | {"printed": paper_h(stacked, rates, MU1, TURTLEBOT3)}
    for i, one in enumerate(perceived):
        scalars = extended(one, rates, inputs) | {"printed": paper_h(one, rates, MU1, TURTLEBOT3)}
        for name, value in scalars.items():
            assert arrays[name][i] == pytest.approx(float(value), rel=1e-13), name


def test_a_distance_that_may_be_zero_leaves_no_bound_on_h() -> None:
    rho = np.array([0.05, 0.1, 0.1 + 1e-9])
    perceived = Perceived(rho, 1.5, 0.0, 0.0, 0.08, -1.5, 0.08, 0.0)
    bound = extended_h(perceived, RateErrors(0.01, 0.01), InputErrors(E_rho=0.1), V_EPS, MU1, TURTLEBOT3)
    assert np.isinf(bound).tolist() == [True, True, False]


@pytest.mark.parametrize("bad", [-1e-9, math.nan, math.inf])
def test_impossible_error_bounds_are_refused_by_name(bad: float) -> None:
    with pytest.raises(ValueError, match="M_alpha2"):
        RateErrors(0.1, bad)
    with pytest.raises(ValueError, match="E_v2"):
        InputErrors(E_v2=bad)


@pytest.mark.parametrize("name", ["M_rho", "M_alpha2"])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -1e-9])
def test_one_impossible_number_in_an_array_of_rate_errors_is_refused(name: str, bad: float) -> None:
    arrays = {"M_rho": np.full(3, 0.1), "M_alpha2": np.full(3, 0.1)}
    assert RateErrors(**arrays).M_rho is arrays["M_rho"]
    arrays[name][1] = bad
    with pytest.raises(ValueError, match=name):
        RateErrors(**arrays)


@pytest.mark.parametrize("name", ["E_rho", "E_alpha2", "E_v2", "E_u2"])
def test_every_input_error_is_looked_at(name: str) -> None:
    assert getattr(InputErrors(), name) == 0.0
    with pytest.raises(ValueError, match=name):
        InputErrors(**{name: np.array([0.1, math.nan])})
    with pytest.raises(ValueError, match=name):
        InputErrors(**{name: -0.1})
