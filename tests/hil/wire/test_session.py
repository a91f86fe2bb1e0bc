"""Sessions: who answers, who does not, and what is written wrongly."""

from __future__ import annotations

import json
import socket
import time
from pathlib import Path

import pytest
from zenoh import Session

from hil.errors import AbreastError, UsageError
from hil.wire.events import Event
from hil.wire.pubsub import INBOX_LIMIT, Inbox, Wire
from hil.wire.session import (
    Endpoints,
    GaveUpError,
    NoRouterError,
    close_session,
    open_session,
    reserved_endpoint,
)

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
        asked.append(len(asked) >= 2)
        return asked[-1]

    with pytest.raises(GaveUpError) as ended:
        open_session(Endpoints(connect="tcp/127.0.0.1:1"), patience=3600.0, give_up=give_up)
    assert ended.value.exit_code == 130
    assert asked[-1]


def test_a_config_file_waits_for_the_router_as_well(tmp_path: Path) -> None:
    with reserved_endpoint() as endpoint:
        (tmp_path / "zenoh.json5").write_text(json.dumps({"connect": {"endpoints": [endpoint]}}))
        came: list[Session] = []

        def answer() -> bool:
            """The router comes up once we have waited for it."""
            if not came:
                came.append(open_session(Endpoints(listen=endpoint)))
            return False

        session = open_session(Endpoints(config_file=tmp_path / "zenoh.json5"), PATIENCE, answer)
    try:
        assert [str(each) for each in session.info.routers_zid()] == [str(came[0].zid())]
    finally:
        for each in (session, *came):
            close_session(each)


@pytest.mark.parametrize("mode", ["client", "peer", "router"])
def test_a_config_file_whose_router_is_missing_says_so(mode: str, tmp_path: Path) -> None:
    config = {"mode": mode, "connect": {"endpoints": ["tcp/127.0.0.1:1"]}}
    (tmp_path / "zenoh.json5").write_text(json.dumps(config))
    with pytest.raises(NoRouterError, match=r"zenoh.json5: no session .* is the router up"):
        open_session(Endpoints(config_file=tmp_path / "zenoh.json5"), patience=0.3)


def test_who_connects_and_listens_says_whom_it_misses() -> None:
    with (
        reserved_endpoint() as endpoint,
        pytest.raises(NoRouterError, match=r"tcp/127\.0\.0\.1:1: no session"),
    ):
        open_session(Endpoints(connect="tcp/127.0.0.1:1", listen=endpoint), patience=0.3)


def test_a_port_that_is_taken_is_said() -> None:
    with reserved_endpoint() as endpoint:
        router = open_session(Endpoints(listen=endpoint))
    try:
        with pytest.raises(NoRouterError, match=f"somebody may listen at {endpoint} already"):
            open_session(Endpoints(listen=endpoint))
    finally:
        close_session(router)


def test_who_accepts_and_says_nothing_is_no_router() -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        endpoint = f"tcp/127.0.0.1:{mute.getsockname()[1]}"
        with pytest.raises(NoRouterError, match="somebody is there, who lets nobody in like this"):
            open_session(Endpoints(connect=endpoint), patience=0.1)


def test_a_config_file_that_names_nobody_is_refused(tmp_path: Path) -> None:
    (tmp_path / "zenoh.json5").write_text("{ mode: 'peer' }")
    with pytest.raises(UsageError, match="it names nobody to connect to"):
        open_session(Endpoints(config_file=tmp_path / "zenoh.json5"))


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
