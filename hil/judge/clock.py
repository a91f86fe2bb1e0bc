"""How the motion capture's clock went beside the host's: offset, drift, jitter and jumps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from estimation.time.clock import (
    NOTHING_HEARD,
    SLOT_NS,
    SPAN_NS,
    arrivals_in,
    clock_rows,
    heard,
    jitter_of,
)
from estimation.time.delay_line import Arrival, Line, lower_line
from formation.records import plain_rows_of


def judge_clock(arrivals: Sequence[Arrival]) -> dict[str, object]:
    """The ``clock`` part of a summary, from all frames in the order of their reception.

    ``offset_ms``: by how much the capture's clock is ahead of the host's at the end, less the least latency,
    which cannot be told from it: a good clock and 30 ms of latency give -30. ``drift_ppm``: by how much
    faster it runs; absent for a log of less than ten seconds. ``jitter_ms``: delays above the least one of
    each minute. ``jumps``: of more than 50 ms. Empty for logs whose frames were received as they were
    captured: these are recordings that do not tell.
    """
    if not any(each.delay() for each in arrivals):
        return {}
    epochs: list[list[Arrival]] = [[]]
    clock, rows = NOTHING_HEARD, clock_rows(plain_rows_of)
    for arrival in arrivals:
        before, clock = clock, heard(clock, rows, arrival)
        if clock.jumps > before.jumps:
            epochs.append(arrivals_in(rows.recent, clock.recent))
        elif not clock.suspects:
            epochs[-1].append(arrival)
    above: list[float] = []
    for epoch in epochs:
        for part in _parts(epoch):
            line = _line(part)
            above += [line.above(each) for each in part]
    spread = jitter_of(above)
    return {
        "offset_ms": None if clock.offset is None else 1e3 * clock.offset,
        "drift_ppm": None if clock.drift is None else 1e6 * clock.drift,
        "jitter_ms": {"p50": 1e3 * spread.p50, "p99": 1e3 * spread.p99, "max": 1e3 * spread.largest},
        "jumps": clock.jumps,
    }


def _parts(epoch: Sequence[Arrival]) -> Iterator[list[Arrival]]:
    """Arrivals by the minute of their capture."""
    parts: dict[int, list[Arrival]] = {}
    for each in epoch:
        parts.setdefault((each.capture_ns - epoch[0].capture_ns) // SPAN_NS, []).append(each)
    yield from parts.values()


def _line(part: Sequence[Arrival]) -> Line:
    lowest: dict[int, Arrival] = {}
    for each in part:
        slot = each.capture_ns // SLOT_NS
        if slot not in lowest or each.delay() < lowest[slot].delay():
            lowest[slot] = each
    return lower_line([(lowest[slot].capture_ns, lowest[slot].delay()) for slot in sorted(lowest)])
