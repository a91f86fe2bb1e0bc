"""An HTTP server that keeps no more connections open than it can: strangers open as many as they like."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream

MOST_OPEN = 128
"""Connections that are open at once; each costs a descriptor, of which a process has a thousand or so."""

MOST_OPEN_EACH = 40
"""Of these, from one address."""


class BoundedServer(HTTPServer):
    """Closes a connection at once that is one too many. ``refuse``: called for each."""

    refuse: Callable[[], None]

    def initialize(  # type: ignore[override]  # tornado builds by it, with what the constructor is given
        self, *args: Any, refuse: Callable[[], None], **kwargs: Any
    ) -> None:
        """As any, and who is to know of a connection that is refused."""
        super().initialize(*args, **kwargs)
        self.refuse = refuse
        self._streams: dict[IOStream, str] = {}

    def handle_stream(self, stream: IOStream, address: tuple[Any, ...]) -> None:
        """Serve a connection, or close it."""
        # Looked at anew, as a stream has one callback for its end, and that is its reader's.
        self._streams = {each: host for each, host in self._streams.items() if not each.closed()}
        host = str(address[0])
        if len(self._streams) >= MOST_OPEN or Counter(self._streams.values())[host] >= MOST_OPEN_EACH:
            self.refuse()
            stream.close()
            return
        self._streams[stream] = host
        super().handle_stream(stream, address)
