"""Leaders of all kinds with one set of defaults: errors are as small as can be, and as large as reported."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.bandwidths import KINDS, Kind, Score, measured, rules_for, scored

SEEDS = 4


def scores(kind: Kind, how: str, told: tuple[float, float] = (0.5, 0.01)) -> list[Score]:
    t = np.arange(round(kind.duration * kind.rate)) / kind.rate
    made, rules = [], rules_for(kind, how, told)
    for seed in range(SEEDS):
        generator = np.random.default_rng(seed)
        path = kind.drive(generator, t)
        made.append(scored(rules, measured(generator, path, kind.sigma), path, kind.since))
    return made


def rmse(made: list[Score]) -> list[float]:
    """Of v1, alpha1 and u1 over all runs."""
    found: list[float] = np.sqrt(np.mean([score.rmse**2 for score in made], axis=0)).tolist()
    return found


@pytest.mark.slow
def test_a_gentle_leader_is_estimated_as_by_the_filter_that_is_told_of_it() -> None:
    kind = KINDS["gentle"]
    assert kind.told is not None
    told, found = (rmse(scores(kind, *way)) for way in (("given", kind.told), ("estimated",)))
    for quantity in (1, 2):
        assert found[quantity] < 1.1 * told[quantity]


@pytest.mark.slow
def test_a_leader_that_is_as_told_loses_little_by_not_being_believed() -> None:
    given, found = rmse(scores(KINDS["random"], "given")), rmse(scores(KINDS["random"], "estimated"))
    assert found[0] < 1.08 * given[0]
    assert found[1] < 1.08 * given[1]


@pytest.mark.slow
def test_an_even_leader_is_known_better_and_its_errors_are_as_large_as_reported() -> None:
    given, found = scores(KINDS["turtlebot3"], "given"), scores(KINDS["turtlebot3"], "estimated")
    assert rmse(found)[0] < 0.5 * rmse(given)[0]
    assert np.all(np.median([score.nees for score in given], axis=0) < 0.6)
    nees = np.median([score.nees for score in found], axis=0)
    assert np.all((nees > 0.6) & (nees < 1.4))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["stop-and-go", "steps"])
def test_steps_stay_within_five_deviations(name: str) -> None:
    given, found = scores(KINDS[name], "given"), scores(KINDS[name], "estimated")
    before, after = (np.mean([score.beyond for score in made], axis=0) for made in (given, found))
    assert before[0] > 0.004
    assert after[0] < 0.6 * before[0]
    assert np.all(after < 0.015)
