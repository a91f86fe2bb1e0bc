from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from estimation.bounds.error_bounds import Perceived
from hil.judge.bounds import judge_bounds, worst_errors
from hil.judge.columns import columns_of
from hil.judge.run_data import RunData
from hil.scenario.certificate import certificate_of
from hil.wire.assumed_errors import AssumedErrors

NAN = math.nan


def bounds_of(run_data: RunData) -> dict[str, dict[str, float]]:
    found = judge_bounds(run_data.scenario, columns_of(run_data))
    return {key: value for key, value in found.items() if isinstance(value, dict)}


def test_a_planted_violation_is_counted(exact_run_data: RunData) -> None:
    """An estimate whose v1 does not follow from its own rates errs by more than rates and inputs allow."""
    estimates = list(exact_run_data.estimates)
    for number in (100, 150):
        estimates[number] = replace(estimates[number], v1=estimates[number].v1 + 0.01)
    found = bounds_of(replace(exact_run_data, estimates=estimates))
    assert found["violations"]["v1"] == found["violations"]["v1_extended"] == 2
    assert found["violations"]["alpha1"] == 0


def test_rate_errors_of_the_run_are_what_the_bounds_rest_on(exact_run_data: RunData) -> None:
    """Estimates built from wrong rates as the appendix does stay within the sound bounds, and touch them."""
    random = np.random.default_rng(3)
    estimates = []
    for each in exact_run_data.estimates:
        direction = random.uniform(-math.pi, math.pi)
        rho_dot = each.rho_dot + 0.01 * math.cos(direction)
        alpha2_dot = each.alpha2_dot + 0.05 * math.sin(direction)
        seen = Perceived.from_rates(each.rho, each.alpha2, rho_dot, alpha2_dot, each.v2, each.u2)
        estimates.append(
            replace(
                each, rho_dot=rho_dot, alpha2_dot=alpha2_dot, v1=float(seen.v1), alpha1=float(seen.alpha1)
            )
        )
    run_data = replace(exact_run_data, estimates=estimates)
    found = judge_bounds(run_data.scenario, columns_of(run_data))
    assert found["M_rho"] == pytest.approx(0.01, rel=1e-3)
    assert found["M_alpha2"] == pytest.approx(0.05, rel=1e-3)
    counts, tightness = bounds_of(run_data)["violations"], bounds_of(run_data)["tightness"]
    assert [counts[name] for name in ("v1", "alpha1", "h", "v1_extended", "h_extended")] == [0] * 5
    assert 0.6 < tightness["v1"] <= 1.0
    assert tightness["v1_extended"] == pytest.approx(tightness["v1"], rel=1e-6)


def test_unknown_errors_are_assumed_and_known_ones_are_not(exact_run_data: RunData) -> None:
    truth = [replace(each, v2=NAN, u2=NAN) for each in exact_run_data.truth]
    run_data = replace(exact_run_data, truth=truth)
    found = worst_errors(run_data.scenario, columns_of(run_data))
    assumed = AssumedErrors.of(run_data.scenario).errors(0.2)
    certain = certificate_of(run_data.scenario).velocity_error
    n = len(columns_of(run_data).samples.capture_ns)
    assert found.rates.M_rho == pytest.approx(np.full(n, certain + assumed.E_v2))
    assert found.rates.M_alpha2 == pytest.approx(np.full(n, certain / 0.2 + assumed.E_u2))
    assert found.inputs.E_v2 == pytest.approx(np.full(n, assumed.E_v2))
    assert found.inputs.E_rho == pytest.approx(0.0, abs=1e-12)
    assert judge_bounds(run_data.scenario, columns_of(run_data))["checked"] == n
