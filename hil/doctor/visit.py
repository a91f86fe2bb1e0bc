"""A doctor's visit: listen for a while, let a robot creep if that is wanted, and tell what was found."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from formation.pose import STANDSTILL, Motion
from hil.doctor.check import Check
from hil.doctor.drive_checks import CREEP, CREEP_S, REST_S, TURN, TURN_S, drive_checks
from hil.doctor.evidence import Evidence, Robot
from hil.doctor.frame_checks import frame_checks
from hil.doctor.robot_checks import robot_checks
from hil.errors import UsageError
from hil.nodes.findings import advice_on, findings_json
from hil.nodes.link_nodes import estimator_node, source_nodes
from hil.nodes.node import Node
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from hil.wire.drive_message import drive_message
from hil.wire.events import TICK, Event
from hil.wire.key_layout import layout_of
from hil.wire.messages import encode
from hil.wire.pubsub import Wire
from hil.wire.topics import RIGID_BODIES

_TICK_S = 0.02


@dataclass(slots=True)
class Visit:
    """Hears a lab by a wire. ``found``: what was heard; estimators hear it too, as they would live."""

    scenario: Scenario
    wire: Wire
    found: Evidence = field(init=False)
    _source: list[tuple[Node[Any], Any]] = field(init=False)
    _estimators: list[tuple[Any, Any]] = field(init=False)

    def __post_init__(self) -> None:
        links = links_of(self.scenario)
        self.found = Evidence(self.scenario)
        now_ns = time.time_ns()
        self._source = [(node, node.begin(now_ns)) for node in source_nodes(links, self.scenario)]
        self._estimators = [(node, node.begin(now_ns)) for node in map(estimator_node, links)]
        heard = {*self.found.topics, *(topic for node, _ in self._estimators for topic in node.subscribes)}
        if self._source:
            heard = {
                *heard - {RIGID_BODIES},
                *(topic for node, _ in self._source for topic in node.subscribes),
            }
        self.wire.subscribe(sorted(heard), shown=False)
        self.wire.watch_graph()

    def listen(self, seconds: float) -> None:
        """Hear what comes for a while."""
        until, ticked = time.monotonic() + seconds, 0.0
        while (left := until - time.monotonic()) > 0.0:
            event = self.wire.inbox.take(min(left, _TICK_S))
            now_ns = time.time_ns()
            if event is not None and event.topic:
                self._hear(event, now_ns)
            if time.monotonic() >= ticked:
                ticked = time.monotonic() + _TICK_S
                for node, state in self._estimators:
                    node.step(state, TICK, now_ns)

    def _hear(self, event: Event, now_ns: int) -> None:
        for node, state in self._source:
            if event.topic in node.subscribes:
                for made in node.step(state, event, now_ns)[1]:
                    self._hear(Event(made.topic, made.payload), now_ns)
                return
        self.found.hear(event, now_ns)
        for node, state in self._estimators:
            if event.topic in node.subscribes:
                node.step(state, event, now_ns)

    def checks(self) -> Iterator[Check]:
        """What was seen while nobody was told to move, and what the estimators find in it."""
        yield from frame_checks(self.found)
        yield from robot_checks(self.found, self.wire.graph(), layout_of(self.scenario))
        now_ns = time.time_ns()
        for node, state in self._estimators:
            for name, text in node.findings(state, now_ns).items():
                yield Check(name, False, text, "what estimates can rest on", advice_on(name))

    def findings(self) -> list[dict[str, Any]]:
        """What the estimators find, as results have it."""
        now_ns = time.time_ns()
        return [
            each for node, state in self._estimators for each in findings_json(node.findings(state, now_ns))
        ]

    def robot(self, name: str) -> Robot:
        """The robot of a name, a body or a namespace; :class:`UsageError` if there is none."""
        for robot in self.found.robots:
            if name in (robot.name, robot.body, robot.cmd_vel.rpartition("/")[0]):
                return robot
        known = ", ".join(robot.name for robot in self.found.robots)
        raise UsageError(
            f"--drive {name!r}: scenario {self.scenario.name} has no such robot; one of: {known}"
        )

    def hindrance(self, robot: Robot) -> Check | None:
        """Why a robot is not to be driven now, if it is not: it cannot obey two."""
        others = len(self.found.commands.get(robot.cmd_vel, []))
        if not others:
            return None
        seen = f"{robot.name}: {others} commands of somebody else on {robot.cmd_vel}; it was not driven"
        return Check("drive", False, seen, "nobody else who commands it", advice_on("second_sender"))

    def drive(self, robot: Robot) -> list[Check]:
        """Let a robot creep and turn, and check what came of it. It is told to stand however this ends."""
        try:
            ahead = self._tell(robot, CREEP, CREEP_S)
            self._tell(robot, STANDSTILL, REST_S)
            around = self._tell(robot, TURN, TURN_S)
        finally:
            self._tell(robot, STANDSTILL, REST_S)
        return list(drive_checks(self.found, robot, ahead, around))

    def _tell(self, robot: Robot, motion: Motion, seconds: float) -> tuple[int, int]:
        """Tell a robot to move for a while; the span of time of it, from when it had time to get going."""
        begun_ns, until = time.time_ns(), time.monotonic() + seconds
        stamped = self.scenario.controller.command_type == "TwistStamped"
        while time.monotonic() < until:
            frame = robot.cmd_vel.rpartition("/")[0]
            told = drive_message(motion, time.time_ns(), frame, stamped=stamped)
            self.wire.publish(robot.cmd_vel, encode(told))
            self.listen(_TICK_S)
        return begun_ns + round(REST_S * 1e9), time.time_ns()


def countdown(say: Callable[[str], None], robot: Robot, seconds: int = 3) -> None:
    """Say what is about to happen, and let it be stopped."""
    way, turn = CREEP.v * CREEP_S, TURN.u * TURN_S
    say(f"{robot.name} will creep {way:.2f} m ahead and turn {turn:.1f} rad to the left")
    for left in range(seconds, 0, -1):
        say(f"in {left} (Ctrl-C stops)")
        time.sleep(1.0)
