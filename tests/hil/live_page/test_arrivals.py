from __future__ import annotations

import pytest

from hil.live_page.arrivals import Arrivals
from hil.wire.events import NUMBERS, Event, Origin
from hil.wire.message_types import Odometry, String
from hil.wire.messages import encode


def heard(arrivals: Arrivals, now: float, number: int | None, sender: str = "7f") -> None:
    origin = None if number is None else Origin(sender, 1, number)
    arrivals.note(Event("odom", encode(String(data="?")), origin), now)


def rate(arrivals: Arrivals, now: float) -> float | None:
    arrival = arrivals.of("odom")
    assert arrival is not None
    return arrival.rate_hz(now)


def test_the_rate_is_that_of_all_messages_though_few_are_looked_at() -> None:
    arrivals = Arrivals()
    for look in range(40):
        heard(arrivals, 0.05 * look, (NUMBERS - 100 + 12 * look) % NUMBERS)
    assert rate(arrivals, 2.0) == pytest.approx(240.0)


def test_there_is_no_rate_of_who_does_not_number_of_two_and_of_who_is_silent() -> None:
    arrivals = Arrivals()
    heard(arrivals, 0.0, 1)
    heard(arrivals, 0.1, None)
    assert rate(arrivals, 0.1) is None
    heard(arrivals, 0.2, 5)
    heard(arrivals, 0.3, 900, sender="80")
    assert rate(arrivals, 0.3) is None
    heard(arrivals, 0.4, 901, sender="80")
    assert rate(arrivals, 0.4) == pytest.approx(10.0)
    assert rate(arrivals, 9.0) is None


def test_an_age_grows_until_something_comes() -> None:
    arrivals = Arrivals()
    assert arrivals.age_s("odom", 1.0) is None
    heard(arrivals, 1.0, 1)
    assert arrivals.age_s("odom", 3.5) == 2.5


def test_a_message_of_another_type_is_none() -> None:
    arrivals = Arrivals()
    heard(arrivals, 1.0, 1)
    arrival = arrivals.of("odom")
    assert arrival is not None
    assert arrival.read_as(Odometry) is None
