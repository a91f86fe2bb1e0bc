"""By which metrics laws are told apart, and filters of one law."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from hil.compare.comparison import compared
from hil.compare.comparison_text import comparison_text
from hil.compare.group import RUNS, STOPPED, SWEEP, Group, Sample
from hil.compare.noise_table import noise_rows
from hil.compare.verdict import verdict_on

V1 = "estimation.rmse.v1"
OFF_RUN, OFF_STATION = "formation.orbit_deviation_rms.rho", "formation.equilibrium_deviation_rms.rho"


def run(label: str, off_run: float, off_station: float, v1: float = 1e-3, **facts: str) -> Group:
    metrics = {V1: v1, OFF_RUN: off_run, OFF_STATION: off_station}
    told = {key.replace("__", "."): value for key, value in facts.items()}
    return Group(label, Path(label), RUNS, (Sample(label, "", metrics, told),), {})


@pytest.mark.parametrize(
    "facts",
    [
        ({"controller__law": "independent"}, {"controller__law": "eager.py:eager"}),
        ({"controller__parameters__k": "0.1"}, {"controller__parameters__k": "0.5"}),
        ({"controller__mu1": "1.5"}, {"controller__mu1": "3.0"}),
    ],
)
def test_laws_are_told_apart_by_the_station(facts: tuple[dict[str, str], dict[str, str]]) -> None:
    """What one law does by itself is no measure of another."""
    still = run("still", 0.6e-3, 17.1e-3, v1=1.0e-3, **facts[0])
    eager = run("eager", 1.9e-3, 9.0e-3, v1=1.5e-3, **facts[1])
    verdict = verdict_on([still, eager])
    assert verdict.best == "eager"
    assert (
        "eager was better than still: rho off the station 9 instead of 17.1 mm (-47 %); but" in verdict.text
    )
    assert "noise-free run" not in verdict.text


def test_runs_of_one_law_are_told_apart_by_what_noise_costs() -> None:
    quiet, loud = run("quiet", 0.6e-3, 17.1e-3), run("loud", 1.9e-3, 9.0e-3)
    verdict = verdict_on([quiet, loud])
    assert verdict.best == "quiet"
    assert "rho off its own noise-free run 0.6 instead of 1.9 mm" in verdict.text
    assert "station" not in verdict.text


def test_with_another_estimator_besides_its_errors_decide_too() -> None:
    first = run("A", 1e-3, 10e-3, v1=1e-3, controller__law="independent", estimator__kind="ekf")
    other = run("B", 1e-3, 9e-3, v1=9e-3, controller__law="faded", estimator__kind="ukf")
    assert verdict_on([first, other]).best == "A"


def swept(label: str, law: str, *off: float) -> Group:
    name = "formation.equilibrium_deviation.rho"
    levels = (0.001, 0.005)
    cells = tuple(
        Sample(f"{n}", f"{n}", {name: value, "diverged": 0.0}, {"controller.law": law}, runs=5, noise=level)
        for n, (level, value) in enumerate(zip((*levels, *levels), off, strict=True))
    )
    return Group(label, Path(label), SWEEP, cells, {"cells": []})


def test_sweeps_are_told_level_by_level() -> None:
    comparison = compared(
        [swept("A", "independent", 0.01, 0.02, 0.01, 0.02), swept("B", "faded", 0.005, 0.04, 0.005, 0.04)]
    )
    rows = noise_rows(comparison)
    assert rows[0] == ["at position noise [mm]", "A", "B", "against the first"]
    assert rows[1:] == [
        ["rho off the station [mm], 1", "10 (10 to 10)", "5 (5 to 5)", "× 0.5 better 2/2"],
        ["rho off the station [mm], 5", "20 (20 to 20)", "40 (40 to 40)", "× 2 worse 2/2"],
    ]
    assert "at position noise" in comparison_text(comparison, rows, "with --json")
    assert noise_rows(compared([run("A", 1.0, 1.0), run("B", 1.0, 1.0)])) == []


def test_at_which_noise_the_better_sweep_is_the_worse_is_said() -> None:
    first = swept("A", "independent", 0.02, 0.02, 0.02, 0.02)
    verdict = verdict_on([first, swept("B", "faded", 0.002, 0.022, 0.002, 0.022)])
    assert verdict.best == "B"
    assert "medians of the cells" in verdict.text
    assert verdict.text.endswith("; but worse at 5 mm of position noise.")


def test_of_a_run_that_was_stopped_it_is_said() -> None:
    first, other = run("A", 1e-3, 1e-2), run("B", 2e-3, 1e-2)
    cut = Group("B", Path("B"), RUNS, (replace(other.samples[0], facts={STOPPED: "too near"}),), {})
    text = comparison_text(compared([first, cut]))
    assert "! of B 1 of 1 runs ended by a stop" in text
    assert "too near" in text
    assert "ended by a stop" not in comparison_text(compared([first, other]))
