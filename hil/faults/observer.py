"""The outside judge: robots, and a motion capture that sees them, in a process of its own.

It takes what drivers are told, by the wire or in ROS 2, moves the robots by it, and writes down every command
and every way rolled. Of abreast it uses the wire alone, so that no error of a guard, an emulator or a
controller is also its own.
"""

from __future__ import annotations

import argparse
import math
import signal
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np
import zenoh

from hil.errors import AbreastError
from hil.faults.notes import Rolled, Taken, rolled_line, stop_line, taken_line
from hil.faults.robot import Robot
from hil.faults.ros_ear import RosEar
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.mailbox import Mailbox
from hil.wire.messages import decode_as, encode, header, to_ns
from hil.wire.pubsub import Wire
from hil.wire.session import Endpoints, close_session, open_session
from hil.wire.undeclare import undeclare

FRAME_S, EVERY = 1.0 / 120.0, 6
"""From frame to frame [s], and of so many frames one with odometry."""

PATIENCE_S = 120.0
_NO_COVARIANCE = np.zeros(36)
_NOISE, _TURN_NOISE = 0.0003, 0.0035


class Place(NamedTuple):
    """A robot of the lab: its name, where its driver is on the wire, and where it stands at first."""

    name: str
    endpoint: str
    x: float
    y: float
    theta: float


class Heard(NamedTuple):
    """A message: its topic and bytes, and when it came by the monotonic clock [s] and the host's [ns]."""

    topic: str
    payload: bytes
    mono_s: float
    host_ns: int


Arrivals = Mailbox[Heard]


class Ear:
    """A session of our own on a wire, and what came by it."""

    def __init__(self, endpoint: str, names: Sequence[str], arrivals: Arrivals) -> None:
        self._session = open_session(Endpoints(connect=endpoint), PATIENCE_S)
        self.wire = Wire(self._session)

        def note(sample: zenoh.Sample) -> None:
            # Timed where Zenoh hands it over, not when this process gets round to it.
            came = time.monotonic(), time.time_ns()
            arrivals.put(Heard(str(sample.key_expr), sample.payload.to_bytes(), *came))

        direct = zenoh.handlers.Callback(note, indirect=False)
        self._subscribers = [self._session.declare_subscriber(name, direct) for name in names]

    def close(self) -> None:
        """Leave the wire."""
        undeclare(*self._subscribers)
        self.wire.close()
        close_session(self._session)


class Observer:
    """The robots, where they are told what to do, and what is written down of it.

    ``ros_domain``: where in ROS 2 drivers are told; None for on the wire.
    """

    def __init__(self, places: Sequence[Place], lab: str, notes: TextIO, ros_domain: int | None) -> None:
        self._arrivals: Arrivals = Mailbox()
        self._robots = {place.name: Robot(place.x, place.y, place.theta) for place in places}
        self._told = {f"{name}/cmd_vel": name for name in self._robots}
        self._notes = notes
        self._dice = np.random.default_rng(1)
        self._lab = Ear(lab, [topics.STOP], self._arrivals)
        self._ears: list[Ear | RosEar] = [self._lab]
        self._tells_by: dict[str, Wire] = {}
        if ros_domain is None:
            for place in places:
                ear = Ear(place.endpoint, [f"{place.name}/cmd_vel"], self._arrivals)
                self._ears.append(ear)
                self._tells_by[place.name] = ear.wire
        else:
            self._ears.append(RosEar(ros_domain, list(self._told), self._hear))
            self._tells_by = {place.name: self._lab.wire for place in places}
        self._moved_s = time.monotonic()
        self._number = 0

    def run(self, ended: list[bool], *, shows: bool) -> None:
        """Go on until asked to end. ``shows``: the robots are real, and mocap and odometry tell of them."""
        due_s = time.monotonic()
        while not ended:
            if (heard := self._arrivals.take(due_s - time.monotonic())) is not None:
                self._take(heard)
            if time.monotonic() >= due_s:
                due_s = max(due_s + FRAME_S, time.monotonic())
                self._tick(shows=shows)

    def close(self) -> None:
        """Leave the wire."""
        for ear in reversed(self._ears):
            ear.close()

    def _hear(self, topic: str, payload: bytes, mono_s: float, host_ns: int) -> None:
        self._arrivals.put(Heard(topic, payload, mono_s, host_ns))

    def _take(self, heard: Heard) -> None:
        self._move(max(self._moved_s, heard.mono_s))
        if heard.topic == topics.STOP:
            self._notes.write(stop_line(heard.mono_s))
            return
        try:
            command = decode_as(heard.payload, msg.TwistStamped)
        except AbreastError:
            return
        name, twist = self._told[heard.topic], command.twist
        v, u = twist.linear.x, twist.angular.z
        if not (math.isfinite(v) and math.isfinite(u)):
            return
        self._robots[name].tell(v, u)
        age_s = (heard.host_ns - to_ns(command.header.stamp)) * 1e-9
        self._notes.write(taken_line(name, Taken(heard.mono_s, age_s, v, u)))

    def _move(self, now_s: float) -> None:
        for robot in self._robots.values():
            robot.move(now_s - self._moved_s)
        self._moved_s = now_s

    def _tick(self, *, shows: bool) -> None:
        self._move(max(self._moved_s, time.monotonic()))
        for name, robot in self._robots.items():
            self._notes.write(rolled_line(name, Rolled(self._moved_s, robot.rolled, robot.v)))
        self._notes.flush()
        if not shows:
            return
        stamp_ns = time.time_ns()
        self._number += 1
        bodies = [msg.RigidBody(name, [], self._seen(robot)) for name, robot in self._robots.items()]
        frame = msg.RigidBodies(header(stamp_ns, "mocap"), self._number, bodies)
        self._lab.wire.publish(topics.RIGID_BODIES, encode(frame))
        if self._number % EVERY == 0:
            for name, robot in self._robots.items():
                self._tells_by[name].publish(f"{name}/odom", encode(_odometry(stamp_ns, name, robot)))

    def _seen(self, robot: Robot) -> msg.Pose:
        x, y, theta = self._dice.normal((robot.x, robot.y, robot.theta), (_NOISE, _NOISE, _TURN_NOISE))
        return _pose(float(x), float(y), float(theta))


def _pose(x: float, y: float, theta: float) -> msg.Pose:
    turn = msg.Quaternion(x=0.0, y=0.0, z=math.sin(0.5 * theta), w=math.cos(0.5 * theta))
    return msg.Pose(position=msg.Point(x=x, y=y, z=0.0), orientation=turn)


def _odometry(stamp_ns: int, name: str, robot: Robot) -> msg.Odometry:
    twist = msg.Twist(msg.Vector3(robot.v, 0.0, 0.0), msg.Vector3(0.0, 0.0, robot.u))
    return msg.Odometry(
        header(stamp_ns, f"{name}/odom"),
        f"{name}/base_footprint",
        msg.PoseWithCovariance(_pose(robot.x, robot.y, robot.theta), _NO_COVARIANCE),
        msg.TwistWithCovariance(twist, _NO_COVARIANCE),
    )


def main() -> None:
    """Observe until SIGTERM."""
    parser = argparse.ArgumentParser()
    parser.add_argument("lab")
    parser.add_argument("notes", type=Path)
    parser.add_argument("--robot", nargs=5, action="append", required=True)
    parser.add_argument("--shows", action="store_true")
    parser.add_argument("--ros", type=int, metavar="DOMAIN")
    given = parser.parse_args()
    places = [Place(name, where, *map(float, pose)) for name, where, *pose in given.robot]
    ended: list[bool] = []
    signal.signal(signal.SIGTERM, lambda *_: ended.append(True))
    with given.notes.open("w", encoding="utf-8") as notes:
        observer = Observer(places, given.lab, notes, given.ros)
        observer.run(ended, shows=given.shows)
        observer.close()


if __name__ == "__main__":
    main()
