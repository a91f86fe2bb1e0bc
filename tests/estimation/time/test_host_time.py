from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from estimation.time.delay_line import Arrival
from estimation.time.host_time import NO_TIME_YET, HostTime, Knot, TimeRows, on_host, time_rows
from formation.records import load
from formation.ring import place

MS = 1_000_000
LATENCY_NS = 30 * MS
HOST_NS = 1_700_000_000_000_000_000


def frames(seconds: float, jitter: float, jump_at: float = 1e9) -> list[tuple[Arrival, int]]:
    """Frames of a clock that counts from its own start, with their true capture on the host's clock."""
    delays, made = np.random.default_rng(3).exponential(1.0, round(seconds * 120)) * jitter, []
    for k, delay in enumerate(delays.tolist()):
        at_ns = round(k / 120 * 1e9)
        stamp_ns = round(at_ns * (1.0 + 5e-5)) + (7_000 * MS if at_ns > jump_at * 1e9 else 0)
        receive_ns = HOST_NS + at_ns + LATENCY_NS + round(delay * 1e9)
        made.append((Arrival(k, stamp_ns, receive_ns), HOST_NS + at_ns))
    return sorted(made, key=lambda item: item[0].receive_ns)


def told(times: HostTime, rows: TimeRows, arrival: Arrival) -> tuple[HostTime, int | None]:
    found = on_host(times, rows, arrival, LATENCY_NS)
    return found.times, found.host_ns if found.known else None


@pytest.mark.parametrize("jitter", [0.0, 0.003])
def test_captures_are_told_on_the_clock_of_the_host(jitter: float) -> None:
    times, rows, errors = NO_TIME_YET, time_rows(), []
    for arrival, true_ns in frames(20.0, jitter):
        times, found_ns = told(times, rows, arrival)
        if found_ns is not None:
            errors.append((found_ns - true_ns) * 1e-9)
    assert len(errors) > 2350
    assert max(map(abs, errors)) < 6e-4
    assert max(map(abs, errors[1500:])) < 1e-4


def test_what_comes_late_or_again_keeps_its_place_in_time() -> None:
    times, rows = NO_TIME_YET, time_rows()
    mapped: dict[int, int] = {}
    sent = [each for each, _ in frames(3.0, 0.02)]
    again = [each for k, each in enumerate(sent) if k % 7 == 0]
    for arrival in sorted([*sent, *again], key=lambda each: each.receive_ns):
        times, found_ns = told(times, rows, arrival)
        if found_ns is None:
            continue
        assert mapped.get(arrival.capture_ns, found_ns) == pytest.approx(found_ns, abs=1e3)
        mapped[arrival.capture_ns] = found_ns
    in_order = [mapped[capture_ns] for capture_ns in sorted(mapped)]
    assert all(before < after for before, after in pairwise(in_order))
    newest = max(sent, key=lambda each: each.capture_ns)
    assert told(times, rows, newest)[1] == mapped[newest.capture_ns]
    assert times.knots.length < 125


def test_a_jump_leaves_a_gap_and_no_step() -> None:
    times, rows, found = NO_TIME_YET, time_rows(), []
    for arrival, true_ns in frames(4.0, 0.001, jump_at=2.0):
        times, found_ns = told(times, rows, arrival)
        if found_ns is not None:
            found.append((true_ns, found_ns))
    assert times.clock.jumps == 1
    assert max(abs(found_ns - true_ns) for true_ns, found_ns in found) < 2 * MS
    assert max(b - a for (a, _), (b, _) in pairwise(found)) < 320 * MS


def knots(times: HostTime, rows: TimeRows) -> list[Knot]:
    """Captures that are mapped, oldest first."""
    ring = times.knots
    return [load(Knot, rows.knots, place(ring, rows.knots, k)) for k in range(ring.length)]


def shown(k: int, capture_ns: int, delay_ns: int = 0) -> Arrival:
    """Frame of a clock that goes as the host's does, from another begin."""
    return Arrival(k, capture_ns, HOST_NS + capture_ns + LATENCY_NS + delay_ns)


def steady(captures: list[int]) -> tuple[HostTime, TimeRows]:
    times, rows = NO_TIME_YET, time_rows()
    for k, capture_ns in enumerate(captures):
        times, _ = told(times, rows, shown(k, capture_ns))
    return times, rows


def test_captures_are_kept_for_exactly_a_second() -> None:
    captures = [k * 50 * MS for k in range(60)]
    times, rows = steady(captures)
    assert knots(times, rows) == [Knot(each, HOST_NS + each) for each in captures[-21:]]
    # A nanosecond later the oldest is too old.
    times, found_ns = told(times, rows, shown(60, captures[-1] + 1))
    assert found_ns == HOST_NS + captures[-1] + 1
    assert [knot.capture_ns for knot in knots(times, rows)] == [*captures[-20:], captures[-1] + 1]


def test_of_more_captures_than_there_is_room_for_the_newest_are_kept() -> None:
    captures = [*(k * 50 * MS for k in range(6)), *(300 * MS + k * 1000 for k in range(2100))]
    times, rows = steady(captures)
    assert [knot.capture_ns for knot in knots(times, rows)] == captures[-2048:]


def test_what_comes_late_is_put_linearly_between_its_neighbours() -> None:
    times, rows = steady([k * 50 * MS for k in range(10)])
    # The line sinks by what comes 8 ms sooner than any before, and with it the newest capture.
    times, found_ns = told(times, rows, shown(10, 540 * MS, -8 * MS))
    assert found_ns == HOST_NS + 532 * MS
    before, after = knots(times, rows)[-2:]
    assert (before.capture_ns, after.capture_ns) == (450 * MS, 540 * MS)
    for late_ns, host_ns in ((450 * MS + 1, 450 * MS + 1), (480 * MS, 450 * MS + 82 * MS // 3)):
        assert told(times, rows, shown(9, late_ns, 60 * MS))[1] == pytest.approx(HOST_NS + host_ns, abs=1)
    assert knots(times, rows)[-2:] == [before, after]


def test_what_was_captured_before_all_that_is_kept_is_as_far_ahead_of_the_oldest() -> None:
    times, rows = steady([k * 50 * MS for k in range(60)])
    first = knots(times, rows)[0]
    _, found_ns = told(times, rows, shown(60, first.capture_ns - 7 * MS, 45 * MS))
    assert found_ns == first.host_ns - 7 * MS


def test_host_times_increase_though_the_line_sinks_by_more_than_a_frame() -> None:
    times, rows = steady([k * 50 * MS for k in range(10)])
    times, found_ns = told(times, rows, shown(10, 455 * MS, -20 * MS))
    assert found_ns == HOST_NS + 450 * MS + 1
