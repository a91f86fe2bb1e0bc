"""A motion capture's frames on their way to the wire: what every bridge publishes, reports and says."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from hil.bridge.body_frames import frame_message, known_as
from hil.bridge.body_watch import BodyWatch
from hil.bridge.seen_frame import SeenFrame, Up
from hil.errors import UsageError
from hil.live.finding_lines import FindingLines
from hil.nodes.node import Outgoing, diagnostics, is_due, outgoing
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.source_topics import all_bodies, source_topics

_PERIOD_NS = 500_000_000


class MocapWire:
    """Makes frames messages by the names, axes and topic of a scenario, and reports twice a second.

    ``name``: of the bridge in diagnostics. ``up``: which of the capture's axes points up, None for the one
    of the scenario's ``source.up``. Messages have that of ``source.up`` in any case, as that is what whoever
    hears them expects. ``say``: takes lines for the console, each once when it begins to be so. Raises
    :class:`UsageError` where the scenario has its motion capture in other messages.
    """

    def __init__(self, name: str, scenario: Scenario, up: Up | None, say: Callable[[str], None]) -> None:
        if scenario.source.type != "RigidBodies":
            raise UsageError(
                f"source.type = {scenario.source.type!r}: the bridge publishes RigidBodies; "
                "leave source.type out, or leave out the bridge"
            )
        self._name = name
        self._source = scenario.source
        self._topic = next(iter(source_topics(scenario)), topics.RIGID_BODIES)
        self._up: Up = up or scenario.source.up
        self.watch = BodyWatch(all_bodies(scenario), self._up)
        self._say, self._said = say, ""
        self._findings = FindingLines(say)
        self._report_ns = 0

    def publish(self, frame: SeenFrame) -> Outgoing:
        """The message of a frame."""
        names = known_as(frame.bodies, self.watch.wanted)
        self.watch.see(frame, names)
        return outgoing(self._topic, frame_message(frame, names, self._up, self._source), frame.capture_ns)

    def report(self, now_ns: int, waiting: str, values: Mapping[str, object]) -> Iterator[Outgoing]:
        """Diagnostics, when they are due.

        ``waiting``: what keeps frames from coming, in words, empty if nothing does.
        """
        if not is_due(self._report_ns, _PERIOD_NS, now_ns):
            return
        self._report_ns = now_ns + _PERIOD_NS
        yield self.last_report(now_ns, waiting, values)

    def last_report(self, now_ns: int, waiting: str, values: Mapping[str, object]) -> Outgoing:
        """Diagnostics now; what is new in them goes to the console too."""
        state = waiting or self.watch.state(now_ns)
        findings = self.watch.findings(now_ns)
        self.say(state)
        self._findings.note(self._name, {name: text for name, text in findings.items() if name != "bodies"})
        problem = state if state.startswith("waiting") else "; ".join(findings)
        told = {**values, **self.watch.values(now_ns)}
        return outgoing(topics.DIAGNOSTICS, diagnostics(self._name, now_ns, problem, told), now_ns)

    def say(self, state: str) -> None:
        """Say on the console how things are, unless that is what was said last."""
        if state != self._said:
            self._said = state
            self._say(state)
