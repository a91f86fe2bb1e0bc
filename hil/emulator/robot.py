"""An emulated differential-drive robot: command truncation, limits, first-order actuators, exact arcs."""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.arc import Course, along
from formation.kernel import kernel
from formation.pose import STANDSTILL, Motion, Pose
from formation.wrapping import wrapped

_LONGEST_ARC = 0.01
_ROUNDING = 1e-9  # so that 0.08 / 0.01 counts as 8 whole steps
_ALL_WHOLE = 2.0**53  # doubles beyond have no fraction


class Actuators(NamedTuple):
    """What lies between a command and the wheels: lag [s], limits, resolution of the firmware link."""

    lag: float
    v_max: float
    u_max: float
    v_resolution: float
    u_resolution: float

    @kernel
    def accept(self, command: Motion) -> Motion:
        """Command as the wheels get it: limited, truncated toward zero; standstill if not finite."""
        if not (math.isfinite(command.v) and math.isfinite(command.u)):
            return Motion(0.0, 0.0)
        return Motion(
            _truncated(max(-self.v_max, min(self.v_max, command.v)), self.v_resolution),
            _truncated(max(-self.u_max, min(self.u_max, command.u)), self.u_resolution),
        )


class Robot(NamedTuple):
    """Place and direction, heading [rad] with all turns counted, motion, and the command it follows."""

    at: Course
    heading: float
    motion: Motion
    goal: Motion

    @kernel
    def stands(self) -> bool:
        """Whether it does not move at all."""
        return self.motion.v == 0.0 and self.motion.u == 0.0


class Arcs(NamedTuple):
    """A span of driving: equal arcs of ``step`` [s], and what is left of an offset from the goal.

    ``share``: of the offset, its mean over an arc; ``decay``: at the arc's end.
    """

    pieces: int
    step: float
    share: float
    decay: float


class Travel(NamedTuple):
    """Where a robot is and which way it goes, and its motion that way: v is never negative."""

    pose: Pose
    motion: Motion


def standing(pose: Pose) -> Robot:
    """A robot at rest."""
    at = Course(pose.x, pose.y, math.cos(pose.theta), math.sin(pose.theta))
    return Robot(at, pose.theta, STANDSTILL, STANDSTILL)


@kernel
def pose_of(robot: Robot) -> Pose:
    """Where a robot is, heading wrapped."""
    return Pose(robot.at.x, robot.at.y, wrapped(robot.heading))


@kernel
def travelling(robot: Robot) -> Travel:
    """Pose and motion by the direction of travel: of one that drives backwards turned round, and forwards.

    That is the truth of a leader, whom a follower knows by its positions.
    """
    pose, motion = pose_of(robot), robot.motion
    if motion.v >= 0.0:
        return Travel(pose, motion)
    return Travel(Pose(pose.x, pose.y, wrapped(pose.theta + math.pi)), Motion(-motion.v, motion.u))


@kernel
def arcs_of(dt: float, lag: float) -> Arcs:
    """Arcs of at most 10 ms over dt [s] of driving with first-order actuators."""
    pieces = max(1, math.ceil(dt / _LONGEST_ARC - _ROUNDING))
    step = dt / pieces
    decay = math.exp(-step / lag) if lag > 0.0 else 0.0
    share = (1.0 - decay) * lag / step if step > 0.0 else 0.0
    return Arcs(pieces, step, share, decay)


@kernel
def drive(robot: Robot, arcs: Arcs) -> Robot:
    """Robot after these arcs under its command.

    The motion approaches the command exponentially, exactly; the pose follows each arc with the exact mean
    motion over it.
    """
    at, heading, motion, goal = robot.at, robot.heading, robot.motion, robot.goal
    for _ in range(arcs.pieces):
        v_off, u_off = motion.v - goal.v, motion.u - goal.u
        u = goal.u + u_off * arcs.share
        at = along(at, goal.v + v_off * arcs.share, u, arcs.step)
        heading = heading + u * arcs.step
        motion = Motion(goal.v + v_off * arcs.decay, goal.u + u_off * arcs.decay)
    return Robot(at, heading, motion, goal)


@kernel
def _truncated(value: float, resolution: float) -> float:
    if resolution <= 0.0:
        return value
    steps = value / resolution + math.copysign(_ROUNDING, value)
    return float(math.trunc(steps)) * resolution if abs(steps) < _ALL_WHOLE else value
