from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from hil.judge.columns import columns_of
from hil.judge.published_bounds import judge_published
from hil.judge.run_data import RunData


def judged(run_data: RunData) -> dict[str, Any]:
    return judge_published(run_data.scenario, columns_of(run_data))


def test_bounds_are_judged_as_they_went_out(exact_run_data: RunData) -> None:
    """One estimate errs beyond its published bound, one within; the largest error seen is no excuse."""
    estimates = list(exact_run_data.estimates)
    estimates[130] = replace(estimates[130], v1=estimates[130].v1 + 0.06)
    estimates[150] = replace(estimates[150], v1=estimates[150].v1 + 0.04)
    found = judged(replace(exact_run_data, estimates=estimates))["published"]
    assert found["violations"]["v1"] == 1
    assert found["violations"]["alpha1"] == 0
    assert found["tightness"]["v1"] == pytest.approx(0.06 / 0.05)
    assert found["median"] == {"v1": 0.05, "alpha1": 0.5, "h": 1.0}


def test_a_bound_that_excludes_nothing_is_told(exact_run_data: RunData) -> None:
    n = len(columns_of(exact_run_data).samples.capture_ns)
    estimates = list(exact_run_data.estimates)
    estimates[130] = replace(estimates[130], bound_alpha1=math.pi, bound_h=math.inf)
    found = judged(replace(exact_run_data, estimates=estimates))["published"]["says_something"]
    assert found["v1"] == 1.0
    assert found["alpha1"] == found["h"] == pytest.approx(1.0 - 1.0 / n)


def test_the_largest_errors_seen_stand_beside(exact_run_data: RunData) -> None:
    estimates = list(exact_run_data.estimates)
    estimates[130] = replace(estimates[130], rho=estimates[130].rho + 0.02)
    found = judged(replace(exact_run_data, estimates=estimates))["largest_errors_seen"]
    assert found["E_rho"] == pytest.approx(0.02)
    assert set(found) == {"M_rho", "M_alpha2", "E_rho", "E_alpha2", "E_v2", "E_u2"}


def test_without_truth_there_are_medians_only_and_without_estimates_nothing(exact_run_data: RunData) -> None:
    bare = judged(replace(exact_run_data, truth=[]))
    assert set(bare) == {"published"}
    assert set(bare["published"]) == {"median", "says_something"}
    assert judged(replace(exact_run_data, estimates=[])) == {}
