"""The page's server as a process: where it listens, what its address is, and its loop to the end."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import os
import re
import secrets
import socket

from hil.errors import UsageError
from hil.live.daemon import Ending
from hil.live_page.admission import SHORTEST_TOKEN
from hil.live_page.live_page import FRAME_S, LivePage
from hil.live_page.page_server import http_server
from hil.wire.session import Endpoints

LOOPBACK, USUAL_PORT = "127.0.0.1", 7480
TOKEN_VARIABLE = "ABREAST_LIVE_TOKEN"
_LONGEST_TOKEN = 256
_TOKEN = re.compile(rf"[A-Za-z0-9_-]{{{SHORTEST_TOKEN},{_LONGEST_TOKEN}}}")
_TELL_S = 2.0


def new_token() -> str:
    """The token that the environment gives, else a random one.

    Raises :class:`UsageError` for one that could be guessed, or that an address cannot bear.
    """
    given = os.environ.get(TOKEN_VARIABLE, "")
    if given and not _TOKEN.fullmatch(given):
        raise UsageError(
            f"{TOKEN_VARIABLE} has {len(given)} characters, expected {SHORTEST_TOKEN} to {_LONGEST_TOKEN} "
            "of [A-Za-z0-9_-], as it is part of an address; leave it out for a random one"
        )
    return given or secrets.token_urlsafe(SHORTEST_TOKEN)


def bound(address: str, port: int | None) -> socket.socket:
    """A socket that listens at an address of this machine; without a port at the usual one, or a free one.

    Raises :class:`UsageError` where it cannot.
    """
    for chosen in (USUAL_PORT, 0) if port is None else (port,):
        try:
            family, *_, place = socket.getaddrinfo(address, chosen, type=socket.SOCK_STREAM)[0]
            listening = socket.socket(family, socket.SOCK_STREAM)
        except OSError as error:
            raise UsageError(
                f"--live-address {address}: {error.strerror}; give an address of this machine"
            ) from None
        try:
            # As a server that ended a moment ago is no reason to wait.
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.bind(place)
            listening.listen(64)
        except OSError as error:
            listening.close()
            if port is None and chosen:
                continue
            raise UsageError(
                f"the live page cannot listen at {address} port {chosen} ({error.strerror}); "
                "give another --live-port or --live-address"
            ) from None
        listening.setblocking(False)
        return listening
    raise AssertionError


def is_open(listening: socket.socket, endpoints: Endpoints) -> bool:
    """Whether who reaches a socket needs no token: whoever is on this machine reaches its wire as well.

    Not where the wire has keys, which others on this machine may not have.
    """
    return ipaddress.ip_address(listening.getsockname()[0]).is_loopback and endpoints.keys is None


def own_names() -> tuple[str, ...]:
    """What this machine is called in its network."""
    name = socket.gethostname()
    return name, f"{name.partition('.')[0]}.local"


def address_of(listening: socket.socket, token: str) -> str:
    """Address of the page for a browser, with the token where it needs one: behind ``#`` it stays there."""
    host, port = listening.getsockname()[:2]
    if ipaddress.ip_address(host).is_unspecified:
        host = _reached_at(listening.family, host)
    named = f"[{host}]" if ":" in host else host
    return f"http://{named}:{port}/{f'#{token}' if token else ''}"


def _reached_at(family: int, host: str) -> str:
    """The address by which others in the network reach this machine, its name where that is not known."""
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            # Nothing is sent: it only asks which way it would go.
            probe.connect(("192.0.2.1" if family == socket.AF_INET else "2001:db8::1", 9))
            return str(probe.getsockname()[0])
        except OSError:
            return socket.gethostname()


async def serve(page: LivePage, listening: socket.socket, ending: Ending) -> None:
    """Serve a page until the end is asked for."""
    loop = asyncio.get_running_loop()

    def wake() -> None:
        loop.call_soon_threadsafe(page.woken.set)

    ending.notify(wake)
    server = http_server(page)
    server.add_socket(listening)
    due = told_at = loop.time()
    try:
        while not ending.asked:
            page.woken.clear()
            try:
                page.go_round()
            except Exception as error:
                # A stop has to work whatever cannot be drawn; the page itself says that nothing comes.
                page.say_failed(error)
            if loop.time() - told_at > _TELL_S:
                told_at = loop.time()
                page.say_refused()
            # One that was late is not made up for.
            due = max(due + FRAME_S, loop.time())
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(page.woken.wait(), due - loop.time() if page.listens else _TELL_S)
    finally:
        server.stop()
        page.close()
        await server.close_all_connections()
