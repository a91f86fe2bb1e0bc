"""Which group was better and why: what breaks bounds counts before errors, and chance is told of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hil.compare.change import change_of
from hil.compare.comparison import compared
from hil.compare.comparison_text import comparison_text
from hil.compare.differences import differences_of
from hil.compare.group import RUNS, Group, Sample
from hil.compare.verdict import verdict_on

V1, OUTSIDE = "estimation.rmse.v1", "bounds.violations.v1_extended"


def group(label: str, values: list[float], outside: float = 0.0, keyed: bool = True) -> Group:
    samples = [
        Sample(
            f"{label}{n}", f"seed {n}" if keyed else "", {V1: value, OUTSIDE: outside}, {"run.seed": f"{n}"}
        )
        for n, value in enumerate(values)
    ]
    return Group(label, Path(label), RUNS, tuple(samples), {})


def test_the_lower_error_is_better_and_one_run_each_has_no_spread() -> None:
    for groups in ([group("A", [2.0]), group("B", [1.0])], [group("B", [1.0]), group("A", [2.0])]):
        verdict = verdict_on(groups)
        assert verdict.best == "B"
        assert "1000 instead of 2000 mm/s (-50 %)" in verdict.text
        assert "the spread is not known" in verdict.text


def test_a_broken_bound_weighs_more_than_an_error() -> None:
    verdict = verdict_on([group("A", [1.0], outside=40.0), group("B", [2.0])])
    assert verdict.best == "B"
    assert "no samples outside an extended bound instead of 40" in verdict.text
    assert "but" not in verdict.text.partition("(")[0]


def test_what_is_alike_has_no_best() -> None:
    assert verdict_on([group("A", [1.0]), group("B", [1.001])]).best is None
    unknown = Group("C", Path("C"), RUNS, (Sample("c", "", {"frames.lost": 0.0}, {}),), {})
    verdict = verdict_on([group("A", [1.0]), unknown])
    assert verdict.best is None
    assert "cannot be told" in verdict.text


def test_the_best_of_many_is_named() -> None:
    verdict = verdict_on([group("A", [2.0]), group("B", [3.0]), group("C", [1.0])])
    assert verdict.best == "C"
    assert "best of 3" in verdict.text


@pytest.mark.parametrize("keyed", [True, False])
def test_a_change_is_told_from_chance(keyed: bool) -> None:
    """By p-values that are known: a shift beyond all scatter, and two samples of one distribution."""
    scatter = np.random.default_rng(3).normal(1.0, 0.1, 12).tolist()
    first = group("A", scatter, keyed=keyed)
    shifted = change_of(V1, first, group("B", [value + 1.0 for value in scatter], keyed=keyed))
    other = np.random.default_rng(4).normal(1.0, 0.1, 12).tolist()
    same = change_of(V1, first, group("C", other, keyed=keyed))
    assert shifted is not None
    assert same is not None
    assert (shifted.pairs, shifted.worse_in) == ((12, 12) if keyed else (0, 0))
    # Signed ranks of 12 shifts of one sign: 2 / 2^12.
    assert shifted.chance == pytest.approx(2.0 / 2**12, rel=0.01) if keyed else (shifted.chance or 1.0) < 1e-4
    assert shifted.may_be_chance is False
    assert same.may_be_chance is True
    assert change_of(V1, group("A", [1.0, 2.0]), group("B", [1.0, 2.0])).may_be_chance is None  # type: ignore[union-attr]


def test_only_conditions_that_differ_are_told() -> None:
    first, second = group("A", [1.0, 1.0]), group("B", [1.0, 1.0, 1.0])
    assert differences_of([first, second]) == {"run.seed": (("0", "1"), ("0", "1", "2"))}
    text = comparison_text(compared([first, second]))
    assert "run.seed" in text
    assert "the same in all: estimation.rmse.v1" in text


def test_what_got_worse_in_some_twins_is_not_the_same() -> None:
    first, other = group("A", [1.0] * 10), group("B", [1.0] * 6 + [9.0] * 4)
    text = comparison_text(compared([first, other]))
    assert "worse 4/10" in text
    assert V1 not in text.partition("the same in all: ")[2]


def test_runs_are_twins_only_where_both_groups_have_the_same() -> None:
    change = change_of(V1, group("A", [1.0, 2.0]), group("B", [1.0, 2.0, 9.0, 9.0, 9.0]))
    assert change is not None
    assert (change.pairs, change.difference) == (0, 7.5)


def of(label: str, *runs: dict[str, float]) -> Group:
    return Group(
        label, Path(label), RUNS, tuple(Sample(f"{n}", "", run, {}) for n, run in enumerate(runs)), {}
    )


def test_runs_that_broke_down_come_before_errors() -> None:
    first, other = of("A", *[{V1: 2.0}] * 10), of("B", {V1: 1.0}, *[{}] * 9)
    verdict = verdict_on([first, other])
    assert verdict.best == "A"
    assert "no runs without a figure instead of 9" in verdict.text
    assert "chance" not in verdict.text


def test_unlike_breaks_are_not_summed_and_near_ones_are_alike() -> None:
    """94 and 96 samples are alike on either side of 95; a lost track is more than samples outside."""
    samples = {"estimation.samples": 1000.0, "estimation.untracked": 0.0}
    near = of("A", samples | {V1: 2.0, OUTSIDE: 94.0}), of("B", samples | {V1: 1.0, OUTSIDE: 96.0})
    assert verdict_on(near).best == "B"
    lost = of("A", samples | {V1: 1.0, OUTSIDE: 0.0, "estimation.untracked": 300.0})
    assert verdict_on([lost, of("B", samples | {V1: 1.0, OUTSIDE: 900.0})]).best == "B"


def test_lost_track_of_a_chain_counts() -> None:
    pair = {"pairs.r2.estimation.rmse.v1": 1.0, "pairs.r2.estimation.samples": 500.0}
    lost = of("A", pair | {"pairs.r2.estimation.untracked": 500.0})
    verdict = verdict_on([lost, of("B", pair | {"pairs.r2.estimation.untracked": 0.0})])
    assert verdict.best == "B"
    assert "untracked estimates" in verdict.text


def test_chance_is_of_what_speaks_for_the_better_one() -> None:
    """v1 is better on the whole, but scattered; that alpha1 is surely worse does not make it sure."""
    v1 = [0.1, 0.1, 9.0, 0.1, 9.0, 0.1, 9.0, 0.1]
    alpha1 = "estimation.rmse.alpha1"
    first = of("A", *({V1: 5.0 + 0.01 * n, alpha1: 1.0 + 0.001 * n} for n in range(8)))
    other = of("B", *({V1: value, alpha1: 1.1 + 0.001 * n} for n, value in enumerate(v1)))
    verdict = verdict_on([first, other])
    assert verdict.best == "B"
    assert verdict.text.endswith("; which may be chance (at 5 %).")
