"""The page over HTTP and a websocket, by tornado: every request is checked before it is heard."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable
from typing import Any, cast

from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.iostream import StreamClosedError
from tornado.web import Application, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from hil.live_page.bounded_server import BoundedServer
from hil.live_page.browser_words import (
    LARGEST_WORDS,
    Hello,
    Look,
    Order,
    Seen,
    read_post,
    read_word,
)
from hil.live_page.live_page import LivePage, Viewer, answer
from hil.live_page.page_files import START, headers, page_files

_HELLO_S = 5.0
"""Within this time [s] a browser has to show its token."""

_MOST_WORDS_HZ = 200.0
_LOST_S = 10.0


class _Checked(RequestHandler):
    """A request that names us; any other is refused before anything is done."""

    def initialize(self, page: LivePage) -> None:
        self.page = page

    def prepare(self) -> None:
        for name, value in headers(self.request.host).items():
            self.set_header(name, value)
        if not self.page.admission.admits_host(self.request.host):
            self.clear()
            self.set_status(403)
            self.finish("this page is reached by the address that abreast live prints\n")

    def set_default_headers(self) -> None:
        self.clear_header("Server")

    def write_error(self, status_code: int, **kwargs: Any) -> None:
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code}\n")


class _Nothing(_Checked):
    """What there is not."""

    def prepare(self) -> None:
        super().prepare()
        if not self._finished:
            self.send_error(404)


class _File(_Checked):
    """A file of the page; there is nothing secret in any."""

    def get(self, name: str) -> None:
        found = page_files().get(name or START)
        if found is None:
            self.send_error(404)
            return
        kind, content = found
        self.set_header("Content-Type", kind)
        self.finish(content)


class _Token(_Checked):
    """The token, for whoever opens the page on a loopback address: no page of others can read it."""

    def get(self) -> None:
        if not self.page.admission.open:
            self.send_error(404)
            return
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(self.page.admission.token)


class _Post(_Checked):
    """An order beside the websocket, which may be stuck on its way."""

    async def post(self) -> None:
        admission = self.page.admission
        if not admission.admits_origin(self.request.headers.get("Origin"), self.request.host):
            self.send_error(403)
            return
        posted = read_post(self.request.body)
        if posted is None:
            admission.refuse("junk")
            self.send_error(400)
            return
        if not admission.admits_token(posted.token):
            self.send_error(403)
            return
        self.set_header("Content-Type", "application/json")
        self.finish(answer(posted.order, *await self.page.order(posted.order)))


class _Browser(_Checked, WebSocketHandler):
    """A browser that looks on and gives orders, once it has shown the token."""

    def initialize(self, page: LivePage) -> None:
        super().initialize(page)
        self.viewer: Viewer | None = None
        self._words, self._since = 0, time.monotonic()
        self._waits: object | None = None
        self._giving: set[asyncio.Future[None]] = set()
        self._hung_up = False

    def check_origin(self, origin: str) -> bool:
        # All of them are checked in prepare, as those of requests without one are not asked for here.
        return True

    def prepare(self) -> None:
        super().prepare()
        if self._finished:
            return
        if not self.page.admission.admits_origin(self.request.headers.get("Origin"), self.request.host):
            self.send_error(403)
        elif self.page.is_full:
            self.page.admission.refuse("too many browsers")
            self.send_error(503)

    def open(self, *_: str, **__: str) -> None:
        self.set_nodelay(True)
        self._waits = IOLoop.current().call_later(_HELLO_S, self._refuse, "no token")

    async def on_message(self, message: str | bytes) -> None:
        if self._hung_up:
            return
        word = read_word(message)
        if word is None:
            self._refuse("junk")
        elif self._floods():
            self._refuse("flood")
        elif isinstance(word, Hello):
            self._greet(word)
        elif self.viewer is None:
            self._refuse("no token")
        elif isinstance(word, Seen):
            self.viewer.pace.see(word.frame, time.monotonic())
        elif isinstance(word, Look):
            self.page.look_at(self.viewer, word.follower)
        else:
            # Not waited for: a stop is heard while another order is on its way, and who has gone is let go.
            giving = asyncio.ensure_future(self._give(word))
            self._giving.add(giving)
            giving.add_done_callback(self._giving.discard)

    def on_close(self) -> None:
        self._hung_up = True
        if self._waits is not None:
            IOLoop.current().remove_timeout(self._waits)
            self._waits = None
        self._go()

    def _go(self) -> None:
        if self.viewer is not None:
            self.page.go(self.viewer)

    def _greet(self, word: Hello) -> None:
        if self.viewer is not None or self._hung_up:
            return
        if not self.page.admission.admits_token(word.token):
            self._hang_up(4403, "token")
            return
        if self.page.is_full:
            self._refuse("too many browsers")
            return
        if self._waits is not None:
            IOLoop.current().remove_timeout(self._waits)
            self._waits = None
        self.viewer = Viewer(self._send, lambda: self._hang_up(4408, "too slow"))
        self.page.enter(self.viewer)

    async def _give(self, order: Order) -> None:
        given, text = await self.page.order(order)
        self._send(answer(order, given, text))

    def _send(self, text: str) -> None:
        with contextlib.suppress(WebSocketClosedError, StreamClosedError):
            sent = cast("Awaitable[None]", self.write_message(text))
            asyncio.ensure_future(sent).add_done_callback(_let_go)

    def _floods(self) -> bool:
        now = time.monotonic()
        if now - self._since > 1.0:
            self._words, self._since = 0, now
        self._words += 1
        return self._words > _MOST_WORDS_HZ

    def _refuse(self, cause: str) -> None:
        self._waits = None
        self.page.admission.refuse(cause)
        self._hang_up(4400, cause)

    def _hang_up(self, code: int, reason: str) -> None:
        """Close, and hear and count whom we closed no longer, however long it takes to go."""
        self._hung_up = True
        self._go()
        self.close(code, reason)


def _let_go(sent: asyncio.Future[None]) -> None:
    """A browser that went away while it was sent something is no failure."""
    if not sent.cancelled():
        sent.exception()


def http_server(page: LivePage) -> HTTPServer:
    """The server of a page, which listens nowhere yet."""
    given = {"page": page}
    routes = [
        (r"/token", _Token, given),
        (r"/order", _Post, given),
        (r"/lab", _Browser, given),
        (r"/([a-z_]*\.?[a-z]*)", _File, given),
    ]
    # What strangers send wrong is counted by us, and is no news for a terminal.
    for name in ("tornado.access", "tornado.general"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    application = Application(
        routes,
        default_handler_class=_Nothing,
        default_handler_args=given,
        websocket_max_message_size=LARGEST_WORDS,
        websocket_ping_interval=_LOST_S / 2,
        websocket_ping_timeout=_LOST_S / 2,
    )
    return BoundedServer(
        application,
        refuse=lambda: page.admission.refuse("too many connections"),
        max_header_size=16_384,
        max_body_size=2 * LARGEST_WORDS,
        max_buffer_size=1 << 20,
        body_timeout=_HELLO_S,
        idle_connection_timeout=_LOST_S,
    )
