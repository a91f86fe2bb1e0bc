"""Where a rigid body sits on its robot, and each one's pose by the other's."""

from __future__ import annotations

import math
from typing import NamedTuple

from formation.kernel import kernel
from formation.pose import Pose
from formation.wrapping import wrapped


class Mount(NamedTuple):
    """Pose of a rigid body on its robot, from the robot to the body.

    x, y: of the body's origin [m], ahead of the middle of the wheel axis and to the left of it. yaw: from the
    robot's heading to the body's [rad], counter-clockwise positive.
    """

    x: float
    y: float
    yaw: float


NO_MOUNT = Mount(0.0, 0.0, 0.0)


@kernel
def is_aligned(mount: Mount) -> bool:
    """Whether the body's axes are the robot's."""
    return mount.x == 0.0 and mount.y == 0.0 and mount.yaw == 0.0


@kernel
def body_pose(robot: Pose, mount: Mount) -> Pose:
    """Pose of the body on a robot: the robot's pose, then the mount."""
    if is_aligned(mount):
        return robot
    cos, sin = math.cos(robot.theta), math.sin(robot.theta)
    return Pose(
        robot.x + (cos * mount.x - sin * mount.y),
        robot.y + (sin * mount.x + cos * mount.y),
        wrapped(robot.theta + mount.yaw),
    )


@kernel
def robot_pose(body: Pose, mount: Mount) -> Pose:
    """Pose of the robot under a body."""
    if is_aligned(mount):
        return body
    theta = wrapped(body.theta - mount.yaw)
    cos, sin = math.cos(theta), math.sin(theta)
    return Pose(
        body.x - (cos * mount.x - sin * mount.y),
        body.y - (sin * mount.x + cos * mount.y),
        theta,
    )
