"""What a node counts, in rows: each thing by a number that stands for a word."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from formation.kernel import kernel
from formation.records import Rows, columns_of, load, store
from hil.nodes.node import Counts


class Count(NamedTuple):
    """How often something has happened."""

    times: int


@kernel
def count(counts: Rows[Count], number: int) -> None:
    """Count what goes by a number once more."""
    store(counts, number, Count(load(Count, counts, number).times + 1))


def counts_in(counts: Rows[Count], words: Sequence[str], first: int = 0) -> Counts:
    """Counts by their words, those of the numbers from ``first`` on; none that is 0."""
    found: dict[str, int] = {}
    for word, times in zip(words, columns_of(counts)["times"][first:].tolist(), strict=False):
        if times:
            found[word] = found.get(word, 0) + times
    return found
