from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.bound_trials import FIG2, LEVELS, TURTLEBOT3, Setting, judge_trials
from controllers.laws import Gains, independent_speed
from estimation.bounds.bound_check import (
    QUANTITY_OF,
    ROUNDING,
    SpeedInputs,
    Verdict,
    all_bounds,
    check,
    errors_of,
    h_of,
)
from estimation.bounds.error_bounds import InputErrors, Perceived, RateErrors
from formation.pose import Motion
from formation.shape import Shape, shape_rates
from formation.station import Side, Station
from tests.formation.shape_rates import relative_rates

EXACT_FORMS = {"v1", "alpha1", "h"}
EXTENDED_FORMS = {"v1_extended", "alpha1_extended", "h_extended"}
SAMPLES = 25_000


def over_all_levels(setting: Setting, *, input_errors: bool) -> Verdict:
    violations: Counter[str] = Counter()
    tightness = dict.fromkeys(QUANTITY_OF, 0.0)
    for level in LEVELS:
        random = np.random.default_rng([7, round(1000 * level), input_errors])
        verdict = judge_trials(setting, level, random, SAMPLES, input_errors=input_errors)
        violations.update(verdict.violations)
        tightness = {name: max(tightness[name], verdict.tightness[name]) for name in tightness}
    return Verdict(dict(violations), tightness)


@pytest.mark.parametrize("setting", [FIG2, TURTLEBOT3], ids=["fig2", "turtlebot3"])
def test_with_exact_inputs_sound_and_extended_hold_tightly_and_the_paper_does_not(setting: Setting) -> None:
    verdict = over_all_levels(setting, input_errors=False)
    for name in EXACT_FORMS | EXTENDED_FORMS:
        assert verdict.violations[name] == 0, name
        assert 0.9 < verdict.tightness[name] < 1.0 + 1e-9, name
    assert verdict.violations["paper_alpha1"] > 0
    assert verdict.violations["paper_h"] > 0


ELSEWHERE = replace(TURTLEBOT3, station=Station(Side.LEFT, 0.7))


@pytest.mark.parametrize("setting", [FIG2, TURTLEBOT3, ELSEWHERE], ids=["fig2", "turtlebot3", "left behind"])
def test_with_input_errors_only_the_extended_form_holds(setting: Setting) -> None:
    verdict = over_all_levels(setting, input_errors=True)
    for name in EXTENDED_FORMS:
        assert verdict.violations[name] == 0, name
        assert 0.9 < verdict.tightness[name] < 1.0 + 1e-9, name
    for name in EXACT_FORMS | {"paper_alpha1", "paper_h"}:
        assert verdict.violations[name] > 0, name


@given(
    rho=st.floats(0.05, 2.0),
    alpha2=st.floats(-math.pi, math.pi),
    leader=st.tuples(st.floats(0.06, 0.5), st.floats(-math.pi, math.pi)),
    follower=st.tuples(st.floats(-0.5, 0.5), st.floats(-2.0, 2.0)),
    sizes=st.tuples(*[st.floats(0.0, 0.04)] * 6),
    parts=st.tuples(*[st.floats(-1.0, 1.0)] * 6),
)
def test_no_single_moment_breaks_the_extended_form(
    rho: float,
    alpha2: float,
    leader: tuple[float, float],
    follower: tuple[float, float],
    sizes: tuple[float, ...],
    parts: tuple[float, ...],
) -> None:
    truth, motion = SpeedInputs(rho, *leader), Motion(*follower)
    true_inputs = (rho, alpha2, *relative_rates(rho, alpha2, *leader, motion), motion.v, motion.u)
    seen = (value + size * part for value, size, part in zip(true_inputs, sizes, parts, strict=True))
    perceived = Perceived.from_rates(*seen)
    E_rho, E_alpha2, M_rho, M_alpha2, E_v2, E_u2 = sizes
    bounds = all_bounds(
        perceived,
        RateErrors(M_rho, M_alpha2),
        InputErrors(E_rho, E_alpha2, E_v2, E_u2),
        v_eps=TURTLEBOT3.v_eps,
        mu1=TURTLEBOT3.mu1,
        spacing=TURTLEBOT3.spacing,
    )
    violations = check(errors_of(perceived, truth, TURTLEBOT3.mu1, TURTLEBOT3.spacing), bounds).violations
    assert {violations[name] for name in EXTENDED_FORMS} == {0}


def moments() -> Iterator[SpeedInputs]:
    generator = np.random.default_rng(3)
    for rho, v1, alpha1 in generator.uniform([0.1, 0.0, -math.pi], [1.0, 0.5, math.pi], (50, 3)).tolist():
        yield SpeedInputs(rho, v1, alpha1)


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("bearing", [0.7, math.pi / 2, 2.0])
def test_h_is_the_alpha1_dynamics_under_the_published_law(side: Side, bearing: float) -> None:
    station = Station(side, bearing)
    gains = Gains(TURTLEBOT3.mu1, 2.0, TURTLEBOT3.spacing, station)
    for truth, believed in zip(moments(), reversed(list(moments())), strict=True):
        rho, v1, alpha1 = float(believed.rho), float(believed.v1), float(believed.alpha1)
        asked = independent_speed(Shape(rho, alpha1, station.alpha2), v1, gains)
        true_shape = Shape(float(truth.rho), float(truth.alpha1), station.alpha2)
        alpha1_dot = shape_rates(true_shape, Motion(float(truth.v1), 0.0), Motion(asked, 0.0)).alpha1_dot
        assert h_of(truth, believed, gains.mu1, gains.spacing, station) == pytest.approx(alpha1_dot, rel=1e-9)


def test_the_extended_bound_of_h_is_reached_where_all_its_parts_add_up() -> None:
    # Believed: at rho_0, standing still and pointing away. True: too close, approaching at M_rho.
    M_rho, E_rho, spacing = 0.1, 0.08, TURTLEBOT3.spacing
    perceived = Perceived(spacing.rho_0, math.pi / 2, 0.0, 0.0, 0.0, math.pi, 0.0, 0.0)
    truth = SpeedInputs(spacing.rho_0 - E_rho, M_rho, 0.0)
    bounds = all_bounds(
        perceived, RateErrors(M_rho, 0.0), InputErrors(E_rho), v_eps=0.06, mu1=1.5, spacing=spacing
    )
    assert errors_of(perceived, truth, 1.5, spacing)["h"] == pytest.approx(bounds["h_extended"], rel=1e-12)


def test_a_true_belief_has_no_error_beyond_rounding() -> None:
    for truth in moments():
        perceived = Perceived(truth.rho, 1.5, 0.0, 0.0, truth.v1, truth.alpha1, 0.1, 0.0)
        errors = errors_of(perceived, truth, TURTLEBOT3.mu1, TURTLEBOT3.spacing)
        assert max(float(error) for error in errors.values()) == 0.0


def test_the_bearing_error_is_taken_the_short_way_round() -> None:
    perceived = Perceived(0.5, 1.5, 0.0, 0.0, 0.1, -3.1, 0.1, 0.0)
    errors = errors_of(perceived, SpeedInputs(0.5, 0.1, 3.1), 1.0, FIG2.spacing)
    assert errors["alpha1"] == pytest.approx(2.0 * math.pi - 6.2)


def test_check_counts_what_exceeds_and_what_cannot_be_compared() -> None:
    errors = {"v1": np.array([0.5, 1.0, 1.0 + 1e-9, math.nan, 0.0])}
    verdict = check(errors, {"v1": np.ones(5), "v1_extended": np.full(5, 2.0)})
    assert verdict.violations == {"v1": 2, "v1_extended": 1}
    assert verdict.tightness == pytest.approx({"v1": 1.0 + 1e-9, "v1_extended": 0.5 + 5e-10}, abs=1e-12)


def test_check_forgives_rounding_only() -> None:
    on_the_bound = check({"h": 1.0 + 0.9 * ROUNDING}, {"h": 1.0})
    assert on_the_bound.violations == {"h": 0}
    nothing_allowed = check({"h": np.array([0.5 * ROUNDING, 0.0])}, {"h": np.zeros(2)})
    assert (nothing_allowed.violations, nothing_allowed.tightness) == ({"h": 0}, {"h": 0.0})
    assert check({"h": 1e-12}, {"h": 0.0}).violations == {"h": 1}


def test_no_samples_give_no_violations() -> None:
    assert check({"alpha1": np.empty(0)}, {"alpha1": np.empty(0)}) == Verdict({"alpha1": 0}, {"alpha1": 0.0})


def test_every_named_bound_has_its_quantity() -> None:
    perceived = Perceived(0.5, 1.5, 0.0, 0.0, 0.1, -1.5, 0.1, 0.0)
    bounds = all_bounds(
        perceived, RateErrors(0.01, 0.01), InputErrors(), v_eps=0.05, mu1=1.0, spacing=FIG2.spacing
    )
    assert list(bounds) == list(QUANTITY_OF)
