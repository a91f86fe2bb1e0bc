"""Zenoh sessions: one router and its clients on named endpoints, never multicast."""

from __future__ import annotations

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
from hil.wire.refused_session import reason_for
from hil.wire.role_keys import RoleKeys
from hil.wire.roles import OPERATOR, ROUTER
from hil.wire.session_config import (
    connects_to,
    endpoint_config,
    file_config,
    keys_allowed,
    keys_config,
    listens_at,
)

_ENDPOINT = re.compile(r"[a-z][a-z0-9_-]*/\S+")
_RETRY_S = 0.2
_GLANCE_S = 0.05
_OVERTIME_S = 2.5
_CLOSE_S = 2.0


class NoRouterError(AbreastError):
    """Nobody answered, or nobody can listen, at an endpoint."""


class GaveUpError(AbreastError):
    """The end was asked for while nobody had answered yet. Exit code 130."""

    exit_code = 130


@dataclass(frozen=True, slots=True)
class Endpoints:
    """Where a session connects to and listens, such as ``tcp/192.0.2.7:7447``; or a Zenoh config file.

    A session that listens is a router: others connect to it. One that only connects is a client. ``keys``:
    by which it shows who it is; all is encrypted then. Raises :class:`UsageError` for an endpoint that is not
    written as protocol/address, and for keys that do not go with what is asked for.
    """

    connect: str | None = None
    listen: str | None = None
    config_file: Path | None = None
    keys: RoleKeys | None = None

    def __post_init__(self) -> None:
        for endpoint in (self.connect, self.listen):
            if endpoint is not None and not _ENDPOINT.fullmatch(endpoint):
                raise UsageError(
                    f"endpoint {endpoint!r}: expected protocol/address, such as tcp/127.0.0.1:7447"
                )
            if endpoint is not None and self.keys is not None and not endpoint.startswith("tls/"):
                address = endpoint.partition("/")[2]
                raise UsageError(
                    f"endpoint {endpoint!r}: expected a tls one with --secure {self.keys.folder}; "
                    f"give tls/{address}"
                )
        if self.keys is not None:
            self._check_keys(self.keys)

    def _check_keys(self, keys: RoleKeys) -> None:
        if self.config_file is not None:
            raise UsageError(
                f"--zenoh-config {self.config_file}: --secure has its own; leave one of both out"
            )
        if self.listen is not None and keys.role != ROUTER:
            raise UsageError(
                f"--listen {self.listen}: with --secure nobody listens but the router; "
                f"start abreast router --secure {keys.folder}, and --connect to it"
            )
        keys.check()

    @property
    def joining(self) -> Endpoints:
        """How others on this machine join whoever has these endpoints."""
        if not self.listen:
            return self
        keys = self.keys._replace(role=OPERATOR) if self.keys else None
        return Endpoints(connect=reachable(self.listen), keys=keys)

    @property
    def options(self) -> list[str]:
        """The same for a daemon's command line; its role follows from what it is."""
        given = {
            "--connect": self.connect,
            "--listen": self.listen,
            "--zenoh-config": self.config_file,
            "--secure": self.keys.folder if self.keys else None,
        }
        return [word for option, value in given.items() if value is not None for word in (option, str(value))]

    def describe(self) -> str:
        """The endpoints in words."""
        return str(self.config_file or self.listen or self.connect)


def open_session(
    endpoints: Endpoints, patience: float = 10.0, give_up: Callable[[], bool] = lambda: False
) -> zenoh.Session:
    """Open a session, trying again for ``patience`` [s] while nobody answers, or until ``give_up`` says so.

    Raises :class:`UsageError` for a config that Zenoh refuses, :class:`NoRouterError` if nobody answered, and
    :class:`GaveUpError` where it was given up.
    """
    config = session_config(endpoints)
    if endpoints.config_file is not None and not (connects_to(config) or listens_at(config)):
        raise UsageError(
            f"zenoh {endpoints.config_file}: it names nobody to connect to, expected "
            'connect: { endpoints: ["tcp/127.0.0.1:7447"] } or the like'
        )
    deadline = time.monotonic() + patience
    error: zenoh.ZError | None = None
    while True:
        opened = _opened(config, deadline, give_up)
        if isinstance(opened, zenoh.Session):
            return opened
        error = opened or error
        if give_up():
            raise GaveUpError(f"ended while it waited for {endpoints.describe()}")
        if not connects_to(config) or time.monotonic() >= deadline:
            raise NoRouterError(f"zenoh {_why(endpoints, config, error)}")
        time.sleep(_RETRY_S)


def allowed_keys(endpoints: Endpoints) -> frozenset[str] | None:
    """Key expressions that a session may publish on by its keys, None for any; of the router's role none."""
    if endpoints.keys is None:
        return None
    try:
        return keys_allowed(endpoints.keys)
    except zenoh.ZError as error:
        raise UsageError(f"zenoh {endpoints.keys.config}: {_told(error)}; make the keys anew") from None


def session_config(endpoints: Endpoints) -> zenoh.Config:
    """Zenoh's configuration of a session; raises :class:`UsageError` for what cannot be one."""
    try:
        if endpoints.config_file is not None:
            config = file_config(endpoints.config_file)
        elif endpoints.keys is not None:
            config = keys_config(endpoints.keys, endpoints.connect, endpoints.listen)
        else:
            config = endpoint_config(endpoints.connect, endpoints.listen)
    except zenoh.ZError as error:
        whose = endpoints.keys.config if endpoints.keys else endpoints.describe()
        raise UsageError(f"zenoh {whose}: {_told(error)}; give an endpoint like tcp/127.0.0.1:7447") from None
    return config


def refuse_deaf(endpoints: Endpoints) -> None:
    """Raise :class:`UsageError` for a session that is to be a router and listens nowhere."""
    config = session_config(endpoints)
    if not listens_at(config):
        raise UsageError(
            f'zenoh {endpoints.describe()}: it listens nowhere, expected mode: "router" and '
            'listen: { endpoints: ["tcp/127.0.0.1:7447"] } or the like'
        )


def _opened(
    config: zenoh.Config, deadline: float, give_up: Callable[[], bool]
) -> zenoh.Session | zenoh.ZError | None:
    """A session, or why there is none; None where an attempt takes too long, as a config file may want it.

    Zenoh attempts it in a thread, as signals must be heard meanwhile.
    """
    found: list[zenoh.Session | zenoh.ZError] = []
    left = threading.Event()

    def attempt() -> None:
        try:
            session = zenoh.open(config)
        except zenoh.ZError as error:
            found.append(error)
            return
        found.append(session)
        if left.is_set():
            close_session(session)

    thread = threading.Thread(target=attempt, daemon=True)
    thread.start()
    try:
        while thread.is_alive() and time.monotonic() < deadline + _OVERTIME_S and not give_up():
            thread.join(_GLANCE_S)
    finally:
        left.set()
        # One that came back while Python shuts down would abort it.
        thread.join(_OVERTIME_S)
    return found[0] if found else None


def _why(endpoints: Endpoints, config: zenoh.Config, error: zenoh.ZError | None) -> str:
    """Where there is no session, the reason in Zenoh's words, and what to do about it."""
    said = _told(error) if error is not None else "no answer"
    taken, missing = listens_at(config), connects_to(config)
    if taken and ("listener" in said or not missing):
        advice = f"somebody may listen at {taken[0]} already: connect to it, or listen elsewhere"
        return f"{endpoints.describe()}: no session ({said}); {advice}"
    advice = reason_for(missing[0], endpoints.keys)
    return f"{endpoints.config_file or missing[0]}: no session ({said}); {advice}"


def _told(error: zenoh.ZError) -> str:
    return str(error).partition(" at /")[0].rstrip()


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
def reserved_endpoint(protocol: str = "tcp") -> Iterator[str]:
    """A loopback endpoint on a free port, which nobody else is given until one of us listens there.

    Hold it until the router is up. A port that was merely found free may be gone a moment later.
    """
    with socket.socket() as held:
        # With this option on both sides, one socket may listen where another is bound: Zenoh's has it too.
        held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        held.bind(("127.0.0.1", 0))
        yield f"{protocol}/127.0.0.1:{held.getsockname()[1]}"
