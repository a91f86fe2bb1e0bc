"""UDP sockets: one that asks and is answered, and one that listens to a multicast group."""

from __future__ import annotations

import socket
import time
from typing import NamedTuple

from hil.errors import AbreastError, UsageError

LARGEST = 65_535
_BUFFER = 1 << 20
_MOST_AT_ONCE = 1000


class Arrival(NamedTuple):
    """A datagram, who sent it, and when [ns] it was found."""

    data: bytes
    sender: tuple[str, int]
    at_ns: int


def address_of(text: str, port: int) -> tuple[str, int]:
    """IPv4 address and port of ``HOST`` or ``HOST:PORT``. Raises :class:`UsageError` where there is none."""
    host, _, given = text.partition(":")
    if given and not (given.isdecimal() and 0 < int(given) < 65_536):
        raise UsageError(f"address {text!r}: expected HOST or HOST:PORT, such as 192.0.2.5")
    try:
        return socket.gethostbyname(host or "."), int(given or port)
    except (OSError, UnicodeError):
        raise UsageError(f"address {text!r}: no such host; give the IP address of the machine") from None


def open_socket(host: str = "", port: int = 0) -> socket.socket:
    """A UDP socket that does not block. Raises :class:`AbreastError` for a port that is taken."""
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        opened.setblocking(False)
        opened.bind((host, port))
    except OSError as error:
        opened.close()
        raise AbreastError(
            f"UDP {host or '*'}:{port}: {error.strerror}; end who has this port, or choose another"
        ) from None
    return opened


def open_group(group: str, port: int, interface: str) -> socket.socket:
    """A socket that hears a multicast group on the interface with this address.

    Raises :class:`AbreastError` where the group cannot be joined.
    """
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        # Others on this machine may listen to the group as well.
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        opened.setblocking(False)
        opened.bind((group, port))
        member = socket.inet_aton(group) + socket.inet_aton(interface)
        opened.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
    except OSError as error:
        opened.close()
        raise AbreastError(
            f"multicast group {group}:{port} on {interface}: {error.strerror}; a group is 224.* to 239.*"
        ) from None
    return opened


def interface_to(host: str, port: int) -> str:
    """Own address from which a host is reached. Raises :class:`AbreastError` without a route."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((host, port))
        except OSError as error:
            raise AbreastError(f"{host}: {error.strerror}; is this machine on its network?") from None
        return str(probe.getsockname()[0])


def arrivals(opened: socket.socket) -> list[Arrival]:
    """The datagrams that wait in a socket, but for the last of very many."""
    found: list[Arrival] = []
    for _ in range(_MOST_AT_ONCE):
        try:
            data, sender = opened.recvfrom(LARGEST)
        except OSError:
            # There are no more; or one that was sent earlier met nobody, which is told here.
            break
        found.append(Arrival(data, sender, time.time_ns()))
    return found


def send(opened: socket.socket, data: bytes, address: tuple[str, int]) -> bool:
    """Send a datagram; whether it went out. Where the network is away, or its buffer full, it is lost."""
    try:
        opened.sendto(data, address)
    except OSError:
        return False
    return True
