from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.recordings.time_column import LAST_NS, later, read_times

ONE, NONE = Decimal(1), Decimal(0)
MOMENT = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
MOMENT_NS = int(MOMENT.timestamp()) * 10**9 + 120_000_000


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("2026-01-02T03:04:05.12Z", "ISO 8601"),
        ("2026-01-02 03:04:05.12+00:00", "ISO 8601"),
        ("2026-01-02 05:04:05.12 +02:00", "ISO 8601"),
        ("2026-01-01T22:04:05.12-0500", "ISO 8601"),
        ("20260102T030405.12Z", "ISO 8601"),
        ("2026-01-02 03:04:05,120000000 UTC", "ISO 8601"),
        ("2026-01-02 03:04:05.12", "ISO 8601 without a zone, taken for UTC"),
        (f"{MOMENT_NS}", "nanoseconds since 1970"),
        (f"{MOMENT_NS // 1000}", "microseconds since 1970"),
        (f"{MOMENT_NS // 10**6}", "milliseconds since 1970"),
        (f"{Decimal(MOMENT_NS) / 10**9}", "seconds"),
        (f"{Decimal(MOMENT_NS) / 10**9:E}", "seconds"),
    ],
)
def test_a_moment_is_the_same_however_it_is_written(text: str, kind: str) -> None:
    found = read_times([text], ONE, NONE)
    assert (found.t_ns.tolist(), found.kind) == ([MOMENT_NS], kind)


@given(st.lists(st.integers(0, LAST_NS - 1), min_size=1), st.integers(-12, 14))
def test_dates_and_numbers_keep_every_nanosecond(times_ns: list[int], hours: int) -> None:
    zone = timezone(timedelta(hours=hours))
    dates = [
        f"{datetime.fromtimestamp(t // 10**9, zone):%Y-%m-%dT%H:%M:%S}.{t % 10**9:09d}{hours:+03d}:00"
        for t in times_ns
    ]
    assert read_times(dates, ONE, NONE).t_ns.tolist() == times_ns
    seconds = [f"{Decimal(t).scaleb(-9):f}" for t in times_ns]
    assert read_times(seconds, ONE, NONE).t_ns.tolist() == times_ns
    commas = [text.replace(".", ",") for text in seconds]
    assert read_times(commas, ONE, NONE, ",").t_ns.tolist() == times_ns
    # The same by way of a cell that is no plain number.
    assert read_times([*seconds, "1e0"], ONE, NONE).t_ns.tolist() == [*times_ns, 10**9]
    later_s = [f"{Decimal(t - 5 * 10**9).scaleb(-6):f}" for t in times_ns]
    assert read_times(later_s, Decimal("0.001"), Decimal(5)).t_ns.tolist() == times_ns


@pytest.mark.parametrize("text", ["", "x", "-1", "3e9", "nan", "inf", "1_0", "1e400", "0x1"])
def test_what_is_no_time_is_none(text: str) -> None:
    assert read_times(["1", text], ONE, NONE).t_ns.tolist() == [10**9, -1]


@pytest.mark.parametrize(
    "text", ["2026-13-02T03:04:05Z", "2026-01-02T25:04:05Z", "1969-12-31T23:59:59Z", "12"]
)
def test_what_is_no_date_of_ours_is_none(text: str) -> None:
    assert read_times(["2026-01-02T03:04:05Z", text], ONE, NONE).t_ns.tolist()[1] == -1


@given(st.lists(st.integers(-1, 20)))
def test_later_ones_are_those_above_all_before(values: list[int]) -> None:
    expected, newest = [], -1
    for value in values:
        expected.append(value > newest)
        newest = max(newest, value)
    assert later(np.array(values, dtype=np.int64)).tolist() == expected
