"""Conditions of ``--fail-if``: read, refused with a hint, and met or not."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.compare.conditions import Condition, failures_of, parsed_condition
from hil.compare.group import RUNS, Group, Sample
from hil.errors import UsageError


def group(label: str, *runs: dict[str, float]) -> Group:
    samples = [Sample(f"{n}", f"seed {n}", metrics, {}) for n, metrics in enumerate(runs)]
    return Group(label, Path(label), RUNS, tuple(samples), {})


A = group("A", {"estimation.rmse.v1": 2.0, "frames.lost": 0.0, "clock.offset_ms": -30.0, "cycles.late": 3.0})
B = group("B", {"estimation.rmse.v1": 3.0, "frames.lost": 1.0, "clock.offset_ms": -20.0})


@pytest.mark.parametrize(
    ("text", "fails"),
    [
        ("estimation.rmse.v1 > 1.4", True),
        ("estimation.rmse.v1>1.5", False),
        ("estimation.rmse.v1 >= 150%", True),
        ("ratio(estimation.rmse.v1) < 1", False),
        ("change(estimation.rmse.v1) > .9", True),
        ("change( estimation.rmse.v1 ) > 1e0", False),
        ("value(estimation.rmse.v1) > 2.5", True),
        ("value(estimation.rmse.v1) < 2.5", False),
        ("frames.lost > 1000", True),  # of none before
        ("change(clock.offset_ms) > 5", True),
        ("cycles.late > 1.1", True),  # not known any more
    ],
)
def test_a_group_fails_by_its_ratio_change_or_value(text: str, fails: bool) -> None:
    found = failures_of([parsed_condition(text)], [A, B])
    assert [failure.group for failure in found] == ["B"] * fails
    assert all(parsed_condition(text).name in failure.text for failure in found)


def test_what_stays_zero_has_not_changed() -> None:
    assert not failures_of([parsed_condition("frames.lost > 1")], [A, A])


def test_every_group_but_the_first_is_looked_at() -> None:
    found = failures_of([parsed_condition("estimation.rmse.v1 > 1")], [A, A, B, B])
    assert len(found) == 2


def test_twins_are_looked_at_one_by_one() -> None:
    before = group("before", {"x": 1.0}, {"x": 10.0}, {"x": 100.0})
    after = group("after", {"x": 2.0}, {"x": 20.0}, {"x": 90.0})
    (failure,) = failures_of([parsed_condition("x > 1.99")], [before, after])
    assert failure.value == 2.0


def test_an_unknown_metric_names_the_nearest() -> None:
    with pytest.raises(UsageError, match=r"the nearest is estimation\.rmse\.v1"):
        failures_of([parsed_condition("estimation.rsme.v1 > 1.1")], [A, B])


def test_a_ratio_of_what_may_be_negative_says_nothing() -> None:
    with pytest.raises(UsageError, match=r"change\(clock\.offset_ms\)"):
        failures_of([parsed_condition("clock.offset_ms > 1.1")], [A, B])


@pytest.mark.parametrize("text", ["", "v1", "v1 > much", "v1 = 2", "size(v1) > 2", "change(v1) > 2%", "> 2"])
def test_what_is_no_condition_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="expected like"):
        parsed_condition(text)


def test_a_condition_is_kept_as_it_was_given() -> None:
    assert parsed_condition(" v1>=2 ") == Condition("v1>=2", "ratio", "v1", ">=", 2.0)


def test_a_group_fails_whose_runs_broke_down() -> None:
    sound = group("sound", *({"x": 1.0} for _ in range(3)))
    for broken in (group("broken", {"x": 1.0}, {}, {}), group("fewer", {"x": 1.0}, {})):
        (failure,) = failures_of([parsed_condition("x > 1.1")], [sound, broken])
        assert (failure.group, failure.value) == (broken.label, None)
    assert not failures_of([parsed_condition("x > 1.1")], [group("fewer", {"x": 1.0}, {}), sound])
