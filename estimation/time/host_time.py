"""Capture times on the host's clock, when the motion capture's own clock goes otherwise."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from estimation.time.clock import NOTHING_HEARD, Clock, ClockRows, clock_rows, heard
from estimation.time.delay_line import Arrival
from formation.kernel import kernel
from formation.records import Rows, load, rows_of, size, store
from formation.ring import EMPTY, Ring, place, without_oldest

SPAN_NS = 1_000_000_000
"""How long the mapping of a capture is kept, so that a frame that comes late or again gets the same time."""

_MOST = 2048  # captures mapped within that; a power of two


class Knot(NamedTuple):
    """A capture time on its own clock and on the host's."""

    capture_ns: int
    host_ns: int


class HostTime(NamedTuple):
    """A clock with the captures mapped lately; ``knots`` increase on both clocks."""

    clock: Clock
    knots: Ring


class TimeRows(NamedTuple):
    """Rows that it is kept in."""

    clock: ClockRows
    knots: Rows[Knot]


class Mapped(NamedTuple):
    """What is known after an arrival; its capture on the host's clock, where ``known``."""

    times: HostTime
    known: bool
    host_ns: int


NO_TIME_YET = HostTime(NOTHING_HEARD, EMPTY)


def time_rows(make: Callable[[type[Any], int], Rows[Any]] = rows_of) -> TimeRows:
    """Rows for a mapping of time."""
    return TimeRows(clock_rows(make), make(Knot, _MOST))


@kernel(inline=False)
def on_host(times: HostTime, rows: TimeRows, arrival: Arrival, latency_ns: int) -> Mapped:
    """Take in an arrival, and tell its capture on the host's clock.

    That is its stamp plus the clock's least delay, less ``latency_ns``, the part of that which is known to be
    the way. The mapping grows with every newest capture and never changes behind it: it is strictly
    increasing, and what comes late is put linearly between its neighbours. Not known while the clock is not,
    or may have jumped; a jump begins the mapping anew.
    """
    clock, knots, capture_ns = heard(times.clock, rows.clock, arrival), times.knots, arrival.capture_ns
    if clock.jumps != times.clock.jumps:
        knots = Ring(0, 0)
    if clock.suspects > 0 or not clock.known():
        return Mapped(HostTime(clock, knots), False, 0)
    host_ns = capture_ns + clock.line.at_ns(capture_ns) - latency_ns
    if knots.length > 0:
        newest = _knot(rows.knots, knots, knots.length - 1)
        if capture_ns <= newest.capture_ns:
            return Mapped(HostTime(clock, knots), True, _between(rows.knots, knots, capture_ns))
        host_ns = max(host_ns, newest.host_ns + 1)
    outdated = _since(rows.knots, knots, capture_ns - SPAN_NS)
    if knots.length - outdated == size(rows.knots):
        outdated += 1
    knots = without_oldest(knots, rows.knots, outdated)
    store(rows.knots, place(knots, rows.knots, knots.length), Knot(capture_ns, host_ns))
    return Mapped(HostTime(clock, Ring(knots.first, knots.length + 1)), True, host_ns)


@kernel
def _knot(rows: Rows[Knot], knots: Ring, k: int) -> Knot:
    return load(Knot, rows, place(knots, rows, k))


@kernel
def _since(rows: Rows[Knot], knots: Ring, capture_ns: int) -> int:
    """How many knots are of captures before a time."""
    low, high = 0, knots.length
    while low < high:
        middle = (low + high) // 2
        if _knot(rows, knots, middle).capture_ns < capture_ns:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def _between(rows: Rows[Knot], knots: Ring, capture_ns: int) -> int:
    """Time by the host's clock of a capture that is not newer than the newest knot."""
    k = _since(rows, knots, capture_ns)
    after = _knot(rows, knots, k)
    if k == 0:
        return capture_ns + after.host_ns - after.capture_ns
    before = _knot(rows, knots, k - 1)
    share = (capture_ns - before.capture_ns) / (after.capture_ns - before.capture_ns)
    return before.host_ns + round(share * (after.host_ns - before.host_ns))
