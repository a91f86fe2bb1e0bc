from __future__ import annotations

import asyncio

import pytest
from tornado.httputil import HTTPServerRequest

from hil.live_page import bounded_server
from hil.live_page.bounded_server import BoundedServer
from hil.live_page.serving import bound


def nothing(_: HTTPServerRequest) -> None:
    """Answer nobody."""


@pytest.mark.parametrize("bounds", [(100, 3), (3, 100)], ids=["from one address", "from all"])
def test_connections_beyond_a_bound_are_closed_and_make_room_once_others_go(
    bounds: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, bound_of in zip(("MOST_OPEN", "MOST_OPEN_EACH"), bounds, strict=True):
        monkeypatch.setattr(bounded_server, name, bound_of)
    refused: list[bool] = []

    async def crowd() -> None:
        server = BoundedServer(nothing, refuse=lambda: refused.append(True))
        listening = bound("127.0.0.1", 0)
        server.add_socket(listening)

        async def another() -> asyncio.StreamWriter:
            reader, writer = await asyncio.open_connection(*listening.getsockname()[:2])
            readers[writer] = reader
            return writer

        readers: dict[asyncio.StreamWriter, asyncio.StreamReader] = {}
        kept = [await another() for _ in range(3)]
        assert await readers[await another()].read() == b""
        assert refused == [True]
        kept[0].close()
        while sum(not each.closed() for each in server._streams) == 3:
            await asyncio.sleep(0.01)
        newcomer = await another()
        newcomer.write(b"junk\r\n\r\n")
        assert b"400" in await readers[newcomer].read()
        assert refused == [True]
        for writer in readers:
            writer.close()
        server.stop()
        await server.close_all_connections()

    asyncio.run(crowd())
