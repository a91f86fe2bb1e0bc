"""Checks that need a robot to move: who moves, whether odometry says so too, and how the body sits on it.

The robot first creeps straight ahead and then turns on the spot; motion capture is taken to be right.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from formation.mount import robot_pose
from formation.pose import Motion, Pose
from formation.wrapping import wrapped
from hil.doctor.check import Check, check
from hil.doctor.evidence import Evidence
from hil.nodes.findings import advice_on
from hil.wire.lab_robots import LabRobot

Span = tuple[int, int]
"""Begin and end of a span of time [ns]."""

CREEP, TURN = Motion(0.05, 0.0), Motion(0.0, 0.3)
"""What a robot is told: at most 0.05 m/s and 0.3 rad/s."""
CREEP_S, TURN_S, REST_S = 3.0, 3.0, 0.8
"""How long each of it, and the rest in between."""

_LEAST_M, _LEAST_RAD = 0.05, 0.3
_SAME = 0.2
_MOST_YAW = math.radians(5.0)
_MOST_PIVOT_M = 0.01


class Moved(NamedTuple):
    """How a robot went while it was told something: by its body and, if there was any, by its odometry.

    ``begin``, ``end``: its poses, by where the body is said to sit on it; ``way`` [m], ``turn`` [rad]: by
    odometry.
    """

    begin: Pose
    end: Pose
    way: float | None
    turn: float | None

    @property
    def distance(self) -> float:
        """How far the body went [m]."""
        return math.hypot(self.end.x - self.begin.x, self.end.y - self.begin.y)

    @property
    def turned(self) -> float:
        """How far the body turned [rad]."""
        return wrapped(self.end.theta - self.begin.theta)


def moved(found: Evidence, robot: LabRobot, from_ns: int, to_ns: int) -> Moved | None:
    """How a robot went in a span of time; None if its body was not seen."""
    poses = [
        robot_pose(each.poses[robot.body], robot.mount)
        for each in found.frames
        if from_ns <= each.at_ns <= to_ns and robot.body in each.poses
    ]
    if len(poses) < 2:
        return None
    rolled = [each for each in found.odometry.get(robot.odom, []) if from_ns <= each.at_ns <= to_ns]
    if len(rolled) < 2:
        return Moved(poses[0], poses[-1], None, None)
    step_s = (to_ns - from_ns) * 1e-9 / len(rolled)
    way, turn = (sum(each.motion[k] for each in rolled) * step_s for k in range(2))
    return Moved(poses[0], poses[-1], way, turn)


def drive_checks(found: Evidence, robot: LabRobot, ahead: Span, around: Span) -> Iterator[Check]:
    """Checks of a robot that was told :data:`CREEP` and :data:`TURN` in these spans of time [ns]."""
    straight, turning = moved(found, robot, *ahead), moved(found, robot, *around)
    others = [each for each in found.robots if each != robot]
    yield _answers(found, robot, others, ahead)
    if (
        straight is None
        or turning is None
        or straight.distance < _LEAST_M
        or abs(turning.turned) < _LEAST_RAD
    ):
        return
    yield from _odometry(robot, straight, turning)
    yield _yaw(robot, straight)
    yield _pivot(robot, turning)


def _answers(found: Evidence, robot: LabRobot, others: list[LabRobot], ahead: Span) -> Check:
    """Whether the body moved that was to move, and none else."""
    own = moved(found, robot, *ahead)
    went = own.distance if own is not None else 0.0
    for other in others:
        theirs = moved(found, other, *ahead)
        if theirs is not None and theirs.distance >= _LEAST_M > went:
            text = f"{robot.name} was told to move, and body {other.body!r} went {theirs.distance:.2f} m"
            advice = "swap the bodies' names, or the robots' namespaces"
            return Check("swapped", False, text, f"body {robot.body!r} moves", advice)
    seen = f"{robot.name}: its body went {went:.2f} m"
    return check("deaf_robot", went >= _LEAST_M, seen, f"at least {_LEAST_M:g} m", advice_on("deaf_robot"))


def _odometry(robot: LabRobot, straight: Moved, turning: Moved) -> Iterator[Check]:
    for name, told, true in (("v2", straight.way, straight.distance), ("u2", turning.turn, turning.turned)):
        if told is None:
            yield Check(
                "odometry_silent",
                False,
                "no odometry while it moves",
                "odometry",
                advice_on("odometry_silent"),
            )
            return
        ratio = told / true
        seen = f"{robot.name}: odometry says {ratio:+.2f} times what motion capture sees, in {name}"
        ok = abs(ratio - 1.0) <= _SAME
        yield check(f"odometry_{name}", ok, seen, "1.0", advice_on("odometry_contradicts"))


def _yaw(robot: LabRobot, straight: Moved) -> Check:
    way = math.atan2(straight.end.y - straight.begin.y, straight.end.x - straight.begin.x)
    off = wrapped(straight.begin.theta + 0.5 * straight.turned - way)
    seen = f"{robot.name}: its body looks {math.degrees(off):+.1f} deg off its way"
    return check("frame_yaw", abs(off) <= _MOST_YAW, seen, "at most 5 deg", advice_on("frame_yaw"))


def _pivot(robot: LabRobot, turning: Moved) -> Check:
    """A body whose origin is off the wheels' middle goes round it as the robot turns on the spot."""
    radius = turning.distance / (2.0 * abs(math.sin(0.5 * turning.turned)))
    seen = f"{robot.name}: its body sits {1e3 * radius:.0f} mm off where its mount says"
    return check("frame_pivot", radius <= _MOST_PIVOT_M, seen, "at most 10 mm", advice_on("frame_pivot"))
