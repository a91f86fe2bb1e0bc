"""Cycles that came late: commands on a capture, against when such commands come."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_FEWEST = 3
"""Commands without which no usual wait is known."""


def judge_cycles(captured_ns: NDArray[np.int64], issued_ns: NDArray[np.int64]) -> dict[str, Any]:
    """Of the first commands on captures, in order: how many, and how many came late; empty for too few.

    ``captured_ns``, ``issued_ns``: shape (n,). A command is late if it comes more than one period of the
    captures after the usual (median) wait: the next capture's was due by then. Arrivals that are late are not
    told apart from nodes that are. ``limit_ms``: that wait; ``longest_ms``: the longest.

    >>> captured = np.arange(5) * 10_000_000
    >>> judge_cycles(captured, captured + np.array([4, 4, 4, 25, 4]) * 1_000_000)
    {'count': 5, 'late': 1, 'limit_ms': 14.0, 'longest_ms': 25.0}
    """
    if len(captured_ns) < _FEWEST:
        return {}
    waits_ms = (issued_ns - captured_ns) * 1e-6
    limit_ms = float(np.median(waits_ms) + np.median(np.diff(np.sort(captured_ns))) * 1e-6)
    return {
        "count": len(waits_ms),
        "late": int(np.count_nonzero(waits_ms > limit_ms)),
        "limit_ms": limit_ms,
        "longest_ms": float(np.max(waits_ms)),
    }
