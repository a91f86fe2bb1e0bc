"""What is heard in a lab while the doctor listens, kept as numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from formation.pose import Motion, Pose
from hil.live.guards_heard import GuardsHeard
from hil.nodes.findings import Findings, findings_in
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.lab_robots import LabRobot, robots_of
from hil.wire.message_checks import ACCEPTED, leader_cause, place_cause, planar
from hil.wire.messages import MalformedPayloadError, decode_as
from hil.wire.pose_sources import places_of

_BRIDGES = "bridge/"


class Seen(NamedTuple):
    """A mocap frame: when it came, its stamp [ns] and number, and the names of all its bodies.

    ``poses``: of those that stand on the ground.
    """

    at_ns: int
    stamp_ns: int
    number: int
    names: tuple[str, ...]
    poses: dict[str, Pose]


class Rolled(NamedTuple):
    """Odometry of a robot: when it came, its stamp [ns], and its motion."""

    at_ns: int
    stamp_ns: int
    motion: Motion


class Asked(NamedTuple):
    """A command to a robot: when it came, and its stamp [ns], 0 for one that has none."""

    at_ns: int
    stamp_ns: int


@dataclass(slots=True)
class Evidence:
    """All that was heard: frames, and odometry and commands by topic. ``unread``: how many made no sense.

    ``reported``: what bridges find, who see what lies behind them and does not show on the wire. ``guards``:
    what guards say of their robots.
    """

    scenario: Scenario
    frames: list[Seen] = field(default_factory=list)
    odometry: dict[str, list[Rolled]] = field(default_factory=dict)
    commands: dict[str, list[Asked]] = field(default_factory=dict)
    unread: dict[str, int] = field(default_factory=dict)
    reported: dict[str, Findings] = field(default_factory=dict)
    guards: GuardsHeard = field(default_factory=GuardsHeard)
    robots: tuple[LabRobot, ...] = field(init=False)

    def __post_init__(self) -> None:
        self.robots = robots_of(self.scenario)

    @property
    def topics(self) -> tuple[str, ...]:
        """What there is to hear."""
        robots = self.robots
        driven = [topic for each in robots for topic in (each.odom, each.cmd_vel, each.wanted)]
        return (topics.RIGID_BODIES, topics.DIAGNOSTICS, *dict.fromkeys(driven))

    def commands_to(self, robot: LabRobot) -> str:
        """The topic on which whoever drives a robot sends: to its guard, where one was heard."""
        return robot.wanted if robot.name in self.guards.held else robot.cmd_vel

    def reported_findings(self) -> list[tuple[str, str]]:
        """Names of the findings that bridges have, and their texts behind the bridge's name."""
        return [
            (name, f"{node}: {text}")
            for node, findings in self.reported.items()
            for name, text in findings.items()
        ]

    def hear(self, event: Event, now_ns: int) -> None:
        """Take down a message; what cannot be read is counted."""
        try:
            if event.topic == topics.RIGID_BODIES:
                frame = decode_as(event.payload, msg.RigidBodies)
                self.frames.append(_seen(frame, now_ns, self.robots[0].body))
            elif event.topic == topics.DIAGNOSTICS:
                found = findings_in(decode_as(event.payload, msg.DiagnosticArray))
                self.reported |= {node: each for node, each in found.items() if node.startswith(_BRIDGES)}
                self.guards.hear(event.payload)
            elif event.topic in {each.odom for each in self.robots}:
                rolled = _rolled(decode_as(event.payload, msg.Odometry), now_ns)
                self.odometry.setdefault(event.topic, []).append(rolled)
            elif event.topic in {each.cmd_vel for each in self.robots}:
                stamp_ns = 0
                if self.scenario.controller.command_type == "TwistStamped":
                    stamp_ns = _stamp_ns(decode_as(event.payload, msg.TwistStamped).header)
                self.commands.setdefault(event.topic, []).append(Asked(now_ns, stamp_ns))
            elif event.topic in {each.wanted for each in self.robots}:
                stamp_ns = _stamp_ns(decode_as(event.payload, msg.TwistStamped).header)
                self.commands.setdefault(event.topic, []).append(Asked(now_ns, stamp_ns))
        except MalformedPayloadError:
            self.unread[event.topic] = self.unread.get(event.topic, 0) + 1


def _seen(frame: msg.RigidBodies, now_ns: int, leader: str) -> Seen:
    places = places_of(frame)
    sound = {
        each.body: planar(each.place)
        for each in places
        if (leader_cause if each.body == leader else place_cause)(each.place) == ACCEPTED
    }
    names = tuple(each.body for each in places)
    return Seen(now_ns, _stamp_ns(frame.header), frame.frame_number, names, sound)


def _rolled(told: msg.Odometry, now_ns: int) -> Rolled:
    motion = Motion(told.twist.twist.linear.x, told.twist.twist.angular.z)
    return Rolled(now_ns, _stamp_ns(told.header), motion)


def _stamp_ns(header: msg.Header) -> int:
    return header.stamp.sec * 10**9 + header.stamp.nanosec
