"""Who comes to a router and who goes, by the certificates that they show."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import zenoh

from hil.wire.undeclare import undeclare

Say = Callable[[str], None]


@contextmanager
def links_said(session: zenoh.Session, say: Say) -> Iterator[None]:
    """Say of everybody who comes and goes who it is and from where, for as long as the block lasts.

    Whoever is refused gets no link and is not said here (:mod:`hil.wire.refused_links`).
    """

    def tell(event: zenoh.LinkEvent) -> None:
        how = "came" if event.kind == zenoh.SampleKind.PUT else "went"
        say(f"{event.link.auth_identifier or 'somebody'} {how}, from {event.link.dst}")

    direct = zenoh.handlers.Callback(tell, indirect=False)
    listener = session.info.declare_link_events_listener(direct, history=False)
    try:
        yield
    finally:
        # A session does not close while one listens.
        undeclare(listener)
