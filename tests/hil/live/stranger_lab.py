"""A lab that knows nothing of abreast's emulator: two robots and a motion capture, as a process on the wire.

``python -m tests.hil.live.stranger_lab ENDPOINT POSES.csv [--hand S] [--without ROBOT]``: robots that take
whole hundredths of what ``cmd_vel`` tells them, tell odometry 20 times a second and keep their last command
for ever; the motion capture at 120 Hz. The leader is told what to drive, too, or drives by itself, as if by
hand, that long after the follower was told something for the first time. A robot that the lab is without is
neither seen nor heard. Ends by SIGTERM, and leaves the robots' own poses.
"""

from __future__ import annotations

import argparse
import csv
import math
import random
import signal
import time
from pathlib import Path

from formation.pose import Motion, Pose, advance
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.scenario.files import load_scenario
from hil.scenario.parts import leader_program
from hil.scenario.start import start_poses
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.messages import decode_as, encode
from hil.wire.pubsub import Wire
from hil.wire.role_keys import RoleKeys
from hil.wire.session import Endpoints, close_session, open_session

LAG, FRAME_S, ODOMETRY_S = 0.1, 1.0 / 120.0, 0.05
NOISE, TURN_NOISE = 0.0003, 0.0035


class Wheels:
    """A robot: its pose, its motion, and what it was told last."""

    def __init__(self, pose: Pose) -> None:
        self.pose, self.v, self.u = pose, 0.0, 0.0
        self.goal, self.told = (0.0, 0.0), False

    def tell(self, v: float, u: float) -> None:
        self.goal, self.told = (int(100 * v) / 100, int(100 * u) / 100), True

    def move(self, dt: float) -> None:
        share = 1.0 - math.exp(-dt / LAG)
        self.v += share * (self.goal[0] - self.v)
        self.u += share * (self.goal[1] - self.u)
        self.pose = advance(self.pose, self.v, self.u, dt)


def live(endpoints: Endpoints, table: Path, hand_after: float | None, without: str = "") -> None:
    """Be the lab until SIGTERM."""
    scenario = load_scenario("turtlebot3")
    program, dice, asked = leader_program(scenario), random.Random(1), []
    robots = dict(zip(("leader", "follower"), map(Wheels, start_poses(scenario)), strict=True))
    signal.signal(signal.SIGTERM, lambda *_: asked.append(True))
    session = open_session(endpoints, patience=60.0)
    wire = Wire(session)
    wire.subscribe([f"{name}/cmd_vel" for name in robots])
    rows: list[list[float]] = []
    begun = moved = time.time()
    number = samples = 0
    hand_from = math.inf
    while not asked:
        event = wire.inbox.take(max(0.0, begun + number * FRAME_S - time.time()))
        now = time.time()
        for robot in robots.values():
            robot.move(now - moved)
        moved = now
        if event is not None:
            name, twist = event.topic.partition("/")[0], decode_as(event.payload, msg.TwistStamped).twist
            if name == "follower" and not robots[name].told and hand_after is not None:
                hand_from = now + hand_after
            if name == "follower" or hand_after is None:
                robots[name].tell(twist.linear.x, twist.angular.z)
        if now >= hand_from:
            motion = program(now - hand_from)
            robots["leader"].goal = (motion.v, motion.u)
        if now < begun + number * FRAME_S:
            continue
        poses = [robot.pose for robot in robots.values()]
        rows.append(
            [now, *(value for pose in poses for value in pose), robots["leader"].v, robots["leader"].u]
        )
        seen = [
            Pose(p.x + dice.gauss(0, NOISE), p.y + dice.gauss(0, NOISE), p.theta + dice.gauss(0, TURN_NOISE))
            for p in poses
        ]
        stamp_ns = round(now * 1e9)
        there = [(name, pose) for name, pose in zip(robots, seen, strict=True) if name != without]
        frame = frame_message(stamp_ns, number, there)
        wire.publish(topics.RIGID_BODIES, encode(frame))
        number += 1
        if now >= begun + samples * ODOMETRY_S:
            samples += 1
            for name, robot in ((name, robots[name]) for name, _ in there):
                told = odometry_message(stamp_ns, name, robot.pose, Motion(robot.v, robot.u))
                wire.publish(f"{name}/odom", encode(told))
    with table.open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    wire.close()
    close_session(session)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("endpoint")
    parser.add_argument("table", type=Path)
    parser.add_argument("--hand", type=float)
    parser.add_argument("--without", default="")
    parser.add_argument("--secure", type=Path)
    given = parser.parse_args()
    keys = RoleKeys(given.secure, "bridge") if given.secure else None
    live(Endpoints(connect=given.endpoint, keys=keys), given.table, given.hand, given.without)
