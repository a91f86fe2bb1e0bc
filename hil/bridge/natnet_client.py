"""A NatNet client without its sockets: what it asks of a server and when, and what it makes of answers."""

from __future__ import annotations

from collections.abc import Callable

from hil.bridge.datagram_reader import DatagramReader, MalformedDatagramError
from hil.bridge.natnet_frame import Body, Frame, read_frame
from hil.bridge.natnet_model import Names, read_model
from hil.bridge.natnet_packets import (
    NEWEST,
    OLDEST,
    Kind,
    ServerInfo,
    connect_request,
    echo_request,
    opened,
    packet,
    read_echo,
    read_server_info,
    text_request,
)
from hil.bridge.seen_frame import FrameNumbers, SeenBody, SeenFrame
from hil.bridge.server_clock import ServerClock
from hil.nodes.node import is_due

_S_NS = 1_000_000_000
_SILENCE_NS = 3 * _S_NS
_ASK_NS = _S_NS
_FIRST_ECHOES = 10
_FIRST_ECHO_NS = 50_000_000
_ECHO_NS = 500_000_000
_EARLIEST_NS = 60 * _S_NS
_LATEST_NS = _S_NS


class NatNetClient:
    """One server's frames, by the host's clock. ``now_ns`` is that clock wherever it is asked for.

    ``info``: what the server says of itself, None until it answers, and again when it has been silent for
    3 s. ``names``: those of its model, None until it comes. ``clock``: the server's, None as long as
    ``info``. ``refused``: datagrams and frames that were dropped, by cause. ``guessed``: frames whose time
    rests on when they arrived, for want of an echo or of a time of exposure.
    """

    def __init__(self) -> None:
        self.info: ServerInfo | None = None
        self.version = NEWEST
        self.names: Names | None = None
        self.clock: ServerClock | None = None
        self.numbers = FrameNumbers()
        self.refused: dict[str, int] = {}
        self.guessed = 0
        self._heard_ns = 0
        self._connect_ns = self._model_ns = self._echo_ns = self._keep_ns = 0
        self._echoes = 0
        self._asked_bitstream = False
        self._model_is_old = True
        self._hears: dict[int, Callable[[DatagramReader, int], None]] = {
            Kind.SERVER_INFO: self._on_info,
            Kind.MODEL: self._on_model,
            Kind.ECHO_RESPONSE: self._on_echo,
            Kind.RESPONSE: self._on_response,
        }

    def due_ns(self) -> int:
        """When there is something to ask next."""
        if self.info is None:
            return self._connect_ns
        due = min(self._echo_ns, self._keep_ns)
        return min(due, self._model_ns) if self._model_is_old else due

    def requests(self, now_ns: int) -> list[bytes]:
        """What to send to the server's command port now."""
        if self.info is not None and now_ns - self._heard_ns > _SILENCE_NS:
            self._forget()
        asked: list[bytes] = []
        if self.info is None:
            if is_due(self._connect_ns, _ASK_NS, now_ns):
                self._connect_ns = now_ns + _ASK_NS
                asked.append(connect_request())
            return asked
        if self._model_is_old and is_due(self._model_ns, _ASK_NS, now_ns):
            self._model_ns = now_ns + _ASK_NS
            asked.append(packet(Kind.REQUEST_MODEL))
        if not self._asked_bitstream and self.info.version > NEWEST and not self.info.multicast:
            self._asked_bitstream = True
            asked.append(text_request(f"Bitstream,{NEWEST}"))
        if is_due(self._keep_ns, _ASK_NS, now_ns):
            self._keep_ns = now_ns + _ASK_NS
            asked.append(packet(Kind.KEEP_ALIVE))
        if is_due(self._echo_ns, _ECHO_NS, now_ns):
            self._echo_ns = now_ns + (_FIRST_ECHO_NS if self._echoes < _FIRST_ECHOES else _ECHO_NS)
            asked.append(echo_request(now_ns))
        return asked

    def hear(self, data: bytes, now_ns: int) -> SeenFrame | None:
        """Take in a datagram; the frame in it, if it is a new one. Never raises."""
        try:
            kind, reader = opened(data)
            if kind == Kind.FRAME:
                return self._on_frame(reader, now_ns)
            if handler := self._hears.get(kind):
                handler(reader, now_ns)
                self._heard_ns = now_ns
        except MalformedDatagramError as error:
            self.refuse(error.cause)
        return None

    def refuse(self, cause: str) -> None:
        """Count something that was dropped."""
        self.refused[cause] = self.refused.get(cause, 0) + 1

    def _on_info(self, reader: DatagramReader, now_ns: int) -> None:
        info = read_server_info(reader)
        if info == self.info:
            return
        self.info, self.version = info, info.version
        self.clock = ServerClock(info.frequency) if info.frequency else None
        self._model_is_old, self._model_ns = True, now_ns
        self._echo_ns, self._echoes, self._keep_ns = now_ns, 0, now_ns
        self._asked_bitstream = False

    def _on_model(self, reader: DatagramReader, _now_ns: int) -> None:
        if self.info is not None and self.version >= OLDEST:
            self.names = read_model(reader, self.version)
            self._model_is_old = False

    def _on_echo(self, reader: DatagramReader, now_ns: int) -> None:
        echo = read_echo(reader)
        if self.clock is None or not now_ns - _SILENCE_NS < echo.asked <= now_ns:
            self.refuse("echo")
            return
        self.clock.hear(echo.asked, now_ns, echo.ticks)
        self._echoes += 1

    def _on_response(self, reader: DatagramReader, _now_ns: int) -> None:
        # The only request in words is the one for a layout; what is refused stays as it is.
        if self._asked_bitstream and self.version > NEWEST and not any(reader.rest()):
            self.version = NEWEST

    def _on_frame(self, reader: DatagramReader, now_ns: int) -> SeenFrame | None:
        if self.info is None or self.version < OLDEST:
            self.refuse("before_server_info")
            return None
        frame = read_frame(reader, self.version)
        self._heard_ns = now_ns
        if not self.numbers.hear(frame.number):
            return None
        names = self.names or {}
        if frame.models_changed or any(body.id not in names for body in frame.bodies):
            self._model_is_old = True
        capture_ns = self._capture_ns(frame, now_ns)
        if not now_ns - _EARLIEST_NS < capture_ns < now_ns + _LATEST_NS:
            self.refuse("time")
            return None
        bodies = tuple(_seen(body, names) for body in frame.bodies)
        return SeenFrame(frame.number, capture_ns, now_ns, bodies)

    def _capture_ns(self, frame: Frame, now_ns: int) -> int:
        """Host time of the middle of the exposure."""
        clock = self.clock
        if clock is not None and frame.exposed and clock.known:
            return clock.host_ns(frame.exposed)
        self.guessed += 1
        if clock is None or not frame.exposed:
            return now_ns
        return now_ns - max(0, clock.nanoseconds(frame.sent - frame.exposed))

    def _forget(self) -> None:
        self.info = self.clock = None
        self._connect_ns = 0


def _seen(body: Body, names: Names) -> SeenBody:
    own = str(body.id)
    return SeenBody(names.get(body.id, own), own, body.position, body.orientation, body.tracked)
