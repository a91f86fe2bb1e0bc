"""The relay as a process between two real sockets."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from hil.faults.relay import Way
from hil.wire.session import reserved_endpoint

PATIENCE = 30.0


@pytest.fixture
def ends() -> Iterator[tuple[subprocess.Popen[bytes], socket.socket, socket.socket]]:
    """The relay, who connected through it, and whom that reached."""
    with socket.create_server(("127.0.0.1", 0)) as server, reserved_endpoint() as endpoint:
        server.settimeout(PATIENCE)
        port = endpoint.rpartition(":")[2]
        command = [sys.executable, "-m", "hil.faults.relay", port, str(server.getsockname()[1])]
        relay = subprocess.Popen(command, stdin=subprocess.PIPE)
        try:
            near = _connected(int(port))
            far, _ = server.accept()
            far.settimeout(PATIENCE)
            near.settimeout(PATIENCE)
            with near, far:
                yield relay, near, far
        finally:
            relay.kill()
            relay.communicate()


def _passes(near: socket.socket, far: socket.socket) -> bool:
    near.sendall(b"a")
    try:
        return bool(far.recv(16))
    except TimeoutError:
        return False


def _connected(port: int) -> socket.socket:
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        try:
            return socket.create_connection(("127.0.0.1", port), timeout=1.0)
        except OSError:
            time.sleep(0.05)
    raise AssertionError("the relay never listened")


def test_it_passes_both_ways_and_holds_back_while_frozen(
    ends: tuple[subprocess.Popen[bytes], socket.socket, socket.socket],
) -> None:
    relay, near, far = ends
    near.sendall(b"there")
    assert far.recv(16) == b"there"
    far.sendall(b"back")
    assert near.recv(16) == b"back"
    assert relay.stdin is not None
    relay.stdin.write(b"freeze\n")
    relay.stdin.flush()
    far.settimeout(0.5)
    while _passes(near, far):
        # Until the line is read, some may pass.
        pass
    near.sendall(b"!")
    relay.stdin.write(b"pass\n")
    relay.stdin.flush()
    far.settimeout(PATIENCE)
    held = b""
    while not held.endswith(b"!"):
        held += far.recv(16)
    assert set(held) <= set(b"a!")


def test_a_line_says_all_of_how_the_link_is() -> None:
    way = Way()
    way.become(["delay", "0.5"])
    assert way == Way(delay_s=0.5)
    way.become(["rate", "4000"])
    assert way == Way(rate=4000.0)
    way.become(["freeze"])
    assert way == Way(frozen=True)
    way.become(["pass"])
    assert way == Way()
