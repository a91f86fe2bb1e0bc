"""Motion-capture frames of a run: how many were captured, and which of them the estimator got."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from hil.scenario.schema import Scenario

Numbers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Frames:
    """Motion-capture frames: when those that the estimator got were captured [ns], each once, in order.

    ``published``: how many were captured from the first to the last of them.
    """

    published: int
    captures_ns: Sequence[int]

    @property
    def received(self) -> int:
        """How many the estimator got."""
        return len(self.captures_ns)


@dataclass(frozen=True, slots=True, eq=False)
class Numbered:
    """Captures, arrays of shape (n,): the number of each and when it was."""

    numbers: Numbers
    at_ns: Numbers

    def by_number(self) -> Numbered:
        """Each number once, in order, with the last capture that has it."""
        numbers, backwards = np.unique(self.numbers[::-1], return_index=True)
        return Numbered(numbers, self.at_ns[::-1][backwards])


def frames_of(scenario: Scenario, arrived: Numbered, true: Numbered) -> Frames | None:
    """Frames by their numbers, so that one that came twice counts once; None for fewer than two.

    What was captured is known from the truth of an emulated run, on the host's clock; elsewhere from the
    numbers themselves, whose commonest step is taken for that of frames in a row.
    """
    captured = true.by_number()
    mocap = scenario.mocap
    own_clock = any((mocap.clock_offset_s, mocap.clock_drift_ppm, mocap.clock_jump_s))
    if len(captured.numbers):
        rows = np.minimum(np.searchsorted(captured.numbers, arrived.numbers), len(captured.numbers) - 1)
        true_ns = captured.at_ns[rows]
        is_true = captured.numbers[rows] == arrived.numbers
        counts = is_true if own_clock else is_true & (true_ns == arrived.at_ns)
        found = Numbered(arrived.numbers[counts], true_ns[counts]).by_number()
    else:
        found = arrived.by_number()
    numbers = found.numbers
    if len(numbers) < 2:
        return None
    first, last = int(numbers[0]), int(numbers[-1])
    if len(captured.numbers):
        published = int(np.count_nonzero((captured.numbers >= first) & (captured.numbers <= last)))
    else:
        published = round((last - first) / _commonest(np.diff(numbers))) + 1
    # An array does for all that is asked of a sequence here.
    return Frames(published, cast("Sequence[int]", np.sort(found.at_ns)))


def _commonest(steps: Numbers) -> int:
    """The number that is there most often, of several the one that comes first."""
    values, first, counts = np.unique(steps, return_index=True, return_counts=True)
    most = counts == counts.max()
    return int(values[most][np.argmin(first[most])])
