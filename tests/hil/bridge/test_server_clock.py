"""A server's clock by echoes over networks that are slow, uneven and lossy."""

from __future__ import annotations

import random

import pytest

from hil.bridge.server_clock import ServerClock

MS = 1_000_000
S = 1_000_000_000
T0 = 1_700_000_000 * S
FREQUENCY = 3_312_787


def ticks_at(host_ns: int, drift: float = 0.0, ahead_ns: int = 5 * S) -> int:
    """A server that was switched on some days before."""
    since = host_ns - T0
    return (since + round(drift * since) + ahead_ns + 100_000 * S) * FREQUENCY // S


def synchronised(
    drift: float, way_ms: tuple[float, float], seconds: float = 30.0, seed: int = 1
) -> tuple[ServerClock, int]:
    """A clock after echoes every half second, and the time of the last one.

    ``way_ms``: least time of each way, and mean of what comes on top.
    """
    chance, clock, now = random.Random(seed), ServerClock(FREQUENCY), T0
    least, more = way_ms

    def way_ns() -> int:
        return round((least + (chance.expovariate(1.0 / more) if more else 0.0)) * MS)

    for k in range(round(2 * seconds)):
        sent = T0 + k * S // 2
        there = sent + way_ns()
        now = there + way_ns()
        assert clock.hear(sent, now, ticks_at(there, drift))
    return clock, now


@pytest.mark.parametrize("drift", [0.0, 30e-6, -80e-6])
@pytest.mark.parametrize("way_ms", [(0.05, 0.0), (0.1, 0.05), (1.0, 3.0)])
def test_a_time_of_the_server_is_found_to_a_part_of_the_quickest_way(
    drift: float, way_ms: tuple[float, float]
) -> None:
    clock, now = synchronised(drift, way_ms)
    for ahead_s in (-5.0, 0.0, 0.4):
        at = now + round(ahead_s * S)
        error_ms = abs(clock.host_ns(ticks_at(at, drift)) - at) / MS
        assert error_ms < 0.02 + 0.2 * way_ms[1]
    assert clock.drift == pytest.approx(-drift, abs=2e-6 + 30e-6 * way_ms[1])
    assert clock.jumps == 0


def test_the_first_echo_is_right_to_half_its_round_trip() -> None:
    clock = ServerClock(FREQUENCY)
    assert not clock.known
    assert clock.round_trip_ns == -1
    clock.hear(T0, T0 + 4 * MS, ticks_at(T0 + MS))
    assert clock.known
    assert clock.round_trip_ns == 4 * MS
    assert abs(clock.host_ns(ticks_at(T0 + MS)) - (T0 + MS)) <= 2 * MS


def test_a_quick_echo_after_a_slow_first_one_is_believed_at_once() -> None:
    clock = ServerClock(FREQUENCY)
    clock.hear(T0, T0 + 160 * MS, ticks_at(T0 + 159 * MS))
    at = T0 + 200 * MS
    assert abs(clock.host_ns(ticks_at(at)) - at) == pytest.approx(79 * MS, abs=MS)
    clock.hear(at, at + 200_000, ticks_at(at + 100_000))
    assert abs(clock.host_ns(ticks_at(at)) - at) < 20_000
    assert clock.jumps == 0


def test_slow_echoes_among_quick_ones_do_no_harm() -> None:
    clock, now = synchronised(0.0, (0.1, 0.0))
    for k in range(1, 20):
        sent = now + k * S
        clock.hear(sent, sent + 40 * MS, ticks_at(sent + 39 * MS))
        clock.hear(sent + 100 * MS, sent + 100 * MS + 200_000, ticks_at(sent + 100 * MS + 100_000))
    at = now + 20 * S
    assert abs(clock.host_ns(ticks_at(at)) - at) < 20_000
    assert clock.jumps == 0


def test_a_server_that_was_started_anew_is_believed_at_its_third_echo() -> None:
    clock, now = synchronised(0.0, (0.1, 0.0))
    for k in range(1, 4):
        at = now + k * S
        wrong = abs(clock.host_ns(ticks_at(at, ahead_ns=0)) - at)
        assert wrong == pytest.approx(5 * S, abs=MS)
        clock.hear(at, at + 200_000, ticks_at(at + 100_000, ahead_ns=0))
    assert clock.jumps == 1
    at = now + 4 * S
    assert abs(clock.host_ns(ticks_at(at, ahead_ns=0)) - at) < 50_000


def test_one_wild_echo_is_not_believed() -> None:
    clock, now = synchronised(0.0, (0.1, 0.0))
    for k in range(1, 8):
        at = now + k * S
        clock.hear(at, at + 200_000, ticks_at(at + 100_000, ahead_ns=(5 if k % 3 else 1000) * S))
    at = now + 8 * S
    assert clock.jumps == 0
    assert abs(clock.host_ns(ticks_at(at)) - at) < 50_000


def test_an_answer_before_its_question_is_none() -> None:
    clock = ServerClock(FREQUENCY)
    assert not clock.hear(T0, T0 - 1, ticks_at(T0))
    assert not clock.known


def test_a_minute_is_remembered() -> None:
    clock, now = synchronised(0.0, (0.1, 0.0))
    for k in range(1, 200):
        sent = now + k * S
        clock.hear(sent, sent + 4 * MS, ticks_at(sent + 2 * MS))
    assert clock.round_trip_ns == 4 * MS
