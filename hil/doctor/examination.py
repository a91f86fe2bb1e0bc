"""What a lab's messages tell the doctor; time comes in with them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from formation.pose import STANDSTILL, Motion
from hil.doctor.check import Check
from hil.doctor.drive_checks import CREEP, CREEP_S, REST_S, TURN, TURN_S, Span, drive_checks
from hil.doctor.evidence import Evidence
from hil.doctor.frame_checks import frame_checks
from hil.doctor.robot_checks import robot_checks
from hil.errors import UsageError
from hil.nodes.findings import advice_on, findings_json
from hil.nodes.link_nodes import estimator_node, source_nodes
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from hil.wire.events import TICK, Event
from hil.wire.key_layout import KeyLayout
from hil.wire.lab_robots import LabRobot
from hil.wire.ros_tokens import Endpoint
from hil.wire.topics import RIGID_BODIES

Tell = Callable[[LabRobot, Motion, float], Span]
"""Tells a robot to move for a while [s], and gives the span of time in which it did."""


class Examination:
    """Takes in messages as an estimator would, and beside it: what an estimator finds counts here too."""

    def __init__(self, scenario: Scenario, now_ns: int) -> None:
        links = links_of(scenario)
        self.scenario = scenario
        self.found = Evidence(scenario)
        self._sources = [(node, node.begin(now_ns)) for node in source_nodes(links, scenario)]
        self._estimators = [(node, node.begin(now_ns)) for node in map(estimator_node, links)]

    @property
    def subscribes(self) -> tuple[str, ...]:
        """Topics to hear."""
        heard = {*self.found.topics}.union(*(node.subscribes for node, _ in self._estimators))
        if self._sources:
            heard = (heard - {RIGID_BODIES}).union(*(node.subscribes for node, _ in self._sources))
        return tuple(sorted(heard))

    def hear(self, event: Event, now_ns: int) -> None:
        """Take in a message."""
        for source, known in self._sources:
            if event.topic in source.subscribes:
                for made in source.step(known, event, now_ns)[1]:
                    self.hear(Event(made.topic, made.payload), now_ns)
                return
        self.found.hear(event, now_ns)
        for node, state in self._estimators:
            if event.topic in node.subscribes:
                node.step(state, event, now_ns)

    def tick(self, now_ns: int) -> None:
        """Let time pass."""
        for node, state in self._estimators:
            node.step(state, TICK, now_ns)

    def checks(self, graph: Sequence[Endpoint], layout: KeyLayout, now_ns: int) -> Iterator[Check]:
        """What was seen. ``graph``: who publishes and who hears what, as far as it shows."""
        yield from frame_checks(self.found)
        for source, known in self._sources:
            if text := source.differing(known):
                yield Check("frames_of_reference", False, text, "one", advice_on("frames_of_reference"))
        yield from robot_checks(self.found, graph, layout)
        for name, text in self.found.reported_findings():
            yield Check(name, False, text, "nothing", advice_on(name))
        for node, state in self._estimators:
            for name, text in node.findings(state, now_ns).items():
                yield Check(name, False, text, "what estimates can rest on", advice_on(name))

    def findings(self, now_ns: int) -> list[dict[str, Any]]:
        """What the estimators find, as results have it."""
        found = (node.findings(state, now_ns) for node, state in self._estimators)
        return [each for findings in found for each in findings_json(findings)]

    def robot(self, name: str) -> LabRobot:
        """The robot of a name, a body or a namespace; :class:`UsageError` if there is none."""
        for robot in self.found.robots:
            if name in (robot.name, robot.body, robot.namespace):
                return robot
        known = ", ".join(robot.name for robot in self.found.robots)
        raise UsageError(
            f"--drive {name!r}: scenario {self.scenario.name} has no such robot; one of: {known}"
        )

    def hindrance(self, robot: LabRobot) -> Check | None:
        """Why a robot is not to be driven now, if it is not: it cannot obey two."""
        if text := self.found.guards.held.get(robot.name):
            seen = f"{robot.name}: its guard holds it: {text}; it was not driven"
            return Check("drive", False, seen, "a guard that lets it be driven", advice_on("guard_latched"))
        topic = self.found.commands_to(robot)
        others = len(self.found.commands.get(topic, [])) + self.found.unread.get(topic, 0)
        if not others:
            return None
        seen = f"{robot.name}: {others} commands of somebody else on {topic}; it was not driven"
        return Check("drive", False, seen, "nobody else who commands it", advice_on("second_sender"))

    def drive(self, robot: LabRobot, tell: Tell) -> list[Check]:
        """Let a robot creep and turn, and check what came of it. It is told to stand however this ends."""
        try:
            # A guard takes a sender that begins with a standstill.
            tell(robot, STANDSTILL, REST_S)
            ahead = tell(robot, CREEP, CREEP_S)
            tell(robot, STANDSTILL, REST_S)
            around = tell(robot, TURN, TURN_S)
        finally:
            tell(robot, STANDSTILL, REST_S)
        return list(drive_checks(self.found, robot, ahead, around))
