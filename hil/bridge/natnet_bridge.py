"""OptiTrack's Motive as a bridge: a NatNet client on its sockets, its frames on their way to the wire."""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from hil.bridge.datagram_sockets import arrivals, interface_to, open_group, open_socket, send
from hil.bridge.mocap_wire import MocapWire
from hil.bridge.natnet_client import NatNetClient
from hil.bridge.natnet_model import Names
from hil.bridge.natnet_packets import MULTICAST_GROUP, NEWEST, OLDEST, ServerInfo
from hil.errors import AbreastError
from hil.nodes.node import Outgoing, named_counts

_NO_GROUP = "0.0.0.0"


@dataclass(frozen=True, slots=True)
class Server:
    """Where a NatNet server is. ``multicast``: join its group even if it says that it streams unicast."""

    host: str
    port: int
    multicast: bool = False


class NatNetBridge:
    """Brings the frames of a server. ``say``: takes lines for the console."""

    def __init__(self, server: Server, wire: MocapWire, say: Callable[[str], None]) -> None:
        self._server, self._wire, self._say = server, wire, say
        self._client = NatNetClient()
        self._interface = interface_to(server.host, server.port)
        self._command = open_socket(self._interface)
        self._data: socket.socket | None = None
        self._info: ServerInfo | None = None
        self._names: Names | None = None
        self._refused: dict[str, int] = {}

    def wait(self, timeout: float) -> None:
        """Return when a datagram has come or something is due, at the latest after ``timeout`` [s]."""
        due = (self._client.due_ns() - time.time_ns()) * 1e-9
        select.select(self._sockets(), [], [], max(0.0, min(timeout, due)))

    def take(self, now_ns: int) -> Iterator[Outgoing]:
        """Messages of the frames that have come, and diagnostics when they are due."""
        for opened in self._sockets():
            for data, sender, at_ns in arrivals(opened):
                if sender[0] != self._server.host:
                    self._client.refuse("stranger")
                elif (frame := self._client.hear(data, at_ns)) is not None:
                    yield self._wire.publish(frame)
        self._note_server()
        for request in self._client.requests(time.time_ns()):
            send(self._command, request, (self._server.host, self._server.port))
        yield from self._wire.report(now_ns, self._waiting(), self._values())

    def end(self, now_ns: int) -> Iterator[Outgoing]:
        """The last diagnostics."""
        yield self._wire.last_report(now_ns, self._waiting(), self._values())

    def close(self) -> None:
        """Close the sockets."""
        for opened in self._sockets():
            opened.close()

    def _sockets(self) -> list[socket.socket]:
        return [self._command] if self._data is None else [self._command, self._data]

    def _note_server(self) -> None:
        """Do what a server's answer asks for, and say what is new."""
        info, client = self._client.info, self._client
        if info is not None and info != self._info:
            self._info = info
            self._greet(info)
        if client.names is not None and client.names != self._names:
            self._names = client.names
            listed = ", ".join(f"{name!r} ({body})" for body, name in client.names.items())
            self._say(f"the model has {listed or 'no rigid bodies'}")
        for cause, count in client.refused.items():
            if cause not in self._refused:
                self._say(f"drops what is malformed or not meant for it: {cause}; counted in the diagnostics")
            self._refused[cause] = count

    def _greet(self, info: ServerInfo) -> None:
        """Raises :class:`AbreastError` for a server that is too old."""
        if info.version < OLDEST:
            raise AbreastError(
                f"{self._server.host}: {info.name} {info.release} streams NatNet {info.version}, "
                f"expected {OLDEST} to {NEWEST}; update Motive to 2.0 or later"
            )
        newer = f", asked to speak {NEWEST}" if info.version > NEWEST else ""
        multicast = self._server.multicast or info.multicast
        group = info.group if info.group != _NO_GROUP else MULTICAST_GROUP
        how = f"multicast to {group}:{info.data_port}" if multicast else "unicast"
        self._say(f"{info.name} {info.release} answers, NatNet {info.version}{newer}, {how}")
        if self._data is not None:
            self._data.close()
            self._data = None
        if multicast:
            self._data = open_group(group, info.data_port, self._interface)

    def _waiting(self) -> str:
        if self._client.info is None:
            return f"waiting for an answer of {self._server.host}:{self._server.port}"
        if self._client.names is None:
            return "waiting for the model"
        return ""

    def _values(self) -> dict[str, object]:
        client, info, clock = self._client, self._client.info, self._client.clock
        numbers = client.numbers
        values: dict[str, object] = {
            "server": "" if info is None else f"{info.name} {info.release}",
            "natnet": "" if info is None else str(client.version),
            "frames": numbers.came,
            "missed": numbers.missed,
            "late": numbers.late,
            "repeated": numbers.repeated,
            "stamped_by_arrival": client.guessed,
        }
        if clock is not None and clock.known:
            values["clock.round_trip_ms"] = f"{clock.round_trip_ns * 1e-6:.3f}"
            values["clock.drift_ppm"] = f"{clock.drift * 1e6:.1f}"
            values["clock.jumps"] = clock.jumps
        return values | named_counts("refused", client.refused)
