"""Least delay of frames over their capture time: a line below all delays, closest to them on average.

It is the one of Moon, Skelly and Towsley (INFOCOM 1999).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from formation.kernel import kernel
from formation.records import Rows, load, rows_of, store
from formation.ring import Ring, place

DRIFT_SPAN_NS = 10_000_000_000
"""Drift is told apart from jitter only over this long or longer; until then it is taken for zero."""

LARGEST_DRIFT = 5e-4
"""No clock of a computer is worse; a line that were steeper would follow the network, not the clock."""

_ROUNDING = 1e-6  # no clock is read more finely than this [s]
_NS = 1e-9


class Arrival(NamedTuple):
    """A frame: its number, when it was captured by its own clock, and received by the host's."""

    number: int
    capture_ns: int
    receive_ns: int

    @kernel
    def delay(self) -> int:
        """Reception minus capture, each by its own clock [ns]."""
        return self.receive_ns - self.capture_ns


class Line(NamedTuple):
    """Least delay over capture time: ``delay_ns`` at ``capture_ns``, growing by the share ``slope``.

    ``error`` [s] of the delay at the newest point, and of the slope: how far the line may be off, infinite
    for a slope that there is too little to tell of. In integers, since a clock may count from anywhere.
    """

    capture_ns: int
    delay_ns: int
    slope: float
    error: float
    slope_error: float

    @kernel
    def at_ns(self, capture_ns: int) -> int:
        """Least delay at a capture time."""
        return self.delay_ns + round(self.slope * (capture_ns - self.capture_ns))

    @kernel
    def above(self, arrival: Arrival) -> float:
        """By how much an arrival took longer than the least delay [s]."""
        return (arrival.delay() - self.at_ns(arrival.capture_ns)) * _NS


class Corner(NamedTuple):
    """A point of a hull: capture [s] after some moment, and delay [s] above some other."""

    x: float
    y: float


@kernel(inline=False)
def line_below(rows: Rows[Arrival], ring: Ring, hull: Rows[Corner]) -> Line:
    """Line below the arrivals of a ring, at least one; ``hull``: as many rows, to work in.

    It runs along the edge of their lower convex hull over their mean, unless that is steeper than a clock
    drifts; over less than ten seconds it is level. Its errors are taken from the mean distance of the points
    above it, the newest left out, whose slot goes on: that is about what the least delay of a single slot
    leaves, and twice as much is rare for a line that rests on several.
    """
    count = ring.length
    zero = load(Arrival, rows, place(ring, rows, count - 1))
    span = -_corner(rows, ring, 0, zero).x
    known, slope = span >= DRIFT_SPAN_NS * _NS, 0.0
    if known:
        slope = max(-LARGEST_DRIFT, min(LARGEST_DRIFT, _edge_slope(rows, ring, zero, hull)))
    height = math.inf
    for k in range(count):
        corner = _corner(rows, ring, k, zero)
        height = min(height, corner.y - slope * corner.x)
    total = 0.0
    for k in range(max(1, count - 1)):
        corner = _corner(rows, ring, k, zero)
        total += corner.y - slope * corner.x - height
    error = 2.0 * total / max(1, count - 1) + _ROUNDING
    slope_error = 2.0 * error / span if known else math.inf
    return Line(zero.capture_ns, zero.delay() + round(height * 1e9), slope, error, slope_error)


@kernel
def _corner(rows: Rows[Arrival], ring: Ring, k: int, zero: Arrival) -> Corner:
    """The k-th arrival beside that which counts as zero."""
    each = load(Arrival, rows, place(ring, rows, k))
    return Corner((each.capture_ns - zero.capture_ns) * _NS, (each.delay() - zero.delay()) * _NS)


@kernel
def _edge_slope(rows: Rows[Arrival], ring: Ring, zero: Arrival, hull: Rows[Corner]) -> float:
    """Slope of the edge of the lower convex hull that lies over the mean of the increasing captures."""
    corners, total = 0, 0.0
    for k in range(ring.length):
        new = _corner(rows, ring, k, zero)
        total += new.x
        while corners > 1:
            a, b = load(Corner, hull, corners - 2), load(Corner, hull, corners - 1)
            if (b.x - a.x) * (new.y - a.y) > (b.y - a.y) * (new.x - a.x):
                break
            corners -= 1
        store(hull, corners, new)
        corners += 1
    mean = total / ring.length
    for k in range(corners - 1):
        a, b = load(Corner, hull, k), load(Corner, hull, k + 1)
        if b.x >= mean:
            return (b.y - a.y) / (b.x - a.x)
    return 0.0


def lower_line(points: Sequence[tuple[int, int]]) -> Line:
    """The line of a clock that has points (capture_ns, delay_ns), at most one for a second, in their order.

    Raises :class:`ValueError` without any point.
    """
    if not points:
        raise ValueError("no points; expected at least one")
    arrivals = [
        Arrival(k, capture_ns, capture_ns + delay_ns) for k, (capture_ns, delay_ns) in enumerate(points)
    ]
    room = 1 << len(arrivals).bit_length()
    rows = rows_of(Arrival, room)
    for k, arrival in enumerate(arrivals):
        store(rows, k, arrival)
    return line_below(rows, Ring(0, len(arrivals)), rows_of(Corner, room))
