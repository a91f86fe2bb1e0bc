"""How the memory of a process grows over a long run."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from typing import NamedTuple

SETTLES_S = 300.0
"""What a process takes in its first minutes it takes once [s]."""

WATCHED_S = 600.0
"""A slope over less than this after it has settled says nothing [s]."""

_HOUR_S = 3600.0


class Sample(NamedTuple):
    """What a process held [MB] at a time [s] since the run was begun."""

    at_s: float
    mb: float


def growth_mb_h(samples: Sequence[Sample], settles_s: float = SETTLES_S) -> float | None:
    """Slope [MB/h] of the least squares line through what comes after a process has settled.

    None where that is less than :data:`WATCHED_S`.

    >>> growth_mb_h([Sample(t, 80.0 + t / 1800.0) for t in range(0, 1200, 10)])
    2.0
    """
    settled = [each for each in samples if each.at_s >= settles_s]
    if not settled or settled[-1].at_s - settled[0].at_s < WATCHED_S * (1.0 - 1e-2):
        return None
    line = statistics.linear_regression([each.at_s for each in settled], [each.mb for each in settled])
    return round(_HOUR_S * line.slope, 6)
