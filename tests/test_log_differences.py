from __future__ import annotations

import math
from dataclasses import replace

from hil.wire.message_types import Command, Consumed, RangeBearing
from hil.wire.messages import encode, header, to_time, typename_of
from tests.log_differences import Sent, differences

START_NS = 1_000_000_000_000


def sighting(at_ns: int, rho: float, alpha2: float = 1.5, frame: str = "follower") -> Sent:
    message = RangeBearing(header(START_NS + at_ns, frame), rho, alpha2)
    return Sent(typename_of(message), encode(message), START_NS + at_ns)


def command(digest: int, v: float = 0.1) -> Sent:
    receipts = [Consumed(digest, to_time(START_NS))]
    message = Command(
        header(START_NS, ""), to_time(1), to_time(2), v, 0.2, v, 0.4, True, "stale", False, receipts
    )
    return Sent(typename_of(message), encode(message), START_NS)


SERIES = [sighting(number * 10_000_000, 0.2) for number in range(5)]


def test_the_same_messages_do_not_differ() -> None:
    nan = [sighting(0, math.nan)]
    for exactly in (True, False):
        assert differences({"a": SERIES, "b": nan}, {"b": [*nan], "a": [*SERIES]}, exactly=exactly) == []


def test_a_line_tells_how_many_differ_since_when_and_by_how_much() -> None:
    now = [*SERIES[:2], sighting(20_000_000, 0.2005), SERIES[3], sighting(40_000_000, 0.2, 1.499)]
    for exactly in (True, False):
        assert differences({"a": SERIES}, {"a": now}, exactly=exactly) == [
            "a: 2 of 5 differ, first at 0.020 s, by at most 0.001"
        ]


def test_the_last_bit_differs_to_the_bit_only() -> None:
    now = [*SERIES[:4], sighting(40_000_000, math.nextafter(0.2, 1.0))]
    assert differences({"a": SERIES}, {"a": now}, exactly=False) == []
    (line,) = differences({"a": SERIES}, {"a": now}, exactly=True)
    assert line == "a: 1 of 5 differ, first at 0.040 s, by at most 2.78e-17"


def test_large_numbers_may_differ_by_more_and_infinite_ones_not_at_all() -> None:
    was = {"a": [sighting(0, 1e6)]}
    assert not differences(was, {"a": [sighting(0, 1e6 + 5e-4)]}, exactly=False)
    assert differences(was, {"a": [sighting(0, 1e6 + 5e-3)]}, exactly=False)
    for value in (math.inf, math.nan):
        (line,) = differences(was, {"a": [sighting(0, value)]}, exactly=False)
        assert line.endswith("by at most inf")
        assert differences({"a": [sighting(0, value)]}, was, exactly=False)


def test_digests_count_to_the_bit_only() -> None:
    was, now = {"c": [command(1)]}, {"c": [command(2)]}
    assert differences(was, now, exactly=False) == []
    assert differences(was, now, exactly=True) == ["c: 1 of 1 differ, first at 0.000 s, by at most 0"]


def test_times_differ_in_seconds_and_by_a_nanosecond_within_the_tolerance() -> None:
    was = {"a": [sighting(0, 0.2)]}
    assert not differences(was, {"a": [sighting(1, 0.2)]}, exactly=False)
    (line,) = differences(was, {"a": [sighting(2_000_000, 0.2)]}, exactly=False)
    assert line.endswith("by at most 0.002")


def test_another_text_or_type_is_more_than_numbers() -> None:
    was = {"a": [sighting(0, 0.2)]}
    for other in (sighting(0, 0.2, frame="else"), command(1), replace(was["a"][0], payload=b"")):
        (line,) = differences(was, {"a": [other]}, exactly=False)
        assert line == "a: 1 of 1 differ, first at 0.000 s, by at most 0, in more than numbers"


def test_what_is_lacking_or_too_many_differs() -> None:
    assert differences({"a": SERIES}, {"a": SERIES[:3]}, exactly=False) == [
        "a: 2 of 5 differ, first at 0.030 s, 5 were, 3 are"
    ]
    assert differences({"a": SERIES}, {"a": SERIES, "b": SERIES[:1]}, exactly=False) == [
        "b: 1 of 1 differ, first at 0.000 s, 0 were, 1 are"
    ]
