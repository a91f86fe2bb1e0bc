"""An ``abreast live`` as a child process, and a browser's part of the talk with it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Coroutine, Iterator
from dataclasses import dataclass, field
from http.client import HTTPConnection
from typing import Any
from urllib.parse import urlsplit

from tornado.httpclient import HTTPRequest
from tornado.websocket import WebSocketClientConnection, WebSocketClosedError, websocket_connect

PATIENCE = 180.0
HUNG_UP = 0


@dataclass
class Server:
    """Where the page is, the token that its address has, and its process."""

    address: str
    token: str
    process: subprocess.Popen[str]
    sockets: list[WebSocketClientConnection] = field(default_factory=list)

    @property
    def host(self) -> str:
        return urlsplit(self.address).netloc

    @property
    def origin(self) -> str:
        return f"http://{self.host}"

    async def connect(self, **headers: str) -> WebSocketClientConnection:
        """A websocket as the page opens it, or with other headers."""
        asked = HTTPRequest(f"ws://{self.host}/lab", headers={"Origin": self.origin} | headers)
        self.sockets.append(await websocket_connect(asked, ping_interval=None))
        return self.sockets[-1]

    async def greeted(self) -> tuple[WebSocketClientConnection, dict[str, Any]]:
        """The same once the token was shown, and what the server then says of the lab."""
        socket = await self.connect()
        await say(socket, say="hello", token=self.token)
        return socket, await heard(socket, "config")

    def request(self, path: str, body: object = None, **headers: str) -> tuple[int, bytes]:
        """A request by HTTP, a POST with a body; its status and content, HUNG_UP where there is no answer."""
        data = None if body is None else body if isinstance(body, bytes) else json.dumps(body).encode()
        connection = HTTPConnection(self.host, timeout=PATIENCE)
        try:
            connection.request("GET" if data is None else "POST", path, data, headers)
            answer = connection.getresponse()
            return answer.status, answer.read()
        except OSError:
            return HUNG_UP, b""
        finally:
            connection.close()

    def run(self, talk: Coroutine[Any, Any, None]) -> None:
        """Let a browser have its talk, and hang up."""

        async def to_its_end() -> None:
            try:
                await asyncio.wait_for(talk, PATIENCE)
            finally:
                for socket in self.sockets:
                    socket.close()
                    while socket.close_code is None and await socket.read_message() is not None:
                        pass
                self.sockets.clear()

        asyncio.run(to_its_end())


async def say(socket: WebSocketClientConnection, **word: object) -> None:
    await socket.write_message(json.dumps(word))


async def heard(socket: WebSocketClientConnection, kind: str) -> dict[str, Any]:
    """The next message of a kind; frames are acknowledged. Strict: NaN is none of JSON."""

    def refuse(name: str) -> None:
        raise AssertionError(name)

    while (text := await socket.read_message()) is not None:
        message: dict[str, Any] = json.loads(text, parse_constant=refuse)
        if message["kind"] == "frame":
            # What came before a hang-up is still to be read after it.
            with contextlib.suppress(WebSocketClosedError):
                await say(socket, say="seen", frame=message["n"])
        if message["kind"] == kind:
            return message
    raise AssertionError(f"closed with {socket.close_code} {socket.close_reason} before {kind}")


@contextlib.contextmanager
def live_page(endpoint: str, *options: str) -> Iterator[Server]:
    """``abreast live`` on a lab."""
    words = [sys.executable, "-m", "hil", "live", "--connect", endpoint, *options]
    process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    try:
        line = process.stderr.readline()
        assert "open http://" in line, line
        address, _, token = line.split()[-1].partition("#")
        server = Server(address, token, process)
        deadline = time.monotonic() + PATIENCE
        while not token and not server.token and time.monotonic() < deadline:
            server.token = server.request("/token")[1].decode()
        yield server
    finally:
        process.terminate()
        process.communicate(timeout=PATIENCE)
