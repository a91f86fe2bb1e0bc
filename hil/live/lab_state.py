"""What passes on a lab's wire just now: daemons, bodies, robots, and who told whom to drive."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from formation.pose import STANDSTILL, Motion
from hil.guard.report import GUARDS
from hil.nodes.at_rest import own_motion
from hil.nodes.findings import findings_in, findings_json
from hil.nodes.reported_number import reported_number
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.finding_keys import PREFIX
from hil.wire.lab_robots import robots_of
from hil.wire.messages import MalformedPayloadError, decode_as
from hil.wire.source_topics import source_topics

_RATE_OVER_S = 2.0
_QUIET_S = 0.25
_SILENT_S = 3.0
"""Nodes report twice a second: one that has not for so long [s] is not there."""
_REFUSED = "refused."
_MOST_NAMES = 4096  # of daemons and of bodies: anybody may send any


@dataclass(slots=True)
class Heard:
    """When something was heard, by a clock in seconds: last, and within the last moments."""

    times: list[float] = field(default_factory=list)

    def note(self, now: float) -> None:
        """It was heard now."""
        self.times.append(now)
        if len(self.times) > 64 and self.times[len(self.times) // 2] < now - _RATE_OVER_S:
            self.times = [each for each in self.times if each >= now - _RATE_OVER_S]

    def age_s(self, now: float) -> float:
        """How long ago it was heard last."""
        return now - self.times[-1]

    def rate_hz(self, now: float) -> float:
        """How often a second it has been heard of late."""
        late = [each for each in self.times if each >= now - _RATE_OVER_S]
        return (len(late) - 1) / (late[-1] - late[0]) if len(late) > 1 and late[-1] > late[0] else 0.0


class LabState:
    """The newest of everything that is heard, by the topics of a scenario.

    ``robots``: their names by the topics that tell them to drive; ``robot_topics``: these and their odometry.
    """

    def __init__(self, scenario: Scenario) -> None:
        robots = robots_of(scenario)
        self._stamped = scenario.controller.command_type == "TwistStamped"
        self.robots = {each.cmd_vel: each.name for each in robots}
        self._wheels = {each.name: each.odom for each in robots}
        self._wheel_topics = frozenset(self._wheels.values())
        self.wanted = tuple(each.body for each in robots)
        self.robot_topics = (*self.robots, *self._wheels.values())
        self.topics = (
            topics.DIAGNOSTICS,
            topics.STOP,
            topics.RIGID_BODIES,
            *source_topics(scenario),
            *self.robot_topics,
        )
        self._heard: dict[str, Heard] = {}
        self._bodies: dict[str, Heard] = {}
        self._daemons: dict[str, tuple[Heard, msg.DiagnosticStatus]] = {}
        self.drives: dict[str, Motion] = {}
        self._driven_at: dict[str, float] = {}
        self._odometry: dict[str, bytes] = {}
        self.stops: list[str] = []
        self.malformed = 0

    def hear(self, event: Event, now: float) -> None:
        """Take in a message at a time of a clock in seconds; what cannot be read is counted."""
        self._heard.setdefault(event.topic, Heard()).note(now)
        try:
            if event.topic == topics.DIAGNOSTICS:
                for status in decode_as(event.payload, msg.DiagnosticArray).status:
                    if status.name not in self._daemons and len(self._daemons) >= _MOST_NAMES:
                        continue
                    heard, _ = self._daemons.get(status.name, (Heard(), status))
                    heard.note(now)
                    self._daemons[status.name] = heard, status
            elif event.topic == topics.RIGID_BODIES:
                for body in decode_as(event.payload, msg.RigidBodies).rigidbodies:
                    name = body.rigid_body_name
                    if name in self._bodies or name in self.wanted or len(self._bodies) < _MOST_NAMES:
                        self._bodies.setdefault(name, Heard()).note(now)
            elif event.topic == topics.STOP:
                self.stops = [*self.stops[-9:], decode_as(event.payload, msg.String).data]
            elif event.topic in self._wheel_topics:
                # Read when somebody asks: of many robots it is most of what comes.
                self._odometry[event.topic] = event.payload
            elif event.topic in self.robots:
                self._driven_at[event.topic], before = now, self._driven_at.get(event.topic, -math.inf)
                # Only what can be read says that a robot is to stand: its driver may take another type.
                drive = self.drives[event.topic] = self._drive(event.payload)
                if drive == STANDSTILL:
                    self._driven_at[event.topic] = before
        except MalformedPayloadError:
            self.malformed += 1

    def _drive(self, payload: bytes) -> Motion:
        stamped = decode_as(payload, msg.TwistStamped).twist if self._stamped else None
        twist = stamped or decode_as(payload, msg.Twist)
        return Motion(twist.linear.x, twist.angular.z)

    def driven(self, now: float) -> list[str]:
        """Robots that were told of late to drive: several may tell them in turn."""
        return [
            name
            for topic, name in self.robots.items()
            if now - self._driven_at.get(topic, -math.inf) < _QUIET_S
        ]

    def unheard(self) -> list[str]:
        """Robots of which nothing was heard: no odometry, and nobody tells them anything."""
        return [
            name
            for topic, name in self.robots.items()
            if topic not in self._heard and self._wheels[name] not in self._heard
        ]

    def stopped_nodes(self) -> list[str]:
        """Nodes that say that they were stopped: guards that hold their robots, controllers, a leader."""
        return [
            name.removeprefix("abreast/")
            for name, (_, status) in sorted(self._daemons.items())
            if _is_stopped(status)
        ]

    def unwell(self, names: Sequence[str], now: float) -> list[str]:
        """What is wrong with nodes that are needed, in words: silent, with a problem, or with findings."""
        said = {each["name"]: each for each in self.as_dict(now)["daemons"]}
        wrong = []
        for name in names:
            if name not in said or said[name]["age_s"] > _SILENT_S:
                wrong.append(f"{name} is not heard")
                continue
            found = [f"{each['name']}: {each['text']}" for each in said[name]["findings"]]
            texts = [*([] if said[name]["ok"] else [said[name]["says"]]), *found]
            wrong += [f"{name}: {text}" for text in texts]
        return wrong

    def as_dict(self, now: float) -> dict[str, Any]:
        """All of it, as results have it; ages in seconds."""
        return {
            "daemons": [self._daemon(name, now) for name in sorted(self._daemons)],
            "bodies": [
                {"name": name, **_when(heard, now), "wanted": name in self.wanted}
                for name, heard in sorted(self._bodies.items())
            ],
            "missing_bodies": [name for name in self.wanted if name not in self._bodies],
            "robots": [self._robot(topic, name, now) for topic, name in self.robots.items()],
            "stops": self.stops,
            "malformed": self.malformed,
        }

    def _daemon(self, name: str, now: float) -> dict[str, Any]:
        heard, status = self._daemons[name]
        values = {each.key: each.value for each in status.values if not each.key.startswith(PREFIX)}
        refused = {
            key.removeprefix(_REFUSED): count
            for key, value in values.items()
            if key.startswith(_REFUSED) and (count := reported_number(value)) is not None
        }
        report = msg.DiagnosticArray(header=_NO_HEADER, status=[status])
        (found,) = findings_in(report).values()
        return {
            "name": name.removeprefix("abreast/"),
            "age_s": round(heard.age_s(now), 2),
            "ok": int(status.level) == 0,
            "says": status.message,
            "status": values.get("status", ""),
            "refused": refused,
            "findings": findings_json(found),
        }

    def _robot(self, topic: str, name: str, now: float) -> dict[str, Any]:
        drive, told = self.drives.get(topic), self._heard.get(topic)
        wheels = self._heard.get(self._wheels[name])
        odometry = self._odometry.get(self._wheels[name])
        own = own_motion(odometry) if odometry is not None else None
        v, u = own or (None, None)
        return {
            "name": name,
            "told": {"v": drive.v, "u": drive.u, **_when(told, now)} if drive and told else None,
            "odometry": {"v": v, "u": u, **_when(wheels, now)} if wheels else None,
        }


def hear_for(
    state: LabState, take: Callable[[float], Event | None], clock: Callable[[], float], until: float
) -> None:
    """Let a state hear what is taken until a time of the clock."""
    while (left := until - clock()) > 0.0:
        event = take(left)
        if event is not None and event.topic:
            state.hear(event, clock())


def told_lines(state: LabState, now: float) -> Iterable[tuple[str, str, str]]:
    """Rows for a terminal: what it is, how old and how often, and what there is to say of it."""
    told = state.as_dict(now)
    for each in told["daemons"]:
        refused = ", ".join(f"{count} {cause}" for cause, count in each["refused"].items())
        parts = [each["status"], each["says"], f"refused: {refused}" if refused else ""]
        yield each["name"], f"{each['age_s']:.1f} s", "; ".join(filter(None, parts))
        for finding in each["findings"]:
            yield "", "", f"{finding['name']}: {finding['text']}"
    for each in told["bodies"]:
        yield f"body {each['name']}", _age(each), "" if each["wanted"] else "nobody asks for it"
    for name in told["missing_bodies"]:
        yield f"body {name}", "-", "not seen"
    for each in told["robots"]:
        drive = each["told"]
        says = f"told v {drive['v']:+.3f} m/s, u {drive['u']:+.2f} rad/s" if drive else "told nothing"
        yield f"robot {each['name']}", _age(drive) if drive else "-", says
        if (turned := each["odometry"]) is None:
            yield "", "", "no odometry"
        elif turned["v"] is None:
            yield "", _age(turned), "odometry that cannot be read"
        else:
            yield "", _age(turned), f"odometry v {turned['v']:+.3f} m/s, u {turned['u']:+.2f} rad/s"
    for reason in told["stops"][-1:]:
        yield "stop", "", reason


def _is_stopped(status: msg.DiagnosticStatus) -> bool:
    values = {each.key: each.value for each in status.values}
    if status.name.removeprefix("abreast/").startswith(GUARDS):
        return bool(values.get("latched"))
    return bool(reported_number(values.get("decided.stopped", ""))) or status.message.startswith("stopped")


def _when(heard: Heard, now: float) -> dict[str, float]:
    return {"age_s": round(heard.age_s(now), 3), "rate_hz": round(heard.rate_hz(now), 1)}


def _age(when: dict[str, float]) -> str:
    return f"{when['age_s']:.1f} s, {when['rate_hz']:.0f} Hz"


_NO_HEADER = msg.Header(stamp=msg.Time(sec=0, nanosec=0), frame_id="")
