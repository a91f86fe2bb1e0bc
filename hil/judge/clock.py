"""How the motion capture's clock went beside the host's: offset, drift, jitter and jumps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import numpy as np
from numpy.typing import NDArray

from estimation.time.clock import NOTHING_HEARD, SLOT_NS, SPAN_NS, clock_rows, jitter_of
from estimation.time.delay_line import Arrival, lower_line
from formation.angles import FloatArray
from formation.lending import lent
from formation.records import Rows, columns_of, load, row_of, rows_of
from hil.judge.entries import sort_into_epochs
from hil.judge.epochs import ClockDesk, Folded, InEpoch
from hil.judge.run_data import RunData

Arrivals = NDArray[np.void]
"""Rows of :class:`estimation.time.delay_line.Arrival`."""


def arrival_rows(run_data: RunData) -> Arrivals:
    """All frames that the estimator could read, in the order of their reception."""
    if run_data.kept is not None:
        return run_data.kept.arrivals
    rows = columns_of(rows_of(Arrival, len(run_data.arrivals)))
    rows[:] = list(run_data.arrivals)
    return rows


def judge_clock(arrivals: Arrivals) -> dict[str, object]:
    """The ``clock`` part of a summary, from all frames in the order of their reception.

    ``offset_ms``: by how much the capture's clock is ahead of the host's at the end, less the least latency,
    which cannot be told from it: a good clock and 30 ms of latency give -30. ``drift_ppm``: by how much
    faster it runs; absent for a log of less than ten seconds. ``jitter_ms``: delays above the least one of
    each minute. ``jumps``: of more than 50 ms. Empty for logs whose frames were received as they were
    captured: these are recordings that do not tell.
    """
    if not np.any(arrivals["receive_ns"] != arrivals["capture_ns"]):
        return {}
    folded = row_of(Folded(NOTHING_HEARD, 0, 0))
    found = rows_of(InEpoch, len(arrivals))
    desk = ClockDesk(clock_rows(), cast("Rows[Arrival]", arrivals), found, folded)
    sort_into_epochs(lent(desk))
    clock, epochs, count = load(Folded, folded, 0)
    sorted_in = columns_of(found)[:count]
    above = [
        _above(part)
        for epoch in range(epochs + 1)
        for part in _parts(sorted_in["arrival"][sorted_in["epoch"] == epoch])
    ]
    spread = jitter_of(np.concatenate(above))
    return {
        "offset_ms": None if clock.offset is None else 1e3 * clock.offset,
        "drift_ppm": None if clock.drift is None else 1e6 * clock.drift,
        "jitter_ms": {"p50": 1e3 * spread.p50, "p99": 1e3 * spread.p99, "max": 1e3 * spread.largest},
        "jumps": clock.jumps,
    }


def _parts(epoch: Arrivals) -> Iterator[Arrivals]:
    """Arrivals by the minute of their capture."""
    if len(epoch):
        minutes = (epoch["capture_ns"] - epoch["capture_ns"][0]) // SPAN_NS
        for minute in np.unique(minutes).tolist():
            yield epoch[minutes == minute]


def _above(part: Arrivals) -> FloatArray:
    """Delays [s] above the line below the least ones of every second."""
    capture_ns, delays = part["capture_ns"], part["receive_ns"] - part["capture_ns"]
    slots = capture_ns // SLOT_NS
    order = np.lexsort((np.arange(len(part)), delays, slots))
    lowest = order[np.unique(slots[order], return_index=True)[1]]
    line = lower_line(list(zip(capture_ns[lowest].tolist(), delays[lowest].tolist(), strict=True)))
    grown = np.rint(line.slope * (capture_ns - line.capture_ns)).astype(np.int64)
    return np.asarray((delays - (line.delay_ns + grown)) * 1e-9, dtype=np.float64)
