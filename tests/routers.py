"""A router on loopback for tests of what joins it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session, reserved_endpoint


@contextmanager
def router(allowed: frozenset[str] | None = None) -> Iterator[tuple[str, Wire]]:
    """Its endpoint, and an ear and a mouth on it, which says only what is ``allowed``."""
    with reserved_endpoint() as endpoint:
        session = open_session(Endpoints(listen=endpoint))
        wire = Wire(session, allowed=allowed)
        try:
            yield endpoint, wire
        finally:
            wire.close()
            close_session(session)
