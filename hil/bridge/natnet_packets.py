"""NatNet's datagrams around the frames: their head, requests, the server's answer, echoes."""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import NamedTuple

from hil.bridge.datagram_reader import DatagramReader, MalformedDatagramError

COMMAND_PORT = 1510
DATA_PORT = 1511
MULTICAST_GROUP = "239.255.42.99"

_HEAD = struct.Struct("<HH")
_SENDER = struct.Struct("<256s4B4B")
_HOW_SERVED = struct.Struct("<QH?4B")
_ECHO = struct.Struct("<Q")
_ECHOED = struct.Struct("<QQ")
_ANSWER = struct.Struct("<i")
_RATE = struct.Struct("<f")
_OPTIONS = struct.Struct("<?4B")


class Kind(IntEnum):
    """What a datagram is, by the number in its head."""

    CONNECT = 0
    SERVER_INFO = 1
    REQUEST = 2
    RESPONSE = 3
    REQUEST_MODEL = 4
    MODEL = 5
    FRAME = 7
    MESSAGE = 8
    DISCONNECT = 9
    KEEP_ALIVE = 10
    ECHO_REQUEST = 12
    ECHO_RESPONSE = 13
    DISCOVERY = 14
    UNRECOGNIZED = 100


class Version(NamedTuple):
    """Of the stream: how frames and model are laid out."""

    major: int
    minor: int

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}"

    @property
    def sized(self) -> bool:
        """Whether every section says how many bytes it has."""
        return self >= SIZED


OLDEST = Version(3, 0)
SIZED = Version(4, 1)
NEWEST = Version(4, 1)
VERSIONS = (OLDEST, Version(3, 1), Version(4, 0), NEWEST)
"""What is spoken here. Older streams lack the time of exposure; newer ones are asked to speak the newest."""


class ServerInfo(NamedTuple):
    """What a server says of itself.

    ``frequency``: of its clock [1/s], 0 if it told none. ``data_port``: to which it multicasts frames.
    """

    name: str
    release: str
    version: Version
    frequency: int = 0
    data_port: int = DATA_PORT
    multicast: bool = False
    group: str = MULTICAST_GROUP


class Echo(NamedTuple):
    """A server's answer to an echo request: the request's own number, and its clock at that time."""

    asked: int
    ticks: int


def packet(kind: Kind, body: bytes = b"") -> bytes:
    """A datagram of a kind."""
    return _HEAD.pack(kind, len(body)) + body


def opened(data: bytes) -> tuple[int, DatagramReader]:
    """The number of a datagram's kind, and a reader behind its head.

    Raises :class:`MalformedDatagramError` where its length is not the one that its head says.
    """
    reader = DatagramReader(data)
    kind, size = reader.take(_HEAD)
    if size != reader.left:
        raise MalformedDatagramError("length", f"{reader.left} bytes follow a head that says {size}")
    return kind, reader


def connect_request(newest: Version = NEWEST) -> bytes:
    """Ask a server for what it is, and to send frames in a layout no newer than this."""
    sender = _SENDER.pack(b"Ping", 0, 2, 0, 0, *newest, 0, 0)
    return packet(Kind.CONNECT, sender + _OPTIONS.pack(False, *newest, 0, 0) + b"\0")


def text_request(text: str) -> bytes:
    """A request in words, such as ``Bitstream,4.1``."""
    return packet(Kind.REQUEST, text.encode() + b"\0")


def echo_request(number: int) -> bytes:
    """Ask a server for its clock; the number comes back."""
    return packet(Kind.ECHO_REQUEST, _ECHO.pack(number))


def read_echo_request(reader: DatagramReader) -> int:
    """The number of an echo request."""
    (number,) = reader.take(_ECHO)
    return int(number)


def echo_response(echo: Echo) -> bytes:
    """Answer an echo request."""
    return packet(Kind.ECHO_RESPONSE, _ECHOED.pack(*echo))


def read_echo(reader: DatagramReader) -> Echo:
    """The answer to an echo request."""
    return Echo(*reader.take(_ECHOED))


def response(code: int) -> bytes:
    """Answer a request in words by a number, 0 for done."""
    return packet(Kind.RESPONSE, _ANSWER.pack(code))


def rate_response(rate_hz: float) -> bytes:
    """Answer the request for the rate of frames."""
    return packet(Kind.RESPONSE, _RATE.pack(rate_hz))


def server_info(info: ServerInfo) -> bytes:
    """What a server answers to who connects."""
    release = [int(part) for part in info.release.split(".")]
    sender = _SENDER.pack(info.name.encode()[:255], *release, *info.version, 0, 0)
    group = (int(part) for part in info.group.split("."))
    served = _HOW_SERVED.pack(info.frequency, info.data_port, info.multicast, *group)
    return packet(Kind.SERVER_INFO, sender + served)


def read_server_info(reader: DatagramReader) -> ServerInfo:
    """What a server says of itself; those of old say less."""
    name, *numbers = reader.take(_SENDER)
    release, version = ".".join(map(str, numbers[:4])), Version(numbers[4], numbers[5])
    words = name.partition(b"\0")[0].decode("utf-8", "replace")
    if reader.left < _HOW_SERVED.size:
        return ServerInfo(words, release, version)
    frequency, port, multicast, *group = reader.take(_HOW_SERVED)
    return ServerInfo(words, release, version, frequency, port, multicast, ".".join(map(str, group)))
