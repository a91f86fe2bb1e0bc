"""A relay between a lab's router and whoever connects: it may freeze, delay and narrow what passes.

``python -m hil.faults.relay PORT TO_PORT``; a line on its standard input says how it is from now on:
``pass``, ``freeze``, ``delay SECONDS``, ``jitter SECONDS`` or ``rate BYTES_PER_SECOND``.
"""

from __future__ import annotations

import asyncio
import random
import sys
import threading
from dataclasses import dataclass

_CHUNK = 65_536


@dataclass(slots=True)
class Way:
    """How the link is now: frozen or not, the delay and its random part [s], the rate [bytes/s]."""

    frozen: bool = False
    delay_s: float = 0.0
    jitter_s: float = 0.0
    rate: float = 0.0

    def become(self, words: list[str]) -> None:
        """Be from now on what a line says; nothing of what was before it stays."""
        kind, value = words[0], float(words[1]) if len(words) > 1 else 0.0
        self.frozen = kind == "freeze"
        self.delay_s = value if kind == "delay" else 0.0
        self.jitter_s = value if kind == "jitter" else 0.0
        self.rate = value if kind == "rate" else 0.0


class Relay:
    """Connections from one port to another, in both directions by the same way."""

    def __init__(self, to_port: int) -> None:
        self.way = Way()
        self._to_port = to_port
        self._dice = random.Random(1)

    async def serve(self, port: int) -> None:
        """Serve for ever."""
        server = await asyncio.start_server(self._meet, "127.0.0.1", port)
        async with server:
            await server.serve_forever()

    async def _meet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._to_port)
        except OSError:
            writer.close()
            return
        await asyncio.gather(self._carry(reader, far_writer), self._carry(far_reader, writer))

    async def _carry(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One direction: what comes is due some time later, in order, as on any stream."""
        loop = asyncio.get_running_loop()
        waiting: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue(256)

        async def deliver() -> None:
            while (entry := await waiting.get())[1]:
                due_s, data = entry
                while (left := due_s - loop.time()) > 0.0 or self.way.frozen:
                    await asyncio.sleep(min(max(left, 0.001), 0.01))
                if self.way.rate > 0.0:
                    await asyncio.sleep(len(data) / self.way.rate)
                writer.write(data)
                await writer.drain()
            writer.close()

        delivering = asyncio.create_task(deliver())
        try:
            while data := await reader.read(min(_CHUNK, int(self.way.rate) or _CHUNK)):
                late_s = self.way.delay_s + self._dice.random() * self.way.jitter_s
                await waiting.put((loop.time() + late_s, data))
        except OSError:
            pass
        await waiting.put((0.0, b""))
        await asyncio.gather(delivering, return_exceptions=True)


def main() -> None:
    """Relay until standard input ends."""
    relay = Relay(int(sys.argv[2]))
    threading.Thread(target=lambda: asyncio.run(relay.serve(int(sys.argv[1]))), daemon=True).start()
    for line in sys.stdin:
        if words := line.split():
            relay.way.become(words)


if __name__ == "__main__":
    main()
