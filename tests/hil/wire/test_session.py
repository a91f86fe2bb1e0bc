"""Sessions: who answers, who does not, and what is written wrongly."""

from __future__ import annotations

import socket
import time
from pathlib import Path

import pytest

from hil.errors import AbreastError, UsageError
from hil.wire.events import Event
from hil.wire.pubsub import INBOX_LIMIT, Inbox, Wire
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint

PATIENCE = 60.0


def test_what_one_client_publishes_another_receives_in_order() -> None:
    with reserved_endpoint() as endpoint:
        sessions = [open_session(Endpoints(listen=endpoint))]
    sessions += [open_session(Endpoints(connect=endpoint)) for _ in range(2)]
    sender, receiver = Wire(sessions[1], urgent=("a",)), Wire(sessions[2])
    try:
        receiver.subscribe(("a", "b/c"))
        sent = [Event("b/c", bytes([number])) for number in range(100)]
        calls = {Event("a", b"are you there"), Event("b/c", b"are you there")}
        heard: set[Event | None] = set()
        deadline = time.monotonic() + PATIENCE
        while not heard >= calls and time.monotonic() < deadline:
            for call in calls:
                sender.publish(call.topic, call.payload)
            heard.add(receiver.inbox.take(0.05))
        for event in sent:
            sender.publish(event.topic, event.payload)
        received: list[Event] = []
        while len(received) < len(sent) and (arrival := receiver.inbox.take(PATIENCE)) is not None:
            received += [arrival] if arrival not in calls else []
        assert received == sent
    finally:
        for wire in (sender, receiver):
            wire.close()
        for session in reversed(sessions):
            close_session(session)


def test_a_reserved_port_is_given_to_nobody_else() -> None:
    with reserved_endpoint() as endpoint, socket.socket() as other:
        host, _, port = endpoint.removeprefix("tcp/").partition(":")
        with pytest.raises(OSError, match="in use"):
            other.bind((host, int(port)))


def test_nobody_at_the_endpoint_is_said_with_its_name() -> None:
    with pytest.raises(AbreastError, match=r"tcp/127\.0\.0\.1:1: no session .* is the router up"):
        open_session(Endpoints(connect="tcp/127.0.0.1:1"), patience=0.3)


def test_an_end_that_is_asked_for_is_not_waited_out() -> None:
    asked: list[bool] = []

    def give_up() -> bool:
        asked.append(len(asked) == 2)
        return asked[-1]

    with pytest.raises(AbreastError):
        open_session(Endpoints(connect="tcp/127.0.0.1:1"), patience=3600.0, give_up=give_up)
    assert asked == [False, False, True]


@pytest.mark.parametrize("endpoint", ["nonsense", "tcp:127.0.0.1:7447", "tcp/", "", "TCP/127.0.0.1:1"])
def test_a_mistyped_endpoint_is_refused_with_an_example(endpoint: str) -> None:
    with pytest.raises(UsageError, match="such as tcp/127"):
        Endpoints(connect=endpoint)


def test_a_config_file_that_is_not_there_is_named() -> None:
    with pytest.raises(UsageError, match="no_such_config"):
        open_session(Endpoints(config_file=Path("no_such_config.json5")))


def test_an_inbox_that_is_full_drops_and_counts() -> None:
    inbox = Inbox()
    for _ in range(INBOX_LIMIT + 3):
        inbox.put(Event("a"))
    assert inbox.dropped == 3
    assert inbox.take(0.0) == Event("a")
