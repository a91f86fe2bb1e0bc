from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from estimation.time.clock import (
    NOTHING_HEARD,
    Clock,
    ClockRows,
    arrivals_in,
    clock_rows,
    heard,
    jitter,
    jitter_of,
)
from estimation.time.delay_line import LARGEST_DRIFT, Arrival, lower_line
from formation.records import copy_of

BEGIN_NS = 1_700_000_000_000_000_000
MS = 1_000_000
LATENCY_NS = 30 * MS


def arrivals(
    delays: Sequence[float], rate: float = 120.0, offset: float = 0.0, drift: float = 0.0, first: int = 0
) -> list[Arrival]:
    """Frames with the given delays [s] above the latency, in the order of reception."""
    made = []
    for k, delay in enumerate(delays, start=first):
        true_ns = BEGIN_NS + round(k / rate * 1e9)
        capture_ns = true_ns + round((offset + drift * k / rate) * 1e9)
        made.append(Arrival(k, capture_ns, true_ns + LATENCY_NS + round(delay * 1e9)))
    return sorted(made, key=lambda each: each.receive_ns)


class Known:
    """A clock with rows of its own."""

    def __init__(self, before: Known | None = None) -> None:
        self.clock: Clock = NOTHING_HEARD
        self.rows: ClockRows = clock_rows()
        if before:
            lowest, recent, suspects, hull = before.rows
            self.clock = before.clock
            self.rows = ClockRows(copy_of(lowest), copy_of(recent), copy_of(suspects), hull)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.clock, name)

    def hear(self, arrival: Arrival) -> None:
        self.clock = heard(self.clock, self.rows, arrival)

    @property
    def lowest(self) -> list[Arrival]:
        return arrivals_in(self.rows.lowest, self.clock.lowest)

    @property
    def recent(self) -> list[Arrival]:
        return arrivals_in(self.rows.recent, self.clock.recent)


def folded(heard_of: Sequence[Arrival], before: Known | None = None) -> Known:
    known = Known(before)
    for arrival in heard_of:
        known.hear(arrival)
    return known


@pytest.mark.parametrize("kind", ["exponential", "uniform", "gamma"])
@pytest.mark.parametrize(("rate", "jitter"), [(120.0, 0.001), (120.0, 0.02), (10.0, 0.005)])
def test_offset_and_drift_are_found_within_the_errors_stated(kind: str, rate: float, jitter: float) -> None:
    for seed in range(3):
        generator, count = np.random.default_rng(seed), round(15.0 * rate)
        drawn = {
            "exponential": generator.exponential(jitter, count),
            "uniform": generator.uniform(0.0, 2.0 * jitter, count),
            "gamma": generator.gamma(2.0, 0.5 * jitter, count),
        }[kind]
        clock = folded(arrivals(drawn.tolist(), rate, offset=5.0, drift=5e-5))
        ahead = 5.0 + 5e-5 * (clock.newest.number / rate) - LATENCY_NS * 1e-9
        assert clock.offset == pytest.approx(ahead, abs=clock.line.error)
        assert clock.drift == pytest.approx(5e-5, abs=clock.line.slope_error)
        assert clock.line.error < 1.5 * jitter
        assert clock.jumps == 0


def test_jitter_is_told_by_its_percentiles() -> None:
    delays = np.random.default_rng(4).exponential(0.005, 3000).tolist()
    clock = folded(arrivals(delays))
    found = jitter(clock.clock, clock.rows)
    assert found is not None
    assert found.p50 == pytest.approx(0.005 * np.log(2.0), rel=0.15)
    assert found.p99 == pytest.approx(0.005 * np.log(100.0), rel=0.3)
    assert jitter_of([3.0, 1.0, 2.0]).largest == 3.0


@pytest.mark.parametrize("drift", [-1e-4, 1e-4])
def test_jitter_is_what_lies_above_a_line_that_drifts(drift: float) -> None:
    """By nearest rank: of two thirds of the delays the median, of more than one in a hundred the p99."""
    clock = folded(arrivals([0.0, 0.004, 0.004] * 500, drift=drift))
    found = jitter(clock.clock, clock.rows)
    assert found == pytest.approx((0.004, 0.004, 0.004), abs=2e-6)
    rest = folded(arrivals([0.0, 0.004, 0.0] * 500, drift=drift))
    found = jitter(rest.clock, rest.rows)
    assert found == pytest.approx((0.0, 0.004, 0.004), abs=2e-6)


def test_little_is_known_at_the_begin_and_a_steady_delay_tells_all() -> None:
    assert not folded(arrivals([0.0] * 20)).known()
    early = folded(arrivals([0.0] * 120))
    assert early.known()
    assert early.drift is None
    late = folded(arrivals([0.0] * 2400, drift=-2e-5))
    assert late.drift == pytest.approx(-2e-5, abs=1e-7)
    for nothing in (NOTHING_HEARD.offset, NOTHING_HEARD.drift, jitter(NOTHING_HEARD, clock_rows())):
        assert nothing is None


@pytest.mark.parametrize("jump", [-10.0, -0.3, -0.08, 0.08, 3.0, 3600.0])
@pytest.mark.parametrize("jitter", [0.0, 0.004])
def test_a_clock_that_jumps_begins_anew_within_a_third_of_a_second(jump: float, jitter: float) -> None:
    delays = np.random.default_rng(5).exponential(1.0, 800) * jitter
    before = folded(arrivals(delays[:600].tolist(), offset=1.0))
    after = arrivals(delays[600:].tolist(), offset=1.0 + jump, first=600)
    at_once, later = folded(after[:12], before), folded(after[:40], before)
    assert (before.jumps, at_once.jumps, later.jumps) == (0, 0, 1)
    assert later.offset == pytest.approx(1.0 + jump - LATENCY_NS * 1e-9, abs=3e-3)
    assert folded(after, before).jumps == 1


def test_a_clock_that_begins_anew_with_its_numbers_has_jumped() -> None:
    before = folded(arrivals([0.0] * 2400, offset=100.0))
    after = [
        Arrival(each.number - 2400, each.capture_ns - 120_000 * MS, each.receive_ns)
        for each in arrivals([0.0] * 60, offset=100.0, first=2400)
    ]
    assert folded(after, before).jumps == 1


def shuffled() -> list[float]:
    return list(np.random.default_rng(6).uniform(0.0, 0.1, 2400))


def stalled() -> list[float]:
    """Once in two seconds nothing comes for 0.4 s, then all at once."""
    return [max(0.0, 0.4 - (k % 240) / 120.0) for k in range(2400)]


def slower_for_a_while() -> list[float]:
    return [0.0] * 800 + [0.3] * 800 + [0.0] * 800


def slower_and_shaken() -> list[float]:
    return [0.0] * 800 + list(np.random.default_rng(7).uniform(0.06, 0.2, 1600))


@pytest.mark.parametrize("network", [shuffled, stalled, slower_for_a_while, slower_and_shaken])
def test_a_network_at_its_worst_is_no_jump(network: Callable[[], list[float]]) -> None:
    clock = folded(arrivals(network(), offset=-2.0, drift=1e-5))
    assert clock.jumps == 0
    assert clock.offset == pytest.approx(-2.0 + 1e-5 * 20.0 - 0.03, abs=0.011)


def test_single_stamps_gone_wrong_are_no_jump_and_move_nothing() -> None:
    made = arrivals([0.0] * 1200)
    wrong = [
        Arrival(each.number, each.capture_ns + (-1) ** k * 5_000 * MS, each.receive_ns)
        if k % 40 == 7
        else each
        for k, each in enumerate(made)
    ]
    clock = folded(wrong)
    assert clock.jumps == 0
    assert clock.offset == pytest.approx(-LATENCY_NS * 1e-9, abs=1e-6)


@given(
    st.lists(st.integers(0, 40 * MS), min_size=12, max_size=40),
    st.integers(0, 10**18),
    st.floats(-4e-4, 4e-4),
)
def test_the_line_is_the_best_one_below_all_points(excess: list[int], zero_ns: int, slope: float) -> None:
    points = [
        (zero_ns + k * 1000 * MS, round(slope * k * 1000 * MS) + extra) for k, extra in enumerate(excess)
    ]
    found = lower_line(points)
    t = np.arange(len(points), dtype=np.float64)
    d = np.array([delay_ns for _, delay_ns in points]) * 1e-6
    gaps = d - np.array([found.at_ns(capture_ns) for capture_ns, _ in points]) * 1e-6
    assert gaps.min() > -2e-6
    # The same as a linear program: the highest mean of a line that is nowhere above a point (in ms).
    best = linprog(
        [-1.0, -t.mean()],
        A_ub=np.column_stack([np.ones_like(t), t]),
        b_ub=d,
        bounds=[(None, None), (-1e3 * LARGEST_DRIFT, 1e3 * LARGEST_DRIFT)],
    )
    assert d.mean() - gaps.mean() == pytest.approx(-float(best.fun or 0.0), abs=1e-4)


def test_lines_and_percentiles_need_something_to_go_by() -> None:
    with pytest.raises(ValueError, match="no points"):
        lower_line([])
    with pytest.raises(ValueError, match="no delays"):
        jitter_of([])


def shown(k: int, capture_ns: int, delay_ns: int) -> Arrival:
    return Arrival(k, capture_ns, capture_ns + delay_ns)


def test_exactly_the_last_minute_is_kept_and_of_each_second_the_least_delay() -> None:
    second = 1_000_000_000
    begin_ns = 1_700_000_000 * second
    made = []
    for k in range(150):
        made += [
            shown(2 * k, begin_ns + k * second, (20 + k % 7) * MS),
            shown(2 * k + 1, begin_ns + k * second + second // 2, (20 + (k + 3) % 7) * MS),
        ]
    clock = folded([])
    for arrival in made:
        clock.hear(arrival)
        now_s = arrival.capture_ns // second
        slots: dict[int, list[Arrival]] = {}
        for each in made[: arrival.number + 1]:
            slots.setdefault(each.capture_ns // second, []).append(each)
        least = [min(those, key=lambda each: each.delay()) for those in slots.values()]
        # What is older than a minute leaves when a new second begins, and not before.
        begun_ns = slots[now_s][0].capture_ns - 60 * second
        assert clock.lowest == [each for each in least if each.capture_ns >= begun_ns]
    assert clock.frames == 300
    assert len(clock.recent) == 300


def test_a_frame_that_comes_out_of_order_leaves_the_newest_alone_and_counts_as_one() -> None:
    made = arrivals([0.0] * 240)
    clock = folded(made[:200] + made[201:])
    late = shown(200, made[200].capture_ns, LATENCY_NS + 12 * MS)
    after = folded([late], clock)
    assert after.newest == clock.newest == made[-1]
    assert after.frames == clock.frames + 1
    assert after.recent[-1] == late
    assert after.lowest == clock.lowest
    again = folded([made[-1]._replace(number=999)], after)
    assert again.newest == made[-1]


def test_of_the_delays_the_last_512_are_kept() -> None:
    made = arrivals([0.0] * 700)
    assert folded(made).recent == made[-512:]


def test_it_is_known_after_five_frames_over_a_quarter_of_a_second() -> None:
    quarter = 250 * MS

    def spread(count: int, span_ns: int) -> Known:
        step = span_ns // (count - 1)
        captures = [BEGIN_NS + k * step for k in range(count - 1)] + [BEGIN_NS + span_ns]
        return folded([shown(k, at_ns, LATENCY_NS) for k, at_ns in enumerate(captures)])

    assert spread(5, quarter).known()
    assert not spread(4, quarter).known()
    assert not spread(5, quarter - 1).known()
    assert not NOTHING_HEARD.known()


def test_drift_is_told_over_ten_seconds_and_no_less() -> None:
    def line(span_ns: int) -> list[tuple[int, int]]:
        return [(BEGIN_NS, 0), (BEGIN_NS + span_ns, 100_000)]

    long = lower_line(line(10_000 * MS))
    assert long.slope == pytest.approx(1e-5, rel=1e-9)
    assert long.at_ns(BEGIN_NS) == 0
    assert long.error == pytest.approx(1e-6, rel=1e-9)
    assert long.slope_error == pytest.approx(2e-7, rel=1e-9)
    short = lower_line(line(10_000 * MS - 1))
    assert (short.slope, short.at_ns(BEGIN_NS), short.slope_error) == (0.0, 0, np.inf)
    assert short.error == pytest.approx(1e-6, rel=1e-9)


@pytest.mark.parametrize("sign", [-1, 1])
def test_no_line_is_steeper_than_a_clock_drifts(sign: int) -> None:
    points = [(BEGIN_NS + k * 1000 * MS, sign * k * 2 * MS) for k in range(13)]
    assert lower_line(points).slope == sign * 5e-4


def test_the_error_of_a_line_is_twice_the_mean_distance_of_what_lies_above_it() -> None:
    heights = [0, 3 * MS, 0, 6 * MS, 50 * MS]
    points = [(BEGIN_NS + k * 1000 * MS, height) for k, height in enumerate(heights)]
    # The slot of the newest point goes on, so that it does not count.
    assert lower_line(points).error == pytest.approx(2.0 * 9e-3 / 4.0 + 1e-6, rel=1e-9)
    assert lower_line(points[:1]).error == pytest.approx(1e-6, rel=1e-9)


def test_percentiles_are_of_nearest_rank() -> None:
    found = jitter_of([float(k) for k in range(200, 0, -1)])
    assert (found.p50, found.p99, found.largest) == (100.0, 198.0, 200.0)


def late_ones(count: int, span_ns: int, above_ns: int, back_ns: int = 0) -> list[Arrival]:
    """So many arrivals over a span, all delayed beyond the line, with captures that lie back."""
    begin_ns = BEGIN_NS + 5_000 * MS
    made = []
    for k in range(count):
        receive_ns = begin_ns + k * span_ns // (count - 1)
        made.append(Arrival(600 + k, receive_ns - LATENCY_NS - above_ns - back_ns, receive_ns))
    return made


def test_a_jump_is_five_frames_over_a_fifth_of_a_second_by_more_than_50_ms() -> None:
    before = folded(arrivals([0.0] * 601))
    fifth = 200 * MS
    for count, span_ns, early_ns, jumps in (
        (5, fifth, 51 * MS, 1),
        (4, fifth, 51 * MS, 0),
        (5, fifth - 1, 51 * MS, 0),
        (5, fifth, 50 * MS, 0),
    ):
        assert folded(late_ones(count, span_ns, -early_ns), before).jumps == jumps, (count, span_ns)


def test_what_is_late_has_jumped_only_if_captured_long_before_one_of_a_lower_number() -> None:
    before = folded(arrivals([0.0] * 601))
    assert folded(late_ones(5, 200 * MS, 200 * MS), before).jumps == 1
    # Held up on the way, and in order: the network's doing.
    slow = [
        Arrival(601 + k, BEGIN_NS + 5_010 * MS + k * MS, BEGIN_NS + 5_300 * MS + k * 60 * MS)
        for k in range(5)
    ]
    assert folded(slow, before).jumps == 0
    assert folded(slow, before).suspects == 0


def test_suspects_on_the_other_side_and_good_frames_begin_the_count_again() -> None:
    before = folded(arrivals([0.0] * 601))
    early, late = late_ones(5, 200 * MS, -80 * MS), late_ones(5, 200 * MS, 80 * MS)
    mixed = [early[0], late[1], early[2], late[3], early[4]]
    assert folded(mixed, before).jumps == 0
    assert folded(mixed, before).suspects == 1
    good = shown(700, early[2].receive_ns - LATENCY_NS, LATENCY_NS)
    assert folded([*early[:2], good], before).suspects == 0
    assert folded([*early[:2], good, *early[2:]], before).jumps == 0


def test_after_a_jump_the_epoch_is_made_of_the_frames_that_showed_it() -> None:
    before = folded(arrivals([0.0] * 601))
    early = late_ones(5, 200 * MS, -80 * MS)
    after = folded(early, before)
    assert (after.frames, after.since_ns, after.recent) == (5, early[0].receive_ns, early)
    assert after.newest == early[-1]
