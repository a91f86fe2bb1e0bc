"""Time intervals over which something stayed the same, such as a status or a reason to stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from formation.angles import FloatArray


@dataclass(frozen=True, slots=True)
class TimeInterval:
    """``what`` held from ``from_s`` to ``to_s`` [s], over ``count`` samples in a row."""

    what: str
    from_s: float
    to_s: float
    count: int


def intervals_of(t: FloatArray, states: Sequence[str], longest_gap: float) -> list[TimeInterval]:
    """Intervals of the states at the increasing times t [s], in order.

    An interval lasts until the next sample, but never beyond ``longest_gap`` [s] after its own last one: of
    what nobody reported nothing is known.
    """
    intervals: list[TimeInterval] = []
    first = 0
    for what, group in groupby(states):
        count = sum(1 for _ in group)
        after = first + count
        last_t = float(t[after - 1])
        next_t = float(t[after]) if after < len(t) else last_t
        intervals.append(TimeInterval(what, float(t[first]), min(next_t, last_t + longest_gap), count))
        first = after
    return intervals
