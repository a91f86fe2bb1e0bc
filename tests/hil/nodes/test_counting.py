from __future__ import annotations

from formation.records import rows_of
from hil.nodes.counting import Count, count, counts_in

WORDS = ("lost", "late", "twice")


def test_each_thing_is_counted_by_its_own_number_and_named_once_it_has_happened() -> None:
    counts = rows_of(Count, 3)
    assert counts_in(counts, WORDS) == {}
    for number in (2, 0, 2, 2):
        count(counts, number)
    assert counts_in(counts, WORDS) == {"lost": 1, "twice": 3}


def test_words_may_begin_at_a_later_number_and_rows_go_on_behind_them() -> None:
    counts = rows_of(Count, 5)
    for number in (0, 1, 1, 2, 2, 2, 4):
        count(counts, number)
    assert counts_in(counts, WORDS, 1) == {"lost": 2, "late": 3}
    assert counts_in(counts, WORDS[:1], 2) == {"lost": 3}


def test_what_goes_by_one_word_is_counted_together() -> None:
    counts = rows_of(Count, 3)
    for number in (0, 2, 2):
        count(counts, number)
    assert counts_in(counts, ("gated", "late", "gated")) == {"gated": 3}
