"""A NatNet server without its sockets: who its clients are, what it answers them, and who gets frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from hil.bridge.datagram_reader import MalformedDatagramError
from hil.bridge.natnet_frame import Body
from hil.bridge.natnet_packets import (
    VERSIONS,
    Echo,
    Kind,
    ServerInfo,
    Version,
    echo_response,
    opened,
    rate_response,
    read_echo_request,
    response,
    server_info,
)
from hil.bridge.natnet_writer import frame_packet, model_packet

Address = tuple[str, int]

FREQUENCY = 10_000_000
"""Ticks of the served clock in a second."""

_FRAME_RATE = "FrameRate"
_SILENCE_NS = 10_000_000_000
_MOST_CLIENTS = 64
_TICK_NS = 1_000_000_000 // FREQUENCY
_EXPOSED_TO_IMAGES_NS = 2_000_000
_REFUSED = -1


@dataclass(frozen=True, slots=True)
class Client:
    """Somebody who has asked for something: when last [ns], the layout it gets, whether it gets frames."""

    heard_ns: int
    version: Version
    streamed: bool = False


class NatNetService:
    """Serves the bodies of these names as Motive does; their streaming ids count from 1.

    ``clock``: gives the served clock [ns] at a host time [ns]. In unicast frames go to whatever port a client
    asked from, and to the data port of its machine as well, since clients listen at either. They begin once
    a client has asked for the model or said that it is alive: one that takes the first datagram for the
    model would otherwise take a frame for it, and know no names.
    """

    def __init__(
        self, info: ServerInfo, names: Sequence[str], rate_hz: float, clock: Callable[[int], int]
    ) -> None:
        self.info, self._names, self._rate_hz, self._clock = info, tuple(names), rate_hz, clock
        self.clients: dict[Address, Client] = {}
        self.hosts: dict[str, Version] = {}
        self.refused: dict[str, int] = {}
        self._first_ns: int | None = None

    def hear(self, data: bytes, sender: Address, now_ns: int) -> bytes | None:
        """Take in a datagram; what to answer, if anything. Never raises."""
        try:
            kind, reader = opened(data)
            client = self._client(sender, now_ns)
            if kind in (Kind.CONNECT, Kind.DISCOVERY):
                return server_info(self.info._replace(version=client.version))
            if kind == Kind.ECHO_REQUEST:
                return echo_response(Echo(read_echo_request(reader), self._clock(now_ns) // _TICK_NS))
            if kind == Kind.DISCONNECT:
                del self.clients[sender]
            elif kind in (Kind.REQUEST_MODEL, Kind.KEEP_ALIVE):
                self.clients[sender] = replace(client, streamed=True)
                return model_packet(self._names, client.version) if kind == Kind.REQUEST_MODEL else None
            elif kind == Kind.REQUEST:
                return self._answer(reader.rest().partition(b"\0")[0].decode("utf-8", "replace"), sender)
        except MalformedDatagramError as error:
            self.refused[error.cause] = self.refused.get(error.cause, 0) + 1
        return None

    def frame(
        self, number: int, bodies: Sequence[Body], captured_ns: int, now_ns: int
    ) -> list[tuple[bytes, Address]]:
        """A frame for all that get any, with their addresses. ``captured_ns``: by the served clock."""
        if self._first_ns is None:
            self._first_ns = captured_ns
        seconds = (captured_ns - self._first_ns) * 1e-9
        ticks = (
            captured_ns // _TICK_NS,
            (captured_ns + _EXPOSED_TO_IMAGES_NS) // _TICK_NS,
            self._clock(now_ns) // _TICK_NS,
        )
        packets: dict[Version, bytes] = {}

        def packed(version: Version) -> bytes:
            if version not in packets:
                packets[version] = frame_packet(number, self._names, bodies, ticks, seconds, version)
            return packets[version]

        if self.info.multicast:
            return [(packed(self.info.version), (self.info.group, self.info.data_port))]
        self._forget_silent(now_ns)
        streamed = [(packed(c.version), address) for address, c in self.clients.items() if c.streamed]
        ported = [(packed(v), (host, self.info.data_port)) for host, v in self.hosts.items()]
        return streamed + ported

    def _client(self, sender: Address, now_ns: int) -> Client:
        known = self.clients.get(sender)
        client = replace(known, heard_ns=now_ns) if known else Client(now_ns, self.info.version)
        if known is None and len(self.clients) >= _MOST_CLIENTS:
            oldest = min(self.clients, key=lambda address: self.clients[address].heard_ns)
            del self.clients[oldest]
        self.clients[sender] = client
        if len(self.hosts) < _MOST_CLIENTS:
            self.hosts.setdefault(sender[0], self.info.version)
        return client

    def _answer(self, request: str, sender: Address) -> bytes:
        word, _, value = request.partition(",")
        if word == _FRAME_RATE:
            return rate_response(self._rate_hz)
        version = next((known for known in VERSIONS if str(known) == value), None)
        if word == "Bitstream" and version is not None and not self.info.multicast:
            self.clients[sender] = replace(self.clients[sender], version=version)
            self.hosts[sender[0]] = version
            return response(0)
        return response(_REFUSED)

    def _forget_silent(self, now_ns: int) -> None:
        for address in [a for a, c in self.clients.items() if abs(now_ns - c.heard_ns) > _SILENCE_NS]:
            del self.clients[address]
