"""Who is connected to a router and shows no part in the lab."""

from __future__ import annotations

import time

from hil.wire.key_layout import OURS
from hil.wire.pubsub import Wire
from hil.wire.router_clients import RouterClients
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint


def test_a_client_that_shows_nothing_is_a_suspect_with_its_address_and_others_are_not() -> None:
    with reserved_endpoint() as endpoint:
        router = open_session(Endpoints(listen=endpoint))
        ours, stranger, asker = (open_session(Endpoints(connect=endpoint)) for _ in range(3))
        wire = Wire(ours, node="controller")
        until = time.monotonic() + 30.0
        suspects: list[str] = []
        while len(suspects) != 1 and time.monotonic() < until:
            clients = RouterClients(asker, OURS)
            clients.ask()
            clients.wait(1.0)
            time.sleep(0.1)
            suspects = clients.suspects()
        (suspect,) = suspects
        assert suspect.startswith(f"session {stranger.zid()} at tcp/127.0.0.1:")
        wire.close()
        for session in (ours, stranger, asker, router):
            close_session(session)
