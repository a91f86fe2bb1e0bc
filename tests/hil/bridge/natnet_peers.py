"""A NatNet server on loopback that plays a capture."""

from __future__ import annotations

import select
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from hil.bridge.datagram_sockets import arrivals, open_socket
from hil.bridge.natnet_packets import (
    Echo,
    Kind,
    echo_response,
    opened,
    read_echo,
    read_echo_request,
    read_server_info,
)

_ENHANCED_PACKET = 6
_UDP = 17
_S_NS = 1_000_000_000
_LEAD_NS = 1_000_000_000


class Captured(NamedTuple):
    """A UDP datagram of a capture: when [ns] it was seen, and its ports."""

    at_ns: int
    source: int
    target: int
    data: bytes


def captured(path: Path) -> list[Captured]:
    """All UDP datagrams over Ethernet in a little-endian pcapng file with stamps in microseconds."""
    raw, at, found = path.read_bytes(), 0, []
    while at < len(raw):
        kind, length = struct.unpack_from("<II", raw, at)
        if kind == _ENHANCED_PACKET:
            _, high, low, size, _ = struct.unpack_from("<IIIII", raw, at + 8)
            packet = raw[at + 28 : at + 28 + size]
            if packet[12:14] == b"\x08\x00" and packet[23] == _UDP:
                udp = 14 + 4 * (packet[14] & 15)
                source, target, total = struct.unpack_from(">HHH", packet, udp)
                seen_ns = ((high << 32) | low) * 1000
                found.append(Captured(seen_ns, source, target, packet[udp + 8 : udp + total]))
        at += length
    return found


class Player:
    """Plays the frames of a capture to its multicast group on loopback, once a client has set its clock."""

    def __init__(self, datagrams: list[Captured]) -> None:
        by_kind: dict[int, list[Captured]] = {}
        for datagram in datagrams:
            by_kind.setdefault(datagram.data[0], []).append(datagram)
        self.frames = by_kind[Kind.FRAME]
        self._info, self._model = by_kind[Kind.SERVER_INFO][0].data, by_kind[Kind.MODEL][0].data
        self.info = read_server_info(opened(self._info)[1])
        echoed = by_kind[Kind.ECHO_RESPONSE][0]
        self._ticks, self._ticks_ns = read_echo(opened(echoed.data)[1]).ticks, echoed.at_ns
        self.begun_ns = 0

    def ticks(self, host_ns: int) -> int:
        """The server's clock at a host time, while the capture is played."""
        captured_ns = self.frames[0].at_ns + host_ns - self.begun_ns - _LEAD_NS
        return self._ticks + (captured_ns - self._ticks_ns) * self.info.frequency // _S_NS

    def host_ns(self, ticks: int) -> int:
        """The host time at which it shows this."""
        captured_ns = self._ticks_ns + (ticks - self._ticks) * _S_NS // self.info.frequency
        return captured_ns - self.frames[0].at_ns + self.begun_ns + _LEAD_NS

    def play(self, opened_socket: socket.socket, closed: threading.Event) -> None:
        """Answer, and once five echoes were answered send frame by frame when it is due."""
        group = (self.info.group, self.info.data_port)
        opened_socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        self.begun_ns, echoes, sent, model_known = time.time_ns(), 0, 0, False
        while not closed.is_set():
            select.select([opened_socket], [], [], 0.001)
            for data, sender, at_ns in arrivals(opened_socket):
                kind, reader = opened(data)
                if kind == Kind.CONNECT:
                    opened_socket.sendto(self._info, sender)
                elif kind == Kind.REQUEST_MODEL:
                    opened_socket.sendto(self._model, sender)
                    model_known = True
                elif kind == Kind.ECHO_REQUEST:
                    echoes += 1
                    echo = Echo(read_echo_request(reader), self.ticks(at_ns))
                    opened_socket.sendto(echo_response(echo), sender)
            while model_known and echoes >= 5 and sent < len(self.frames) and self._due(sent):
                opened_socket.sendto(self.frames[sent].data, group)
                sent += 1

    def _due(self, place: int) -> bool:
        return time.time_ns() - self.begun_ns - _LEAD_NS >= self.frames[place].at_ns - self.frames[0].at_ns


@contextmanager
def playing(player: Player) -> Iterator[int]:
    """The port at which it answers on loopback."""
    closed, opened_socket = threading.Event(), open_socket("127.0.0.1")
    thread = threading.Thread(target=player.play, args=(opened_socket, closed))
    thread.start()
    try:
        yield opened_socket.getsockname()[1]
    finally:
        closed.set()
        thread.join()
        opened_socket.close()
