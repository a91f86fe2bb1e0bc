"""The worst of several tries, and when a case has failed."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.faults.attempt import Try
from hil.faults.matrix import faults
from hil.faults.report import NEVER_TRIED, as_markdown, as_result, cases_of, merged
from hil.faults.tally import COUNTS, LIMIT_S, Case, worst_of

figures = st.floats(0.0, 100.0)
counts = st.integers(0, 3)
tries = st.builds(
    Try, figures, figures, figures, counts, counts, counts, counts, counts, figures, st.just(("so",))
)
COVERED = next(fault for fault in faults() if not fault.uncovered)
UNCOVERED = next(fault for fault in faults() if fault.uncovered)
KEYS = {
    "fault", "role", "mode", "tries", "runaway_s", "runaway_m", "oldest_command_s", "lost_logs", "wrong_exit",
    "wrong_reason", "hangs", "orphans", "memory_mb",
}  # fmt: skip


def _one(name: str) -> Try:
    """A try of which one count is 1."""
    lost, code, reason, hang, left = (int(each == name) for each in COUNTS)
    return Try(0.0, 0.0, 0.0, lost, code, reason, hang, left)


@given(st.lists(tries, min_size=1, max_size=5))
def test_the_worst_is_no_better_than_any_and_counts_add_up(done: list[Try]) -> None:
    worst = worst_of(done)
    for name in ("runaway_s", "runaway_m", "oldest_command_s", "memory_mb"):
        assert getattr(worst, name) == max(getattr(each, name) for each in done)
    for name in COUNTS:
        assert getattr(worst, name) == sum(getattr(each, name) for each in done)
    assert worst.wrong == ("so",)


@pytest.mark.parametrize("name", COUNTS)
def test_one_count_fails_a_case(name: str) -> None:
    assert not Case(COVERED, 1, Try()).failed
    assert Case(COVERED, 1, worst_of([Try(), _one(name)])).failed


def test_a_runaway_beyond_the_limit_fails_a_case_unless_it_is_not_covered() -> None:
    beyond = Try(runaway_s=LIMIT_S + 0.01)
    assert not Case(COVERED, 1, Try(runaway_s=LIMIT_S)).failed
    assert Case(COVERED, 1, beyond).failed
    assert not Case(UNCOVERED, 1, beyond).failed
    assert not Case(COVERED, 1, Try(oldest_command_s=LIMIT_S)).failed
    assert Case(COVERED, 1, Try(oldest_command_s=LIMIT_S + 0.01)).failed


@given(st.lists(tries, min_size=1, max_size=3), st.lists(tries, min_size=1, max_size=3))
def test_tries_of_two_sessions_add_up_to_those_of_one(first: list[Try], second: list[Try]) -> None:
    before, now = (Case(COVERED, len(each), worst_of(each)) for each in (first, second))
    other = Case(UNCOVERED, 1, first[0])
    kept = cases_of(json.loads(json.dumps(as_result([before, other], []))), faults())
    found = {case.fault.name: case for case in merged(kept, [now], faults())}
    assert found[UNCOVERED.name].as_row() == other.as_row()
    whole = Case(COVERED, len(first) + len(second), worst_of([*first, *second]))
    assert found[COVERED.name].as_row() == pytest.approx(whole.as_row(), abs=1e-4)


def test_the_result_has_every_number_of_every_case() -> None:
    cases = [Case(COVERED, 2, Try()), Case(UNCOVERED, 1, Try(runaway_s=6.0))]
    result = json.loads(json.dumps(as_result(cases, NEVER_TRIED)))
    (row,) = result["cases"]
    assert row.keys() == KEYS
    (apart,) = result["not_covered"]
    assert apart["runaway_s"] == 6.0
    assert apart["why"] == UNCOVERED.uncovered
    assert {each["fault"] for each in result["skipped"]} == {each.fault for each in NEVER_TRIED}
    page = as_markdown(cases, NEVER_TRIED)
    assert all(f"`{each}`" in page for each in (COVERED.name, UNCOVERED.name, NEVER_TRIED[0].fault))
