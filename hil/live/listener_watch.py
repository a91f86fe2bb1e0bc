"""Who listens to the commands of our robots, as the tokens of the ROS graph tell it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from hil.nodes.findings import Findings, named_findings
from hil.nodes.listeners import listener_findings
from hil.nodes.node import Outgoing, diagnostics, is_due, outgoing
from hil.wire import topics
from hil.wire.key_layout import KeyLayout
from hil.wire.pubsub import Wire

_PERIOD_NS = 500_000_000
_PATIENCE_NS = 1_000_000_000


class Commanded(NamedTuple):
    """A robot that we drive. ``node``: what its findings are reported by.

    ``wanted``: where we send what it is to drive, to its guard where it has one.
    """

    node: str
    cmd_vel: str
    odom: str
    wanted: str


class ListenerWatch:
    """Reports, while something is wrong, on the robots that tell of themselves in the ROS graph.

    One whose odometry has no token there may listen without a token too: of that nothing is said.
    """

    def __init__(
        self, wire: Wire, layout: KeyLayout, robots: Sequence[Commanded], hear: Callable[[bytes], None]
    ) -> None:
        self._wire, self._layout, self._robots, self._hear = wire, layout, robots, hear
        self._since_ns: dict[str, int] = {}
        self._found: dict[str, Findings] = {}
        self._due_ns = 0
        wire.watch_graph()

    def reports(self, now_ns: int) -> Iterator[Outgoing]:
        """What there is to say, when it is due."""
        if not is_due(self._due_ns, _PERIOD_NS, now_ns):
            return
        self._due_ns = now_ns + _PERIOD_NS
        for robot in self._robots:
            found = self._findings(robot, now_ns)
            if found or self._found.get(robot.node):
                report = diagnostics(robot.node, now_ns, "; ".join(found.values()), named_findings(found))
                said = outgoing(topics.DIAGNOSTICS, report, now_ns)
                self._hear(said.payload)
                yield said
            self._found[robot.node] = found

    def _findings(self, robot: Commanded, now_ns: int) -> Findings:
        """What is wrong and has been for a second: robots come up one topic after the other."""
        found = self._wrong(robot)
        since_ns = self._since_ns.setdefault(robot.node, now_ns) if found else now_ns
        if not found:
            self._since_ns.pop(robot.node, None)
        return found if now_ns - since_ns >= _PATIENCE_NS else {}

    def _wrong(self, robot: Commanded) -> Findings:
        graph = self._wire.graph()
        wheels = {each.session for each in graph if each.publishes and each.key == self._key(robot.odom)}
        if not wheels:
            return {}
        guards = {
            each.session for each in graph if not each.publishes and each.key == self._key(robot.wanted)
        }
        # A robot that has its guard inside has its driver there too.
        hearers = (robot.wanted,) if wheels & guards else (robot.wanted, robot.cmd_vel)
        for topic in hearers:
            key, name = self._key(topic), f"/{self._layout.name(topic)}"
            heard_as = [each.typename for each in graph if not each.publishes and each.key == key]
            if found := listener_findings(name, self._layout.types[topic], heard_as):
                return found
        return {}

    def _key(self, topic: str) -> str:
        return self._layout.within(self._layout.name(topic))
