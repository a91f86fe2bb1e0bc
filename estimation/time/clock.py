"""The clock of the motion capture against the host's: offset, drift, jitter, and jumps.

A frame that was captured at c by one clock and received at r by another has the delay r - c, which is the
offset between the clocks plus what the way took. The way is never shorter than some least latency, so the
delays lie above a straight line: its height is offset plus least latency, its slope the drift. Only this sum
can be observed: whoever knows the least latency may take it off. All that lies above the line is jitter.
The line is the one of Moon, Skelly and Towsley (INFOCOM 1999): below all delays, closest to them on average.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

SLOT_NS = 1_000_000_000
"""Of all delays of a second only the least counts, so that a line rests on few points."""

SPAN_NS = 60_000_000_000
"""How far back a line looks."""

DRIFT_SPAN_NS = 10_000_000_000
"""Drift is told apart from jitter only over this long or longer; until then it is taken for zero."""

LARGEST_DRIFT = 5e-4
"""No clock of a computer is worse; a line that were steeper would follow the network, not the clock."""

JUMP_NS = 50_000_000
"""Delays that change by less than this are the network's."""

_FEWEST = 5  # frames, over _SETTLING_NS or more, before the height of the line is known
_SETTLING_NS = 250_000_000
_JUMP_FRAMES = 5
_JUMP_SPAN_NS = 200_000_000
_ANEW = 1000  # numbers that fall back by more than this are not late but counted from the start again
_RECENT = 512  # delays kept for the jitter
_ROUNDING = 1e-6  # no clock is read more finely than this [s]


@dataclass(frozen=True, slots=True)
class Arrival:
    """A frame: its number, when it was captured by its own clock, and received by the host's."""

    number: int
    capture_ns: int
    receive_ns: int

    @property
    def delay_ns(self) -> int:
        """Reception minus capture, each by its own clock."""
        return self.receive_ns - self.capture_ns


@dataclass(frozen=True, slots=True)
class Line:
    """Least delay over capture time: ``delay_ns`` at ``capture_ns``, growing by the share ``slope``.

    ``error`` [s] of the delay at the newest point, and of the slope: how far the line may be off, infinite
    for a slope that there is too little to tell of. In integers, since a clock may count from anywhere.
    """

    capture_ns: int
    delay_ns: int
    slope: float
    error: float
    slope_error: float

    def at_ns(self, capture_ns: int) -> int:
        """Least delay at a capture time."""
        return self.delay_ns + round(self.slope * (capture_ns - self.capture_ns))

    def above(self, arrival: Arrival) -> float:
        """By how much an arrival took longer than the least delay [s]."""
        return (arrival.delay_ns - self.at_ns(arrival.capture_ns)) * 1e-9


@dataclass(frozen=True, slots=True)
class Jitter:
    """Delays above the least one [s]: median, 99th percentile, largest."""

    p50: float
    p99: float
    largest: float


@dataclass(frozen=True, slots=True)
class Clock:
    """What is known of the capture's clock. Make it by folding :func:`heard` over all arrivals.

    ``lowest``: the arrival of least delay of every second, oldest first, since the epoch began with the last
    jump. ``newest``: that of the latest capture. ``recent``: the last arrivals. ``suspects``: arrivals in a
    row that do not fit the epoch. ``line``: None before anything is known.
    """

    lowest: tuple[Arrival, ...] = ()
    newest: Arrival | None = None
    recent: tuple[Arrival, ...] = ()
    suspects: tuple[Arrival, ...] = ()
    frames: int = 0
    since_ns: int = 0
    jumps: int = 0
    line: Line | None = None

    @property
    def known(self) -> bool:
        """Whether enough has been heard to map capture times by the line."""
        if self.newest is None:
            return False
        return self.frames >= _FEWEST and self.newest.receive_ns - self.since_ns >= _SETTLING_NS

    @property
    def offset(self) -> float | None:
        """By how much [s] the capture's clock is ahead of the host's, less the least latency."""
        if self.line is None or self.newest is None:
            return None
        return -self.line.at_ns(self.newest.capture_ns) * 1e-9

    @property
    def drift(self) -> float | None:
        """By which share the capture's clock runs faster than the host's; None before it is known."""
        if self.line is None or math.isinf(self.line.slope_error):
            return None
        return -self.line.slope

    def jitter(self) -> Jitter | None:
        """How the last delays lie above the line, None without any."""
        if self.line is None or not self.recent:
            return None
        return jitter_of([max(0.0, self.line.above(each)) for each in self.recent])


NOTHING_HEARD = Clock()


def heard(clock: Clock, arrival: Arrival) -> Clock:
    """Clock with one more arrival, in the order of reception.

    A jump is recognised by five arrivals in a row over a fifth of a second that are more than 50 ms off on
    one side. Too early is nothing else. Too late can be a slow network, too: there the first one must have
    been captured more than 50 ms before one of a lower number, which no network does. Numbers that fall back
    far count anew; where all are the same, only time that runs backwards tells.
    """
    line, newest = clock.line, clock.newest
    if line is None or newest is None:
        return _begun((arrival,), clock.jumps)
    above = line.above(arrival)
    if abs(above) <= JUMP_NS * 1e-9 or not (clock.suspects or _cannot_be(arrival, newest, above)):
        return _joined(replace(clock, suspects=()) if clock.suspects else clock, arrival)
    same_side = [each for each in clock.suspects if (line.above(each) > 0.0) == (above > 0.0)]
    suspects = (*same_side[1 - _RECENT :], arrival)
    if len(suspects) >= _JUMP_FRAMES and arrival.receive_ns - suspects[0].receive_ns >= _JUMP_SPAN_NS:
        return _begun(suspects, clock.jumps + 1)
    return replace(clock, suspects=suspects)


def lower_line(points: Sequence[tuple[int, int]]) -> Line:
    """Line below points (capture_ns, delay_ns), in the order of capture, that is closest to them on average.

    It runs along the edge of their lower convex hull over their mean, unless that is steeper than a clock
    drifts; over less than ten seconds it is level. Its errors are taken from the mean distance of the points
    above it, the newest left out, whose slot goes on: that is about what the least delay of a single slot
    leaves, and twice as much is rare for a line that rests on several. Raises :class:`ValueError` without
    any point.
    """
    if not points:
        raise ValueError("no points; expected at least one")
    zero_ns, base_ns = points[-1]
    xs = [(capture_ns - zero_ns) * 1e-9 for capture_ns, _ in points]
    ys = [(delay_ns - base_ns) * 1e-9 for _, delay_ns in points]
    span = xs[-1] - xs[0]
    known = span >= DRIFT_SPAN_NS * 1e-9
    slope = max(-LARGEST_DRIFT, min(LARGEST_DRIFT, _edge_slope(xs, ys))) if known else 0.0
    height = min(y - slope * x for x, y in zip(xs, ys, strict=True))
    above = [y - slope * x - height for x, y in zip(xs, ys, strict=True)]
    error = 2.0 * sum(above[:-1] or above) / max(1, len(above) - 1) + _ROUNDING
    slope_error = 2.0 * error / span if known else math.inf
    return Line(zero_ns, base_ns + round(height * 1e9), slope, error, slope_error)


def jitter_of(above: Sequence[float]) -> Jitter:
    """Percentiles (nearest rank) of delays above the least one. Raises :class:`ValueError` without any."""
    if not above:
        raise ValueError("no delays; expected at least one")
    ranked = sorted(above)
    p50, p99 = (ranked[math.ceil(share * len(ranked)) - 1] for share in (0.5, 0.99))
    return Jitter(p50, p99, ranked[-1])


def _cannot_be(arrival: Arrival, newest: Arrival, above: float) -> bool:
    """Whether only a jump of the clock explains a delay that is so far off."""
    if above < 0.0:
        return True
    later = arrival.number >= newest.number or newest.number - arrival.number > _ANEW
    return later and arrival.capture_ns < newest.capture_ns - JUMP_NS


def _begun(arrivals: tuple[Arrival, ...], jumps: int) -> Clock:
    """A new epoch from the arrivals that belong to it."""
    clock = Clock(since_ns=arrivals[0].receive_ns, jumps=jumps)
    for arrival in arrivals:
        clock = _joined(clock, arrival)
    return clock


def _joined(clock: Clock, arrival: Arrival) -> Clock:
    """Clock with an arrival that belongs to its epoch."""
    lowest, line = clock.lowest, clock.line
    slot = arrival.capture_ns // SLOT_NS
    oldest_ns = arrival.capture_ns - SPAN_NS
    if not lowest or slot > lowest[-1].capture_ns // SLOT_NS:
        first = 0
        while first < len(lowest) and lowest[first].capture_ns < oldest_ns:
            first += 1
        lowest = (*lowest[first:], arrival)
    elif slot == lowest[-1].capture_ns // SLOT_NS and arrival.delay_ns < lowest[-1].delay_ns:
        lowest = (*lowest[:-1], arrival)
    if line is None or lowest is not clock.lowest:
        line = lower_line([(each.capture_ns, each.delay_ns) for each in lowest])
    newest = clock.newest
    if newest is None or arrival.capture_ns > newest.capture_ns:
        newest = arrival
    return replace(
        clock,
        lowest=lowest,
        newest=newest,
        recent=(*clock.recent[1 - _RECENT :], arrival),
        frames=clock.frames + 1,
        line=line,
    )


def _edge_slope(xs: Sequence[float], ys: Sequence[float]) -> float:
    """Slope of the edge of the lower convex hull that lies over the mean of the increasing xs."""
    hull: list[tuple[float, float]] = []
    for x, y in zip(xs, ys, strict=True):
        while len(hull) > 1:
            (ax, ay), (bx, by) = hull[-2:]
            if (bx - ax) * (y - ay) > (by - ay) * (x - ax):
                break
            hull.pop()
        hull.append((x, y))
    mean = sum(xs) / len(xs)
    for (ax, ay), (bx, by) in pairwise(hull):
        if bx >= mean:
            return (by - ay) / (bx - ax)
    return 0.0
