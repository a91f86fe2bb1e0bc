"""Capture times on the host's clock, when the motion capture's own clock goes otherwise."""

from __future__ import annotations

import bisect
from dataclasses import dataclass

from estimation.time.clock import NOTHING_HEARD, Arrival, Clock, heard

SPAN_NS = 1_000_000_000
"""How long the mapping of a capture is kept, so that a frame that comes late or again gets the same time."""

Knot = tuple[int, int]
"""A capture time on its own clock and on the host's."""


@dataclass(frozen=True, slots=True)
class HostTime:
    """A clock with the captures mapped lately; ``knots`` increase on both clocks."""

    clock: Clock = NOTHING_HEARD
    knots: tuple[Knot, ...] = ()


def on_host(times: HostTime, arrival: Arrival, latency_ns: int) -> tuple[HostTime, int | None]:
    """Take in an arrival, and tell its capture on the host's clock.

    That is its stamp plus the clock's least delay, less ``latency_ns``, the part of that which is known to be
    the way. The mapping grows with every newest capture and never changes behind it: it is strictly
    increasing, and what comes late is put linearly between its neighbours. None while the clock is not known,
    or may have jumped; a jump begins the mapping anew.
    """
    clock = heard(times.clock, arrival)
    knots = times.knots if clock.jumps == times.clock.jumps else ()
    if clock.line is None or clock.suspects or not clock.known:
        return HostTime(clock, knots), None
    capture_ns = arrival.capture_ns
    if knots and capture_ns <= knots[-1][0]:
        return HostTime(clock, knots), _between(knots, capture_ns)
    host_ns = capture_ns + clock.line.at_ns(capture_ns) - latency_ns
    if knots:
        host_ns = max(host_ns, knots[-1][1] + 1)
    first = bisect.bisect_left(knots, capture_ns - SPAN_NS, key=_capture_ns)
    return HostTime(clock, (*knots[first:], (capture_ns, host_ns))), host_ns


def _between(knots: tuple[Knot, ...], capture_ns: int) -> int:
    place = bisect.bisect_left(knots, capture_ns, key=_capture_ns)
    after_ns, after_host_ns = knots[place]
    if place == 0:
        return capture_ns + after_host_ns - after_ns
    before_ns, before_host_ns = knots[place - 1]
    share = (capture_ns - before_ns) / (after_ns - before_ns)
    return before_host_ns + round(share * (after_host_ns - before_host_ns))


def _capture_ns(knot: Knot) -> int:
    return knot[0]
