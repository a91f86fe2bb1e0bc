"""The wire of a daemon, between two sessions on loopback."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from hil.wire.events import OVERSIZED, Event
from hil.wire.pubsub import LARGEST_PAYLOAD_BYTES, Inbox, Wire
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint

PATIENCE = 60.0
TOPICS = ("a", "b/c", "d")


@contextmanager
def wires() -> Iterator[tuple[Wire, Wire]]:
    """One that speaks and one that listens to :data:`TOPICS`."""
    with reserved_endpoint() as endpoint:
        router = open_session(Endpoints(listen=endpoint))
        session = open_session(Endpoints(connect=endpoint))
        mouth, ear = Wire(session), Wire(router)
        try:
            ear.subscribe(TOPICS)
            yield mouth, ear
        finally:
            for wire in (mouth, ear):
                wire.close()
            for each in (session, router):
                close_session(each)


def test_payloads_lie_in_the_inbox_in_the_order_in_which_they_came_over_all_topics() -> None:
    sent = [(TOPICS[7 * k % 3], str(k).encode()) for k in range(300)]
    heard: list[tuple[str, bytes]] = []
    with wires() as (mouth, ear):
        # What a session sends before it knows of a listener goes nowhere.
        for topic in TOPICS:
            while ear.inbox.take(0.1) is None:
                mouth.publish(topic, b"hello")
        for topic, payload in sent:
            mouth.publish(topic, payload)
        while len(heard) < len(sent):
            event = ear.inbox.take(PATIENCE)
            assert event is not None
            if event.payload != b"hello":
                heard.append((event.topic, event.payload))
    assert heard == sent


def test_a_waiting_inbox_can_be_woken() -> None:
    with wires() as (_, wire):
        wire.wake()
        event = wire.inbox.take(PATIENCE)
    assert event is not None
    assert event.topic == ""


def test_a_payload_beyond_all_measure_is_not_taken_and_said_to_have_come() -> None:
    with wires() as (mouth, ear):
        while ear.inbox.take(0.1) is None:
            mouth.publish("a", b"hello")
        mouth.publish("a", bytes(LARGEST_PAYLOAD_BYTES + 1))
        mouth.publish("a", bytes(LARGEST_PAYLOAD_BYTES))
        heard: list[bytes] = []
        while len(heard) < 2:
            event = ear.inbox.take(PATIENCE)
            assert event is not None
            heard += [event.payload] * (event.payload != b"hello")
    assert heard[0] is OVERSIZED
    assert heard[1] == bytes(LARGEST_PAYLOAD_BYTES)


def test_what_waits_is_bounded_in_bytes_too() -> None:
    inbox, large = Inbox(), Event("a", bytes(LARGEST_PAYLOAD_BYTES))
    for _ in range(100):
        inbox.put(large)
    assert inbox.dropped == 100 - 64
    assert inbox.take(0.0) == large
    inbox.put(Event("a", b"small"))
    taken = [inbox.take(0.0) for _ in range(65)]
    assert taken[:63] == [large] * 63
    assert taken[63] == Event("a", b"small")
    assert taken[64] is None
    inbox.put(large)
    assert inbox.take(0.0) == large
    assert inbox.dropped == 36
