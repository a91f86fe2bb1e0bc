"""The time of another session's host, asked for over the wire."""

from __future__ import annotations

import time

from hypothesis import given
from hypothesis import strategies as st

from hil.wire.clock_query import ClockQuery, ahead_of_us, tell_time
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint
from hil.wire.undeclare import undeclare

NS = st.integers(0, 10**9)


@given(st.integers(-(10**10), 10**10), NS, NS)
def test_what_is_measured_is_off_by_no_more_than_it_says(ahead_ns: int, way_ns: int, back_ns: int) -> None:
    asked_ns = 10**18
    told_ns, heard_ns = asked_ns + way_ns + ahead_ns, asked_ns + way_ns + back_ns
    seen_s, error_s = ahead_of_us(asked_ns, told_ns, heard_ns)
    assert abs(seen_s - ahead_ns * 1e-9) <= error_s + 1e-9


def test_a_session_tells_its_time_and_one_that_does_not_is_not_known() -> None:
    with reserved_endpoint() as endpoint:
        router = open_session(Endpoints(listen=endpoint))
        other = open_session(Endpoints(connect=endpoint))
        clock, query, who = tell_time(other), ClockQuery(router), str(other.zid())
        until = time.monotonic() + 30.0
        while (ahead_s := query.ahead_s(who)) is None and time.monotonic() < until:
            query.ask(who)
            time.sleep(0.05)
        assert ahead_s is not None
        # On one machine: less than what half the way there and back leaves open.
        assert abs(ahead_s) < 0.05
        assert query.ahead_s("somebody") is None
        query.ask("somebody")
        assert query.ahead_s(who) is None
        undeclare(clock)
        for session in (other, router):
            close_session(session)
