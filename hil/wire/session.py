"""Zenoh sessions: one router and its clients on named endpoints, never multicast."""

from __future__ import annotations

import json
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import zenoh

from hil.errors import AbreastError, UsageError

_ENDPOINT = re.compile(r"[a-z][a-z0-9_-]*/\S+")
_PRIORITIES = ("real_time", "data")
_RETRY_S = 0.2
_CLOSE_S = 2.0


class NoRouterError(AbreastError):
    """Nobody answered, or nobody can listen, at an endpoint."""


@dataclass(frozen=True, slots=True)
class Endpoints:
    """Where a session connects to and listens, such as ``tcp/192.0.2.7:7447``; or a Zenoh config file.

    A session that listens is a router: others connect to it. One that only connects is a client. Raises
    :class:`UsageError` for an endpoint that is not written as protocol/address.
    """

    connect: str | None = None
    listen: str | None = None
    config_file: Path | None = None

    def __post_init__(self) -> None:
        for endpoint in (self.connect, self.listen):
            if endpoint is not None and not _ENDPOINT.fullmatch(endpoint):
                raise UsageError(
                    f"endpoint {endpoint!r}: expected protocol/address, such as tcp/127.0.0.1:7447"
                )

    @property
    def joining(self) -> Endpoints:
        """How others on this machine join whoever has these endpoints."""
        return Endpoints(connect=reachable(self.listen)) if self.listen else self

    @property
    def options(self) -> list[str]:
        """The same for a daemon's command line."""
        given = {"--connect": self.connect, "--listen": self.listen, "--zenoh-config": self.config_file}
        return [word for option, value in given.items() if value is not None for word in (option, str(value))]

    def describe(self) -> str:
        """The endpoints in words."""
        return str(self.config_file or self.listen or self.connect)


def open_session(
    endpoints: Endpoints, patience: float = 10.0, give_up: Callable[[], bool] = lambda: False
) -> zenoh.Session:
    """Open a session, trying again for ``patience`` [s] while nobody answers, or until ``give_up`` says so.

    Raises :class:`UsageError` for a config that Zenoh refuses, :class:`NoRouterError` if nobody answered.
    """
    config = _config(endpoints)
    deadline = time.monotonic() + patience
    while True:
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            if endpoints.connect is None or time.monotonic() >= deadline or give_up():
                reason = str(error).partition(" at /")[0]
                raise NoRouterError(
                    f"zenoh {endpoints.describe()}: no session ({reason}); "
                    "is the router up, and is the endpoint right?"
                ) from None
        time.sleep(_RETRY_S)


def close_session(session: zenoh.Session) -> None:
    """Close a session, waiting at most two seconds: with the router gone, Zenoh may wait much longer."""
    closer = threading.Thread(target=session.close, daemon=True)
    closer.start()
    closer.join(_CLOSE_S)


def reachable(listen: str) -> str:
    """Where sessions on this machine connect to a router that listens there, be it on all interfaces.

    >>> reachable("tcp/0.0.0.0:7447"), reachable("tcp/[::]:7447"), reachable("tcp/192.0.2.10:7447")
    ('tcp/127.0.0.1:7447', 'tcp/[::1]:7447', 'tcp/192.0.2.10:7447')
    """
    return listen.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")


@contextmanager
def reserved_endpoint() -> Iterator[str]:
    """A loopback endpoint on a free port, which nobody else is given until one of us listens there.

    Hold it until the router is up. A port that was merely found free may be gone a moment later.
    """
    with socket.socket() as held:
        # With this option on both sides, one socket may listen where another is bound: Zenoh's has it too.
        held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        held.bind(("127.0.0.1", 0))
        yield f"tcp/127.0.0.1:{held.getsockname()[1]}"


def _config(endpoints: Endpoints) -> zenoh.Config:
    try:
        if endpoints.config_file is not None:
            return zenoh.Config.from_file(str(endpoints.config_file))
        config = zenoh.Config()
        config.insert_json5("mode", json.dumps("router" if endpoints.listen else "client"))
        if endpoints.listen:
            config.insert_json5("listen/endpoints", json.dumps([endpoints.listen]))
        if endpoints.connect:
            config.insert_json5("connect/endpoints", json.dumps([endpoints.connect]))
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("scouting/gossip/enabled", "false")
        # By default two urgent messages may wait for a link, and a third is dropped after 1 ms: less than a
        # recorder that is flushing its file needs, while a stalled viewer may still hold up nobody for long.
        for priority in _PRIORITIES:
            config.insert_json5(f"transport/link/tx/queue/size/{priority}", "16")
        config.insert_json5("transport/link/tx/queue/congestion_control/drop/wait_before_drop", "5000")
    except zenoh.ZError as error:
        reason = str(error).partition(" at /")[0]
        raise UsageError(
            f"zenoh {endpoints.describe()}: {reason}; give an endpoint like tcp/127.0.0.1:7447"
        ) from None
    return config
