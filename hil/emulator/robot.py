"""An emulated differential-drive robot: command truncation, limits, first-order actuators, exact arcs."""

from __future__ import annotations

import math
from dataclasses import dataclass

from formation.pose import STANDSTILL, Motion, Pose, advance

_LONGEST_ARC = 0.01
_ROUNDING = 1e-9  # so that 0.08 / 0.01 counts as 8 whole steps


@dataclass(frozen=True, slots=True)
class Actuators:
    """What lies between a command and the wheels: lag [s], limits, resolution of the firmware link."""

    lag: float
    v_max: float
    u_max: float
    v_resolution: float
    u_resolution: float

    def accept(self, command: Motion) -> Motion:
        """Command as the wheels get it: limited, truncated toward zero; standstill if not finite."""
        if not (math.isfinite(command.v) and math.isfinite(command.u)):
            return STANDSTILL
        return Motion(
            _truncate(max(-self.v_max, min(self.v_max, command.v)), self.v_resolution),
            _truncate(max(-self.u_max, min(self.u_max, command.u)), self.u_resolution),
        )


@dataclass(frozen=True, slots=True)
class Robot:
    """Pose, actual motion, and the command it follows."""

    pose: Pose
    motion: Motion = STANDSTILL
    command: Motion = STANDSTILL

    def told(self, command: Motion) -> Robot:
        """The same robot with another command."""
        return Robot(self.pose, self.motion, command)


def drive(robot: Robot, actuators: Actuators, dt: float) -> Robot:
    """Robot after dt [s] under its command.

    The motion approaches the command exponentially, exactly; the pose follows arcs of at most 10 ms with the
    exact mean motion over each.
    """
    pieces = max(1, math.ceil(dt / _LONGEST_ARC - _ROUNDING))
    step = dt / pieces
    decay = math.exp(-step / actuators.lag) if actuators.lag > 0.0 else 0.0
    share = (1.0 - decay) * actuators.lag / step if step > 0.0 else 0.0
    pose, motion, goal = robot.pose, robot.motion, robot.command
    for _ in range(pieces):
        v_off, u_off = motion.v - goal.v, motion.u - goal.u
        pose = advance(pose, goal.v + v_off * share, goal.u + u_off * share, step)
        motion = Motion(goal.v + v_off * decay, goal.u + u_off * decay)
    return Robot(pose, motion, goal)


def _truncate(value: float, resolution: float) -> float:
    if resolution <= 0.0:
        return value
    steps = value / resolution + math.copysign(_ROUNDING, value)
    return math.trunc(steps) * resolution if math.isfinite(steps) else value
