"""The bridge to ROS 2: bytes from one side to the other, and who listens there."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Protocol

from formation.pose import STANDSTILL
from hil.bridge.ros_routes import Route
from hil.live.finding_lines import FindingLines
from hil.nodes.findings import named_findings
from hil.nodes.listeners import listener_findings
from hil.nodes.node import Outgoing, diagnostics, is_due, named_counts, outgoing
from hil.wire import topics
from hil.wire.drive_message import drive_message
from hil.wire.events import Event
from hil.wire.messages import encode
from hil.wire.pubsub import Wire

NAME = "bridge/ros2"
_PERIOD_NS = 500_000_000
_PATIENCE_NS = 1_500_000_000
_PUMP_WAIT = 0.1
_ECHO_S = 1.0
_LINGER_S = 0.2


class Graph(Protocol):
    """The side of ROS 2."""

    def spin(self, timeout: float) -> None:
        """Hear what is there, at the latest after ``timeout`` [s]."""

    def publish(self, topic: str, payload: bytes) -> None:
        """Publish a message that is given as its bytes."""

    def listeners(self, topic: str) -> list[str]:
        """Types by which others listen to a topic that we publish, one for each."""

    def close(self) -> None:
        """Leave the graph."""


class RosBridge:
    """Carries the routes between the wire and a graph. ``say``: takes lines for the console.

    What comes from ROS is published by whoever calls :meth:`take`; what goes there is by a thread of its
    own, so that neither way waits for the other.
    """

    def __init__(
        self,
        wire: Wire,
        routes: tuple[Route, ...],
        make_graph: Callable[[Callable[[str, bytes], None]], Graph],
        say: Callable[[str], None],
    ) -> None:
        self._wire, self._routes = wire, routes
        self._types = {route.topic: route.typename for route in routes}
        self._two_way = frozenset(route.topic for route in routes if route.way == "both")
        self._echoes: dict[bytes, float] = {}
        self._lock = threading.Lock()
        self._heard: list[tuple[str, bytes]] = []
        self._carried: Counter[str] = Counter()
        self._refused: Counter[str] = Counter()
        self._begun_ns = self._report_ns = 0
        self._say, self._findings, self._waits = say, FindingLines(say), ""
        self._graph = make_graph(self._hear)
        wire.subscribe(route.topic for route in routes if route.way != "in")
        self._closing = False
        self._pump = threading.Thread(target=self._carry_out, daemon=True)
        self._pump.start()

    def wait(self, timeout: float) -> None:
        """Return when something has come from ROS, at the latest after ``timeout`` [s]."""
        self._graph.spin(timeout)

    def take(self, now_ns: int) -> Iterator[Outgoing]:
        """What has come from ROS, and diagnostics when they are due."""
        heard, self._heard = self._heard, []
        for topic, payload in heard:
            if not self._wire.may_publish(topic):
                self._leave_out(topic)
                continue
            self._carried[topic] += 1
            yield Outgoing(topic, self._types[topic], payload, now_ns)
        self._begun_ns = self._begun_ns or now_ns
        if is_due(self._report_ns, _PERIOD_NS, now_ns):
            self._report_ns = now_ns + _PERIOD_NS
            yield self._report(now_ns)

    def end(self, now_ns: int) -> Iterator[Outgoing]:
        """The last diagnostics."""
        yield self._report(now_ns)

    def close(self) -> None:
        """Carry what is on its way, tell the robots that were told to drive to stand, and leave the graph.

        Nobody reaches them through here any more.
        """
        self._closing = True
        self._wire.wake()
        self._pump.join()
        while (event := self._wire.inbox.take(0.0)) is not None:
            self._carry(event)
        for route in self._routes:
            if route.drives and self._carried[route.topic]:
                stamped = route.typename.endswith("Stamped")
                frame = route.topic.rpartition("/")[0]
                still = drive_message(STANDSTILL, time.time_ns(), frame, stamped=stamped)
                self._carry(Event(route.topic, encode(still)))
        # What is on its way is lost with who sent it; odometry that comes meanwhile would cut one wait short.
        until = time.monotonic() + _LINGER_S
        while (left := until - time.monotonic()) > 0.0:
            self._graph.spin(left)
        self._graph.close()

    def _hear(self, topic: str, payload: bytes) -> None:
        if not self._is_echo(topic, payload):
            self._heard.append((topic, payload))

    def _carry_out(self) -> None:
        while not self._closing:
            event = self._wire.inbox.take(_PUMP_WAIT)
            if event is not None:
                self._carry(event)

    def _carry(self, event: Event) -> None:
        if not event.topic or self._is_echo(event.topic, event.payload):
            return
        try:
            self._graph.publish(event.topic, event.payload)
        except Exception as error:
            if not self._refused[event.topic]:
                self._say(
                    f"ROS refuses a message on {event.topic} ({error}); it is dropped, as others like it"
                )
            self._refused[event.topic] += 1
            return
        self._carried[event.topic] += 1

    def _leave_out(self, topic: str) -> None:
        """An order from ROS where keys say who gives orders: nobody knows who it is there."""
        if not self._refused[topic]:
            self._say(f"our keys do not let {topic} through from ROS; it is dropped, as others like it")
        self._refused[topic] += 1

    def _is_echo(self, topic: str, payload: bytes) -> bool:
        """Whether this very message of a two-way route was carried just now, be it the other way."""
        if topic not in self._two_way:
            return False
        now = time.monotonic()
        with self._lock:
            before = self._echoes.get(payload, -_ECHO_S)
            self._echoes = {each: at for each, at in self._echoes.items() if now - at < _ECHO_S}
            self._echoes.setdefault(payload, now)
        return now - before < _ECHO_S

    def _report(self, now_ns: int) -> Outgoing:
        """What was carried, who listens, and what is wrong with that."""
        values: dict[str, object] = named_counts("carried", self._carried.copy())
        values |= named_counts("refused", self._refused.copy())
        silent = [
            route.name
            for route in self._routes
            if route.way == "in" and not route.optional and not self._carried[route.topic]
        ]
        found: dict[str, list[str]] = {}
        for route in self._routes:
            if route.drives:
                types = self._graph.listeners(route.topic)
                values[f"listeners.{route.topic}"] = len(types)
                if not (route.due or self._carried[route.topic]):
                    continue
                for name, text in listener_findings(route.name, route.typename, types).items():
                    found.setdefault(name, []).append(text)
        begun = now_ns - self._begun_ns >= _PATIENCE_NS
        findings = {name: "; ".join(texts) for name, texts in found.items() if begun}
        problem = f"waiting for {', '.join(silent)}" if silent else ""
        self._say_waiting(problem)
        self._findings.note(NAME, findings)
        told = diagnostics(NAME, now_ns, problem, values | named_findings(findings))
        return outgoing(topics.DIAGNOSTICS, told, now_ns)

    def _say_waiting(self, problem: str) -> None:
        if problem != self._waits:
            self._say(problem or "hears all that it waited for")
            self._waits = problem
