"""The emulated motion capture as Motive serves its own: NatNet over UDP, beside or in place of the wire."""

from __future__ import annotations

import select
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from hil.bridge.datagram_sockets import arrivals, open_socket, send
from hil.bridge.natnet_frame import Body
from hil.bridge.natnet_packets import VERSIONS, ServerInfo, Version
from hil.bridge.natnet_service import FREQUENCY, NatNetService
from hil.emulator.node import EmulatorNode
from hil.emulator.plant import Plant, lab_of
from hil.live.daemon import Ending
from hil.live.node_worker import NodeWorker
from hil.nodes.node import Outgoing
from hil.wire import topics
from hil.wire.events import TICK, Event
from hil.wire.mailbox import Bell
from hil.wire.message_types import RigidBodies
from hil.wire.messages import decode_as, to_ns
from hil.wire.pose_sources import laid, places_of
from hil.wire.records import Placement
from hil.wire.source_topics import all_bodies

_MARKER_ERROR = 0.0002
_UPTIME_NS = 86_400_000_000_000
_LONGEST_WAIT = 0.1
_RELEASES = dict(zip(VERSIONS, ("2.0.0.0", "2.2.0.0", "3.0.0.0", "3.1.0.0"), strict=True))
"""The Motive that speaks each version."""


@dataclass(frozen=True, slots=True)
class Serving:
    """How to serve. A port of 0 is any that is free; ``data_port``: of the clients, or of the group."""

    address: str
    version: Version
    command_port: int
    data_port: int
    multicast: bool = False


class NatNetEmulator(NodeWorker):
    """Carries the emulator on, and serves its frames by NatNet; none of them goes to the wire.

    Its axes are those of the scenario's ``source.up``, its unit is the metre.
    A thread answers clients at once: how long an answer takes is what they set their clocks by. ``alone``:
    the leader sets off at once, with nobody to wait for. Raises :class:`~hil.errors.AbreastError` where the
    port is taken.
    """

    def __init__(
        self,
        node: EmulatorNode,
        serving: Serving,
        *,
        alone: bool = False,
        on_report: Callable[[bytes], None] = lambda _: None,
    ) -> None:
        super().__init__([node], on_report=on_report)
        scenario = node.scenario
        self._up = scenario.source.up
        self._alone, self._capture_clock = alone, lab_of(scenario).clock
        self._base_ns = 0
        self._socket = open_socket(serving.address, serving.command_port)
        if serving.multicast:
            interface = socket.inet_aton(serving.address)
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
        self.info = ServerInfo(
            "Motive",
            _RELEASES[serving.version],
            serving.version,
            FREQUENCY,
            serving.data_port or _free_port(),
            serving.multicast,
        )
        self.names = all_bodies(scenario)
        self._service = NatNetService(self.info, self.names, scenario.mocap.rate_hz, self._reading_ns)
        self._lock, self._closed = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._answer, daemon=True)

    @property
    def command_port(self) -> int:
        """The port that answers."""
        port: int = self._socket.getsockname()[1]
        return port

    def begin(self, now_ns: int) -> None:
        """Let the emulator come up, and begin to answer."""
        super().begin(now_ns)
        self._base_ns = now_ns - _UPTIME_NS
        if self._alone:
            self._plant.let_go()
        self._thread.start()

    def take(self, event: Event, now_ns: int) -> Iterator[Outgoing]:
        """What the emulator says but for its frames, which go to the clients."""
        for message in super().take(event, now_ns):
            if message.topic == topics.RIGID_BODIES:
                self._serve(message.payload)
            else:
                yield message

    def end(self, now_ns: int) -> Iterator[Outgoing]:
        """The last report; nobody is answered any more."""
        self._closed.set()
        self._thread.join()
        self._socket.close()
        yield from super().end(now_ns)

    @property
    def _plant(self) -> Plant:
        plant: Plant = self._states[0].plant
        return plant

    def _reading_ns(self, at_ns: int) -> int:
        """What the served clock shows at a host time: the emulated capture's, since it was switched on."""
        plant = self._plant
        reading_ns = self._capture_clock.reading_ns(at_ns, plant.world().begun_ns, plant.motion_since_ns)
        return max(0, reading_ns - self._base_ns)

    def _serve(self, payload: bytes) -> None:
        frame = decode_as(payload, RigidBodies)
        places = (laid(each.place, self._up, 1.0) for each in places_of(frame))
        bodies = [_body(k, place) for k, place in enumerate(places, start=1)]
        captured_ns = max(0, to_ns(frame.header.stamp) - self._base_ns)
        with self._lock:
            packets = self._service.frame(frame.frame_number, bodies, captured_ns, time.time_ns())
        for data, address in packets:
            send(self._socket, data, address)

    def _answer(self) -> None:
        while not self._closed.is_set():
            select.select([self._socket], [], [], _LONGEST_WAIT)
            for data, sender, at_ns in arrivals(self._socket):
                # Sent before it is let go: a frame that overtook the model would be taken for it.
                with self._lock:
                    answer = self._service.hear(data, sender, at_ns)
                    if answer is not None:
                        send(self._socket, answer, sender)


def run_alone(
    worker: NatNetEmulator, ending: Ending, duration_s: float | None, on_ready: Callable[[], None]
) -> None:
    """Let the emulator go on without a wire until the end is asked for or ``duration_s`` is over."""
    asked = Bell()
    ending.notify(asked.ring)
    worker.begin(time.time_ns())
    on_ready()
    until = None if duration_s is None else time.monotonic() + duration_s
    while not ending.asked and (until is None or time.monotonic() < until):
        asked.wait(min((worker.due_ns() - time.time_ns()) * 1e-9, _LONGEST_WAIT))
        for _ in worker.take(TICK, time.time_ns()):
            pass
    for _ in worker.end(time.time_ns()):
        pass


def _body(number: int, place: Placement) -> Body:
    x, y, z, qx, qy, qz, qw = place
    return Body(number, (x, y, z), (qx, qy, qz, qw), _MARKER_ERROR, tracked=True)


def _free_port() -> int:
    with open_socket() as probe:
        port: int = probe.getsockname()[1]
        return port
