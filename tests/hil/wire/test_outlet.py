"""Publishers number what they send, and others can tell by whom it was sent."""

from __future__ import annotations

import time

from hypothesis import given
from hypothesis import strategies as st

from hil.wire.events import NUMBERS, Event, Origin
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint


def test_messages_tell_their_session_and_publisher_and_are_numbered_one_by_one() -> None:
    with reserved_endpoint() as endpoint:
        router = open_session(Endpoints(listen=endpoint))
        sessions = [open_session(Endpoints(connect=endpoint)) for _ in range(2)]
        wires = [Wire(session) for session in sessions]
        hearing = Wire(router)
        hearing.subscribe(["a", "b"])
        heard: list[Event] = []
        until = time.monotonic() + 20.0
        while len(heard) < 60 and time.monotonic() < until:
            for wire in wires:
                for topic in ("a", "b"):
                    wire.publish(topic, b"x")
            while (event := hearing.inbox.take(0.01)) is not None:
                heard.append(event)
        names = {str(session.zid()) for session in sessions}
        origins = [event.origin for event in heard if event.origin is not None]
        assert len(origins) == len(heard) >= 60
        assert {origin.session for origin in origins} == names
        assert len({origin.sender for origin in origins}) == 4
        for sender in {origin.sender for origin in origins}:
            numbers = [origin.number for origin in origins if origin.sender == sender]
            assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
        for wire in (*wires, hearing):
            wire.close()
        for session in (*sessions, router):
            close_session(session)


def test_who_does_not_say_who_he_is_has_no_origin() -> None:
    with reserved_endpoint() as endpoint:
        router = open_session(Endpoints(listen=endpoint))
        hearing = Wire(router)
        hearing.subscribe(["a"])
        stranger = open_session(Endpoints(connect=endpoint))
        stranger.put("a", b"x")
        heard = hearing.inbox.take(10.0)
        assert heard is not None
        assert heard.payload == b"x"
        assert heard.origin is None
        hearing.close()
        for session in (stranger, router):
            close_session(session)


@given(st.integers(0, 2**32 - 1), st.integers(1, 2**31 - 1))
def test_numbers_go_on_past_their_end(number: int, more: int) -> None:
    earlier, later = Origin("a", 1, number), Origin("a", 1, (number + more) % NUMBERS)
    assert later.is_after(earlier)
    assert not earlier.is_after(later)
    assert not earlier.is_after(earlier)
