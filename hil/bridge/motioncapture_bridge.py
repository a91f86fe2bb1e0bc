"""Vicon, Qualisys, VRPN and OptiTrack through PyPI's ``motioncapture``, an extra."""

from __future__ import annotations

import importlib
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol

from hil.bridge.mocap_wire import MocapWire
from hil.bridge.seen_frame import SeenBody, SeenFrame
from hil.errors import AbreastError, UsageError
from hil.nodes.node import Outgoing
from hil.wire.mailbox import Mailbox

_WAITING_FRAMES = 1000


class Source(Protocol):
    """A connection of the library, which has no types of its own."""

    @property
    def rigidBodies(self) -> Mapping[str, Any]:  # noqa: N802
        """Bodies of the last frame by their names, each with a ``position`` and a ``rotation``."""

    def waitForNextFrame(self) -> None:  # noqa: N802
        """Return when there is another frame, which may be never."""


def connector(kind: str, host: str, port: str = "") -> Callable[[], Source]:
    """What connects to a motion capture, and may wait for it without end.

    Raises :class:`UsageError` where the library is not there.
    """
    try:
        library = importlib.import_module("motioncapture")
    except ImportError:
        raise UsageError(
            "bridge mocap: needs the library motioncapture; install it with: pip install 'abreast[mocap]'"
        ) from None
    told = {"hostname": host, **({"port_command": port, "port": port} if port else {})}
    connect: Callable[[str, dict[str, str]], Source] = library.connect
    return lambda: connect(kind, told)


class MotionCaptureBridge:
    """Brings the frames of a source. ``connect``: gives it; a thread waits for that, and for each frame.

    The library tells no time of a capture, so the time is that of arrival. What it sees it lists, and
    nothing else, under names of its own.
    """

    def __init__(self, connect: Callable[[], Source], where: str, wire: MocapWire) -> None:
        self._connect, self._where, self._wire = connect, where, wire
        self._frames: Mailbox[SeenFrame | None] = Mailbox()
        self._next: SeenFrame | None = None
        self._connected, self._failure = False, ""
        self._number = self._dropped = 0
        threading.Thread(target=self._listen, daemon=True).start()

    def wait(self, timeout: float) -> None:
        """Return when a frame has come, at the latest after ``timeout`` [s]."""
        self._next = self._frames.take(timeout)

    def take(self, now_ns: int) -> Iterator[Outgoing]:
        """Messages of the frames that have come, and diagnostics when they are due.

        Raises :class:`AbreastError` where the library has given up.
        """
        while self._next is not None:
            yield self._wire.publish(self._next)
            self.wait(0.0)
        if self._failure:
            raise AbreastError(f"{self._where}: {self._failure}; is its address right, and does it stream?")
        yield from self._wire.report(now_ns, self._waiting(), self._values())

    def end(self, now_ns: int) -> Iterator[Outgoing]:
        """The last diagnostics."""
        yield self._wire.last_report(now_ns, self._waiting(), self._values())

    def close(self) -> None:
        """Leave the thread behind: what it waits for may never come, and it ends with the process."""

    def _waiting(self) -> str:
        return "" if self._connected else f"waiting for an answer of {self._where}"

    def _values(self) -> dict[str, object]:
        return {"server": self._where, "frames": self._number, "dropped": self._dropped}

    def _listen(self) -> None:
        try:
            source = self._connect()
            self._connected = True
            while True:
                source.waitForNextFrame()
                self._hear(source)
        except Exception as error:
            # Whatever goes wrong within the library ends the bridge, in its own words.
            self._failure = " ".join(str(error).split()) or type(error).__name__
            self._frames.put(None)

    def _hear(self, source: Source) -> None:
        now_ns = time.time_ns()
        self._number += 1
        bodies = tuple(_seen(name, body) for name, body in source.rigidBodies.items())
        if len(self._frames) < _WAITING_FRAMES:
            self._frames.put(SeenFrame(self._number, now_ns, now_ns, bodies))
        else:
            self._dropped += 1


def _seen(name: str, body: Any) -> SeenBody:
    x, y, z = (float(along) for along in body.position)
    turned = body.rotation
    return SeenBody(name, "", (x, y, z), (turned.x, turned.y, turned.z, turned.w))
