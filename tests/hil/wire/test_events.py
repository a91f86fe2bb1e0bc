from __future__ import annotations

import hashlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.lockstep.lockstep import Lockstep
from hil.nodes.node import Outgoing
from hil.wire import events
from hil.wire.events import Event, digest
from tests.hil.nodes.test_estimator import NODE, PAIR, frame


@given(st.text(max_size=20), st.binary(max_size=200))
def test_an_event_is_called_by_topic_and_payload(topic: str, payload: bytes) -> None:
    expected = hashlib.blake2b(topic.encode() + b"\0" + payload, digest_size=8).digest()
    event = Event(topic, payload)
    assert event.digest == event.digest == digest(topic, payload) == int.from_bytes(expected, "little")
    # That it was asked for makes it no other event.
    assert event == Event(topic, payload)
    assert hash(event) == hash(Event(topic, payload))


def test_an_event_is_digested_once_for_all_who_take_it_in(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []

    def counting(topic: str, payload: bytes) -> int:
        made.append(topic)
        return digest(topic, payload)

    monkeypatch.setattr(events, "digest", counting)
    now_ns, event = frame(0, PAIR)
    lockstep = Lockstep([NODE, NODE, NODE], lambda message, at_ns: None, now_ns)
    lockstep.publish(Outgoing(event.topic, "", event.payload, now_ns))
    assert made == [event.topic]
