"""Deviations that are too small or too large are seen, said, and not where nobody can tell."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hil.judge.columns import columns_of
from hil.judge.consistency import judge_nees, nees_finding
from hil.judge.run_data import RunData
from hil.judge.summary import summarise
from hil.judge.summary_text import verdict_lines, warnings_of


def with_errors(run_data: RunData, size: float) -> RunData:
    """Estimates whose v1 is off at random by so many of the millimetres a second that they are sure of."""
    noise = np.random.default_rng(4).normal(size=len(run_data.estimates))
    estimates = [
        replace(each, v1=each.v1 + 1e-3 * size * off)
        for each, off in zip(run_data.estimates, noise.tolist(), strict=True)
    ]
    return replace(run_data, estimates=estimates)


@pytest.mark.parametrize("size", [0.3, 1.0, 2.0])
def test_nees_is_the_square_of_how_much_too_large_errors_are(exact_run_data: RunData, size: float) -> None:
    summary = summarise(with_errors(exact_run_data, size))
    estimation = summary["estimation"]
    assert estimation["nees"]["v1"] == pytest.approx(size**2, rel=0.3)
    low, high = estimation["nees_limits"]["v1"]
    assert 0.5 < low < 1.0 < high < 1.6
    # The truth itself is not off by chance: what is left is rounding.
    assert estimation["nees"]["alpha1"] < 1e-20
    assert "alpha1" not in estimation["nees_limits"]
    found = {each["name"]: each["text"] for each in summary["findings"]}
    assert ("too modest: v1" in found.get("nees", "")) == (size < 1.0)
    assert ("too confident: v1" in found.get("nees", "")) == (size > 1.0)
    assert len([line for line in warnings_of(summary) if line.startswith("nees: ")]) == len(found)
    assert [text for name, text, _ in verdict_lines(summary) if name == "nees" and "v1" in text]


def test_nobody_is_told_of_what_could_be_chance_or_does_not_matter() -> None:
    def finding(nees: float, low: float, high: float) -> str:
        return nees_finding({"nees": {"u1": nees}, "nees_limits": {"u1": [low, high]}})

    assert not finding(0.3, 0.2, 3.0)
    assert not finding(0.7, 0.9, 1.1)
    assert "u1 0.3 (expected 0.9 to 1.1)" in finding(0.3, 0.9, 1.1)
    assert "too confident" in finding(2.5, 0.9, 1.1)
    assert not nees_finding({"nees": {"u1": 9.0}})


def test_errors_that_never_change_are_found_by_how_few_are_explained() -> None:
    once: dict[str, Any] = {"nees": {"u1": 7.3}, "nees_limits": {"u1": [0.0, 12.6]}}
    assert not nees_finding(once | {"coverage_3sigma": {"u1": 0.95}})
    said = nees_finding(once | {"coverage_3sigma": {"u1": 0.58}})
    assert "too confident: u1 7.3 (58% within 3 deviations" in said


def test_limits_that_say_nothing_lead_to_no_finding_and_are_said_to_be_none() -> None:
    told: dict[str, Any] = {"nees": {"v1": 13.0}, "nees_limits": {"v1": [0.0, 12.63]}}
    assert not nees_finding(told)
    assert not nees_finding({"nees": {"v1": 0.01}, "nees_limits": {"v1": [0.04, 4.0]}})
    assert nees_finding({"nees": {"v1": 0.01}, "nees_limits": {"v1": [0.2, 3.9]}})
    given = {"estimation": told, "bounds": {}, "mode": "lockstep", "scenario": "a", "duration_s": 1.0}
    lines = {name: text for name, text, _ in verdict_lines(given | {"estimator": "ekf"})}
    assert lines["nees"].endswith("v1 13.00 (too short to tell)")


def test_without_truth_nothing_is_said(exact_run_data: RunData) -> None:
    columns = columns_of(exact_run_data)
    found: dict[str, Any] = judge_nees(columns.samples, {})
    assert found == {"nees": {}, "nees_limits": {}}
    assert "nees" not in summarise(replace(exact_run_data, truth=[]))["estimation"]
