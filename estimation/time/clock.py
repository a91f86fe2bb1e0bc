"""The clock of the motion capture against the host's: offset, drift, jitter, and jumps.

A frame that was captured at c by one clock and received at r by another has the delay r - c, which is the
offset between the clocks plus what the way took. The way is never shorter than some least latency, so the
delays lie above a straight line: its height is offset plus least latency, its slope the drift. Only this sum
can be observed: whoever knows the least latency may take it off. All that lies above the line is jitter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from estimation.time.delay_line import Arrival, Corner, Line, line_below
from formation.angles import FloatArray
from formation.kernel import kernel
from formation.records import Rows, columns_of, load, rows_of, size, store
from formation.ring import EMPTY, Ring, place, without_oldest

SLOT_NS = 1_000_000_000
"""Of all delays of a second only the least counts, so that a line rests on few points."""

SPAN_NS = 60_000_000_000
"""How far back a line looks."""

JUMP_NS = 50_000_000
"""Delays that change by less than this are the network's."""

RECENT = 512
"""How many delays are kept for the jitter."""

_FEWEST = 5  # frames, over _SETTLING_NS or more, before the height of the line is known
_SETTLING_NS = 250_000_000
_JUMP_FRAMES = 5
_JUMP_SPAN_NS = 200_000_000
_ANEW = 1000  # numbers that fall back by more than this are not late but counted from the start again
_SLOTS = 64  # a power of two above what a line looks back over, the slot that is begun and its neighbour
_NS = 1e-9


class Jitter(NamedTuple):
    """Delays above the least one [s]: median, 99th percentile, largest."""

    p50: float
    p99: float
    largest: float


class Clock(NamedTuple):
    """What is known of the capture's clock. Make it by folding :func:`heard` over all arrivals.

    Where it is kept in :class:`ClockRows`: ``lowest``, the arrival of least delay of every second, oldest
    first, since the epoch began with the last jump; ``recent``, the last arrivals; ``suspects``, how many
    arrivals in a row do not fit the epoch. ``newest``: the arrival of the latest capture. ``begun``: whether
    there is one, and a line.
    """

    lowest: Ring
    recent: Ring
    suspects: int
    begun: bool
    newest: Arrival
    line: Line
    frames: int
    since_ns: int
    jumps: int

    @kernel
    def known(self) -> bool:
        """Whether enough has been heard to map capture times by the line."""
        return self.frames >= _FEWEST and self.newest.receive_ns - self.since_ns >= _SETTLING_NS

    @property
    def offset(self) -> float | None:
        """By how much [s] the capture's clock is ahead of the host's, less the least latency."""
        return -self.line.at_ns(self.newest.capture_ns) * _NS if self.begun else None

    @property
    def drift(self) -> float | None:
        """By which share the capture's clock runs faster than the host's; None before it is known."""
        return -self.line.slope if self.begun and math.isfinite(self.line.slope_error) else None


class ClockRows(NamedTuple):
    """Rows that a clock is kept in, and the ``hull`` of its points, to work in."""

    lowest: Rows[Arrival]
    recent: Rows[Arrival]
    suspects: Rows[Arrival]
    hull: Rows[Corner]


_NO_ARRIVAL = Arrival(0, 0, 0)
NOTHING_HEARD = Clock(
    EMPTY, EMPTY, 0, False, _NO_ARRIVAL, Line(0, 0, 0.0, math.inf, math.inf), frames=0, since_ns=0, jumps=0
)


def clock_rows(make: Callable[[type[Any], int], Rows[Any]] = rows_of) -> ClockRows:
    """Rows for a clock."""
    return ClockRows(
        make(Arrival, _SLOTS), make(Arrival, RECENT), make(Arrival, RECENT), make(Corner, _SLOTS)
    )


@kernel(inline=False)
def heard(clock: Clock, rows: ClockRows, arrival: Arrival) -> Clock:
    """Clock with one more arrival, in the order of reception.

    A jump is recognised by five arrivals in a row over a fifth of a second that are more than 50 ms off on
    one side. Too early is nothing else. Too late can be a slow network, too: there the first one must have
    been captured more than 50 ms before one of a lower number, which no network does. Numbers that fall back
    far count anew; where all are the same, only time that runs backwards tells.
    """
    if not clock.begun:
        return _joined(clock._replace(since_ns=arrival.receive_ns), rows, arrival)
    above = clock.line.above(arrival)
    fits = abs(above) <= JUMP_NS * _NS
    if fits or not (clock.suspects > 0 or _cannot_be(arrival, clock.newest, above)):
        return _joined(clock._replace(suspects=0), rows, arrival)
    count = _suspected(clock, rows, arrival, above)
    first_ns = load(Arrival, rows.suspects, 0).receive_ns
    if count < _JUMP_FRAMES or arrival.receive_ns - first_ns < _JUMP_SPAN_NS:
        return clock._replace(suspects=count)
    anew = clock._replace(
        lowest=Ring(0, 0),
        recent=Ring(0, 0),
        suspects=0,
        begun=False,
        frames=0,
        since_ns=first_ns,
        jumps=clock.jumps + 1,
    )
    for k in range(count):
        anew = _joined(anew, rows, load(Arrival, rows.suspects, k))
    return anew


@kernel
def _suspected(clock: Clock, rows: ClockRows, arrival: Arrival, above: float) -> int:
    """Put an arrival to the suspects that are off on the same side; returns how many there are now."""
    first = 1 if clock.suspects >= size(rows.suspects) else 0
    count = 0
    for k in range(first, clock.suspects):
        suspect = load(Arrival, rows.suspects, k)
        if (clock.line.above(suspect) > 0.0) == (above > 0.0):
            store(rows.suspects, count, suspect)
            count += 1
    store(rows.suspects, count, arrival)
    return count + 1


@kernel
def _cannot_be(arrival: Arrival, newest: Arrival, above: float) -> bool:
    """Whether only a jump of the clock explains a delay that is so far off."""
    if above < 0.0:
        return True
    later = arrival.number >= newest.number or newest.number - arrival.number > _ANEW
    return later and arrival.capture_ns < newest.capture_ns - JUMP_NS


@kernel(inline=False)
def _joined(clock: Clock, rows: ClockRows, arrival: Arrival) -> Clock:
    """Clock with an arrival that belongs to its epoch."""
    lowest, newest, line = clock.lowest, clock.newest, clock.line
    slot, changed = arrival.capture_ns // SLOT_NS, not clock.begun
    last = _NO_ARRIVAL
    if lowest.length > 0:
        last = load(Arrival, rows.lowest, place(lowest, rows.lowest, lowest.length - 1))
    if lowest.length == 0 or slot > last.capture_ns // SLOT_NS:
        oldest_ns, dropped = arrival.capture_ns - SPAN_NS, 0
        while dropped < lowest.length and _captured(rows.lowest, lowest, dropped) < oldest_ns:
            dropped += 1
        lowest = without_oldest(lowest, rows.lowest, dropped)
        store(rows.lowest, place(lowest, rows.lowest, lowest.length), arrival)
        lowest, changed = Ring(lowest.first, lowest.length + 1), True
    elif slot == last.capture_ns // SLOT_NS and arrival.delay() < last.delay():
        store(rows.lowest, place(lowest, rows.lowest, lowest.length - 1), arrival)
        changed = True
    if changed:
        line = line_below(rows.lowest, lowest, rows.hull)
    if not clock.begun or arrival.capture_ns > newest.capture_ns:
        newest = arrival
    recent = clock.recent
    if recent.length == size(rows.recent):
        recent = without_oldest(recent, rows.recent, 1)
    store(rows.recent, place(recent, rows.recent, recent.length), arrival)
    return clock._replace(
        lowest=lowest,
        recent=Ring(recent.first, recent.length + 1),
        begun=True,
        newest=newest,
        line=line,
        frames=clock.frames + 1,
    )


@kernel
def _captured(rows: Rows[Arrival], ring: Ring, k: int) -> int:
    return load(Arrival, rows, place(ring, rows, k)).capture_ns


def arrivals_in(rows: Rows[Arrival], ring: Ring) -> list[Arrival]:
    """Arrivals of a ring, the oldest first."""
    return [load(Arrival, rows, place(ring, rows, k)) for k in range(ring.length)]


def jitter(clock: Clock, rows: ClockRows) -> Jitter | None:
    """How the last delays lie above the line, None without any."""
    if not clock.begun:
        return None
    kept = columns_of(rows.recent)
    recent = kept[(clock.recent.first + np.arange(clock.recent.length)) & (len(kept) - 1)]
    grown = np.rint(clock.line.slope * (recent["capture_ns"] - clock.line.capture_ns)).astype(np.int64)
    delays = recent["receive_ns"] - recent["capture_ns"]
    return jitter_of(np.maximum(0.0, (delays - (clock.line.delay_ns + grown)) * _NS))


def jitter_of(above: Sequence[float] | FloatArray) -> Jitter:
    """Percentiles (nearest rank) of delays above the least one. Raises :class:`ValueError` without any."""
    ranked = np.sort(np.asarray(above, dtype=np.float64))
    if not len(ranked):
        raise ValueError("no delays; expected at least one")
    p50, p99 = (float(ranked[math.ceil(share * len(ranked)) - 1]) for share in (0.5, 0.99))
    return Jitter(p50, p99, float(ranked[-1]))
