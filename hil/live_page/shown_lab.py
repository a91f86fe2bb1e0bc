"""What the page shows of a lab: its state by what was heard, as the plain data of a frame for a browser."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from formation.mount import robot_pose
from formation.pose import Motion, Pose
from formation.station import Side, Station
from hil.live.guards_heard import GuardsHeard
from hil.live.lab_state import LabState
from hil.live_page.arrivals import Arrivals
from hil.live_page.orbit import Orbit, is_due
from hil.live_page.shown_estimate import shown_estimate
from hil.live_page.shown_numbers import clipped, shown
from hil.nodes.at_rest import stands
from hil.nodes.reported_number import reported_number
from hil.scenario.links import STARTERS, links_of
from hil.scenario.parts import may_change_sides
from hil.scenario.schema import Scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.lab_robots import LabRobot, robots_of
from hil.wire.message_checks import ACCEPTED, NOT_FINITE, OUT_OF_RANGE, place_cause, planar
from hil.wire.messages import MalformedPayloadError, decode_as, to_ns
from hil.wire.outlet import sender_of
from hil.wire.records import Placement
from hil.wire.topics import Topics, link_topics

_REPORTS, _STOPS = 128, 16
"""How many reports, and stops, of one look are looked at."""

_MOST_NODES, _MOST_FINDINGS, _MOST_CAUSES, _LONGEST_CAUSE = 60, 5, 10, 60
"""Of what anybody may report: nodes, of each its findings and causes, and letters of a cause."""

_FRESH_S, _SILENT_S = 1.0, 3.0
"""For so long [s] what moves is as it was said, and a guard that said something is there."""

_SIDES = frozenset(side.value for side in Side)


class ShownLab:
    """Takes in what was heard, and tells it as plain data; times are of a clock in seconds.

    ``kept``: the topics that it hears, and how many of the newest of each are worth a look. ``orbit``: what
    the scenario does without noise, where that is known.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._robots = robots_of(scenario)
        self._pairs = [link_topics(link) for link in links_of(scenario)]
        self.followers = tuple(link.follower for link in links_of(scenario))
        self.orbit: Orbit | None = None
        told = (topic for pair in self._pairs for topic in (pair.estimate, pair.command))
        heard = LabState(scenario).topics
        self.kept: Mapping[str, int] = {
            **dict.fromkeys((*heard, *told), 1),
            topics.DIAGNOSTICS: _REPORTS,
            topics.STOP: _STOPS,
        }
        self.forget()

    def forget(self) -> None:
        """Begin anew: nobody has looked for a while, and what was heard then says nothing of now."""
        self._state, self._arrivals = LabState(self._scenario), Arrivals()
        self._guards = GuardsHeard([robot.name for robot in self._robots])
        self._guards_at: dict[str, float] = {}
        self._poses: dict[str, tuple[Pose, bool, float]] = {}
        self._stopped_by = ""
        self._motion_since_ns: int | None = None
        self._sides: dict[str, tuple[str, str]] = {}
        self._sent_elsewhere = False

    def hear(self, event: Event, now: float) -> None:
        """Take in a message; what cannot be read is counted."""
        self._arrivals.note(event, now)
        if event.topic in self._state.topics:
            self._state.hear(event, now)
        if event.topic == topics.DIAGNOSTICS:
            self._guards_at |= dict.fromkeys(self._guards.hear(event.payload), now)
            self._hear_report(event.payload)
        elif event.topic == topics.RIGID_BODIES:
            self._see(event.payload, now)
        elif event.topic == topics.STOP:
            self._stopped_by = sender_of(event.origin)

    def config(self) -> dict[str, Any]:
        """What does not change: robots, limits, the arena."""
        given = self._scenario
        fence = given.guard.fence
        side_changes = len(self._pairs) == 1 and may_change_sides(given)
        return {
            "scenario": clipped(given.name),
            "robots": [robot.name for robot in self._robots],
            "followers": list(self.followers),
            "rho_0": given.formation.rho_0,
            "limits": {
                "v": given.controller.v_max,
                "u": given.controller.u_max,
                "age": given.controller.max_age_s,
            },
            "leader": {"k_v": given.leader.k_v, "k_u": given.leader.k_u},
            "fence": list(fence) if isinstance(fence, tuple) else None,
            "side_changes": side_changes,
        }

    def motion(self, place: int, now: float) -> dict[str, Any]:
        """What moves: all robots, and what the follower of a place in ``followers`` believes and decides."""
        pair = self._pairs[place]
        return {
            "robots": [self._robot(robot, now) for robot in self._robots],
            "estimate": self._estimate(place, pair, now),
            "command": self._command(pair, now),
            "station": self._station(place),
        }

    def reports(self, now: float) -> dict[str, Any]:
        """What changes twice a second: nodes, guards, stops, what speaks against the run."""
        told = self._state.as_dict(now)
        nodes = sorted(told["daemons"], key=lambda node: (node["ok"] and not node["findings"], node["name"]))
        return {
            "nodes": [_clipped_node(node) for node in nodes[:_MOST_NODES]],
            "more_nodes": max(0, len(nodes) - _MOST_NODES),
            "missing_bodies": self._unseen(now),
            "guards": {
                clipped(name): clipped(text)
                for name, text in self._guards.held.items()
                if now - self._guards_at[name] <= _SILENT_S
            },
            "stop": self._stop(now),
            "malformed": told["malformed"],
            "rates": self._rates(now),
            "side": dict(zip(("side", "change"), next(iter(self._sides.values()), ("", "")), strict=True)),
        }

    def _unseen(self, now: float) -> list[str]:
        """Bodies that are not seen, or not any more."""
        return [robot.body for robot in self._robots if self._fresh_pose(robot, now) is None]

    def _fresh_pose(self, robot: LabRobot, now: float) -> tuple[Pose, bool] | None:
        """Where a robot was seen of late, and whether its heading was."""
        pose, heads, at = self._poses.get(robot.name, (None, False, now))
        return (pose, heads) if pose is not None and now - at <= _FRESH_S else None

    def _hear_report(self, payload: bytes) -> None:
        try:
            report = decode_as(payload, msg.DiagnosticArray)
            stamp_ns = to_ns(report.header.stamp)
        except MalformedPayloadError:
            return
        controllers = {link.node_name("controller"): link.follower for link in links_of(self._scenario)}
        for status in report.status:
            name = status.name.removeprefix("abreast/")
            values = {value.key: value.value for value in status.values}
            if name in STARTERS and (since := reported_number(values.get("motion_since_ns", ""))) is not None:
                self._motion_since_ns = min(since, stamp_ns)
            if name in controllers and values.get("side") in _SIDES:
                self._sides[controllers[name]] = values["side"], clipped(values.get("side_change", ""))

    def _see(self, payload: bytes, now: float) -> None:
        """Take in where bodies are."""
        try:
            bodies = decode_as(payload, msg.RigidBodies).rigidbodies
        except MalformedPayloadError:
            return
        places = {body.rigid_body_name: body.pose for body in bodies}
        for robot in self._robots:
            if (seen := places.get(robot.body)) is None:
                continue
            at, turned = seen.position, seen.orientation
            place = Placement(at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w)
            cause = place_cause(place)
            if cause not in (NOT_FINITE, OUT_OF_RANGE):
                heads = cause == ACCEPTED
                pose = robot_pose(planar(place), robot.mount) if heads else Pose(place.x, place.y, 0.0)
                self._poses[robot.name] = pose, heads, now

    def _robot(self, robot: LabRobot, now: float) -> dict[str, Any]:
        seen, told = self._poses.get(robot.name), self._told(robot)
        wheels = self._arrivals.of(robot.odom)
        turned = wheels.read_as(msg.Odometry) if wheels is not None else None
        own = Motion(turned.twist.twist.linear.x, turned.twist.twist.angular.z) if turned else None
        return {
            "pose": [*map(shown, seen[0][:2]), shown(seen[0].theta) if seen[1] else None] if seen else None,
            "pose_age": round(now - seen[2], 3) if seen else None,
            "told": [shown(told.v), shown(told.u)] if told else None,
            "told_age": self._arrivals.age_s(robot.cmd_vel, now),
            "own": [shown(own.v), shown(own.u)] if own else None,
            "own_age": self._arrivals.age_s(robot.odom, now),
            "stands": stands(own) if own else None,
        }

    def _told(self, robot: LabRobot) -> Motion | None:
        """What the newest command of a robot says, and not an older one that could be read."""
        if (arrival := self._arrivals.of(robot.cmd_vel)) is None:
            return None
        if self._scenario.controller.command_type == "TwistStamped":
            stamped = arrival.read_as(msg.TwistStamped)
            twist = stamped.twist if stamped is not None else None
        else:
            twist = arrival.read_as(msg.Twist)
        return Motion(twist.linear.x, twist.angular.z) if twist is not None else None

    def _estimate(self, place: int, pair: Topics, now: float) -> dict[str, Any] | None:
        arrival = self._arrivals.of(pair.estimate)
        if arrival is None or (seen := arrival.read_as(msg.LeaderEstimate)) is None:
            return None
        own = self._fresh_pose(self._robots[place + 1], now)
        return {
            "age": round(now - arrival.at, 3),
            **shown_estimate(seen, own[0] if own is not None and own[1] else None),
            "orbit": self._orbit_then(seen),
        }

    def _orbit_then(self, seen: msg.LeaderEstimate) -> list[float | None] | None:
        since_ns = self._motion_since_ns
        if self.orbit is None or since_ns is None:
            return None
        try:
            since_s = (to_ns(seen.header.stamp) - since_ns) * 1e-9
        except MalformedPayloadError:
            return None
        side, _ = self._sides.get(self.followers[0], (self._scenario.formation.side, ""))
        self._sent_elsewhere = self._sent_elsewhere or not is_due(self._scenario, side, since_s)
        if self._sent_elsewhere:
            return None
        shape = self.orbit.at(since_s)
        return [*map(shown, shape)] if shape else None

    def _station(self, place: int) -> list[float | None]:
        """The shape that is wanted, on the side that the controller says to keep."""
        word, _ = self._sides.get(self.followers[place], (self._scenario.formation.side, ""))
        station = Station(Side(word), self._scenario.formation.bearing)
        return [*map(shown, (self._scenario.formation.rho_0, station.alpha1, station.alpha2))]

    def _command(self, pair: Topics, now: float) -> dict[str, Any] | None:
        arrival = self._arrivals.of(pair.command)
        if arrival is None or (sent := arrival.read_as(msg.Command)) is None:
            return None
        try:
            old_s = (to_ns(sent.header.stamp) - to_ns(sent.measured)) * 1e-9 if sent.measured.sec else None
        except MalformedPayloadError:
            old_s = None
        return {
            "age": round(now - arrival.at, 3),
            "sent": [shown(sent.v2), shown(sent.u2)],
            "wanted": [shown(sent.v2_wanted), shown(sent.u2_wanted)],
            "saturated": bool(sent.saturated),
            "stop": clipped(sent.stop),
            "measurement_age": None if old_s is None else shown(old_s),
        }

    def _stop(self, now: float) -> dict[str, Any] | None:
        age_s = self._arrivals.age_s(topics.STOP, now)
        if age_s is None or not self._state.stops:
            return None
        return {"reason": clipped(self._state.stops[-1]), "by": self._stopped_by, "age": age_s}

    def _rates(self, now: float) -> list[dict[str, Any]]:
        """What comes how often, and how old the last of it is."""
        pair = self._pairs[0]
        names = {"motion capture": topics.RIGID_BODIES, "estimate": pair.estimate, "command": pair.command}
        rates = []
        for name, topic in names.items():
            arrival = self._arrivals.of(topic)
            rate = arrival.rate_hz(now) if arrival is not None else None
            age_s = self._arrivals.age_s(topic, now)
            rates.append({"name": name, "age": age_s, "rate": None if rate is None else round(rate, 1)})
        return rates


def _clipped_node(node: Mapping[str, Any]) -> dict[str, Any]:
    found = node["findings"][:_MOST_FINDINGS]
    findings = [{key: clipped(text) for key, text in each.items()} for each in found]
    refused = dict(sorted(node["refused"].items(), key=lambda each: -each[1])[:_MOST_CAUSES])
    return {
        **node,
        "name": clipped(node["name"]),
        "says": clipped(node["says"]),
        "status": clipped(node["status"]),
        "refused": {cause[:_LONGEST_CAUSE]: count for cause, count in refused.items()},
        "findings": findings,
    }
