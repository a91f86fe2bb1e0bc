"""Sample window: what was measured of late, by capture time, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class SampleWindow:
    """Measured ``values`` of shape (n, k) at increasing ``capture_ns`` (n,)."""

    capture_ns: NDArray[np.int64]
    values: FloatArray

    def ends_at(self, capture_ns: int) -> bool:
        """Whether the newest measurement is of this capture time."""
        return len(self.capture_ns) > 0 and int(self.capture_ns[-1]) == capture_ns


EMPTY_WINDOW = SampleWindow(np.empty(0, dtype=np.int64), np.empty((0, 0)))


def with_measurement(
    window: SampleWindow, capture_ns: int, values: Sequence[float], span_ns: int
) -> SampleWindow:
    """One measurement more at its place, and none that is older than the newest by more than the span.

    Of two with the same capture time the first stays.
    """
    times = window.capture_ns
    if len(times) == 0:
        return SampleWindow(np.array([capture_ns]), np.array([values], dtype=np.float64))
    place = int(np.searchsorted(times, capture_ns))
    if place < len(times):
        if times[place] == capture_ns or capture_ns < times[-1] - span_ns:
            return window
        return SampleWindow(
            np.insert(times, place, capture_ns), np.insert(window.values, place, values, axis=0)
        )
    first = int(np.searchsorted(times, capture_ns - span_ns))
    kept = place - first
    longer, more = np.empty(kept + 1, dtype=np.int64), np.empty((kept + 1, len(values)))
    longer[:kept], longer[kept] = times[first:], capture_ns
    more[:kept], more[kept] = window.values[first:], values
    return SampleWindow(longer, more)
