"""The newest of what was heard of a follower and its leader."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

from estimation.tracking.tracker import Status
from formation.mount import robot_pose
from formation.pose import Pose
from formation.station import Side, Station
from hil.scenario.leader_model import follower_mount, leader_mount, pose_noise
from hil.scenario.links import Link
from hil.scenario.parts import station
from hil.scene.pair_scene import Believed, SeenPair
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.message_checks import planar
from hil.wire.messages import decode_as, to_ns
from hil.wire.pose_sources import places_of
from hil.wire.records import Placement
from hil.wire.topics import link_topics

_KEPT = 128

_FRESH_NS = 1_000_000_000
"""What was heard longer ago is not shown: whoever told it may be gone."""

Told = TypeVar("Told")


@dataclass(frozen=True, slots=True)
class Heard(Generic[Told]):
    """What was told, and when it was heard [ns]."""

    told: Told
    at_ns: int

    def still(self, now_ns: int) -> Told | None:
        """The same, None once it is stale; also after time has jumped back."""
        return self.told if abs(now_ns - self.at_ns) <= _FRESH_NS else None


class PairState:
    """Hears a follower and its leader. ``topics``: what of."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self._names = link_topics(link)
        self.topics = frozenset(
            {
                topics.RIGID_BODIES,
                topics.DIAGNOSTICS,
                self._names.estimate,
                self._names.command,
                self._names.odom,
            }
        )
        scenario = link.scenario
        self._mounts = (leader_mount(scenario), follower_mount(scenario))
        self._station = station(scenario)
        self._sigma_position = pose_noise(scenario).position
        self._estimate: Heard[msg.LeaderEstimate] | None = None
        self._command: Heard[msg.Command] | None = None
        self._headings: dict[int, float] = {}
        self._framed = False

    def note_frame(self, stamp_ns: int, seen: Mapping[str, Placement]) -> dict[str, Pose]:
        """Take a frame's bodies in: where the robots on them stand."""
        found: dict[str, Pose] = {}
        names = (self.link.leader, self.link.follower)
        for name, body, mount in zip(names, self.link.bodies, self._mounts, strict=True):
            if (place := seen.get(body)) is not None and (pose := _pose_of(place)) is not None:
                found[name] = robot_pose(pose, mount)
        if self.link.follower in found:
            self._framed = True
            self._headings[stamp_ns] = found[self.link.follower].theta
            if len(self._headings) > _KEPT:
                self._headings.pop(next(iter(self._headings)))
        return found

    def note(self, topic: str, payload: bytes, now_ns: int) -> dict[str, Pose]:
        """Take in what else is heard; where robots stand by that, where no frame tells it.

        Raises ValueError, or :class:`~hil.wire.messages.MalformedPayloadError`, for what is no such
        message, and keeps none.
        """
        names = self._names
        if topic == names.estimate:
            estimate = decode_as(payload, msg.LeaderEstimate)
            # Neither fails again where it is drawn.
            Status(estimate.status)
            to_ns(estimate.header.stamp)
            self._estimate = Heard(estimate, now_ns)
        elif topic == names.command:
            self._command = Heard(decode_as(payload, msg.Command), now_ns)
        elif topic == topics.DIAGNOSTICS:
            self._note_report(decode_as(payload, msg.DiagnosticArray))
        elif topic == names.odom and not self._framed and self._estimate is not None:
            # Where there are estimates and still no frames, nobody but the robot itself tells where it is.
            odometry = decode_as(payload, msg.Odometry)
            (place,) = places_of(odometry)
            pose = _pose_of(place.place)
            return {} if pose is None else {self.link.follower: pose, **self._led_from(pose, now_ns)}
        return {}

    def _note_report(self, report: msg.DiagnosticArray) -> None:
        told = {each.name: {pair.key: pair.value for pair in each.values} for each in report.status}
        estimator = told.get(f"abreast/{self.link.node_name('estimator')}", {})
        self._sigma_position = float(estimator.get("noise.sigma_position", self._sigma_position))
        controller = told.get(f"abreast/{self.link.node_name('controller')}", {})
        if (side := controller.get("side")) is not None:
            self._station = Station(Side(side), self.link.scenario.formation.bearing)

    def _led_from(self, follower: Pose, now_ns: int) -> dict[str, Pose]:
        """Where the leader stands by the estimate, seen from the follower."""
        told = _still(self._estimate, now_ns)
        if told is None or not math.isfinite(told.rho + told.alpha2 + told.alpha1):
            return {}
        line = follower.theta + told.alpha2
        at = follower.x + told.rho * math.cos(line), follower.y + told.rho * math.sin(line)
        pose = Pose(*at, line + math.pi - told.alpha1)
        return {self.link.leader: pose} if all(map(math.isfinite, pose)) else {}

    def seen(self, now_ns: int, stands: Mapping[str, Pose]) -> SeenPair | None:
        """What there is to draw of the pair, None before both have been seen."""
        names = (self.link.leader, self.link.follower)
        if not stands.keys() >= set(names):
            return None
        leader, follower = (stands[name] for name in names)
        command = _still(self._command, now_ns)
        return SeenPair(
            now_ns,
            names,
            leader,
            follower,
            self.link.scenario.formation.rho_0,
            self._station,
            self._believed(follower, now_ns),
            None if command is None else (command.v2, command.u2),
            "" if command is None else command.stop,
        )

    def _believed(self, follower: Pose, now_ns: int) -> Believed | None:
        told = _still(self._estimate, now_ns)
        if told is None or not math.isfinite(told.rho + told.alpha2 + told.alpha1 + told.v1):
            return None
        # The heading of its very capture: the robot has turned since.
        heading = self._headings.get(to_ns(told.header.stamp), follower.theta)
        theta = heading + told.alpha2 + math.pi - told.alpha1
        if not math.isfinite(theta):
            return None
        variances = told.covariance[::6]
        status = Status(told.status)
        along, across = self._position_sds(told)
        return Believed(
            theta=theta,
            alpha1=told.alpha1,
            v1=told.v1,
            sd_v1=math.sqrt(max(0.0, float(variances[2]))),
            sd_alpha1=math.sqrt(max(0.0, float(variances[3]))),
            bound_v1=told.bound_v1,
            bound_alpha1=told.bound_alpha1,
            sd_along=along,
            sd_across=across,
            trusted=status == Status.TRACKING,
            says=status.name.lower(),
        )

    def _position_sds(self, told: msg.LeaderEstimate) -> tuple[float, float]:
        given = self.link.scenario.estimator
        if given.front_end == "body":
            return given.sigma_range, given.sigma_bearing * told.rho
        return self._sigma_position, self._sigma_position


def _still(heard: Heard[Told] | None, now_ns: int) -> Told | None:
    return None if heard is None else heard.still(now_ns)


def _pose_of(place: Placement) -> Pose | None:
    """Pose on the floor, None of a body that is nowhere."""
    return planar(place) if all(map(math.isfinite, place)) else None
