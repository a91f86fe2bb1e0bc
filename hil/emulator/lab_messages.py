"""Mocap frames and odometry as ROS 2 messages, as the emulated lab and recordings have them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from formation.pose import Motion, Pose
from hil.emulator.mocap import SeenPose, seen_pose
from hil.wire import message_types as msg
from hil.wire.messages import header
from hil.wire.topics import within

_NO_COVARIANCE = np.zeros(36)
MOCAP_FRAME = "mocap"


def frame_message(capture_ns: int, number: int, bodies: Iterable[tuple[str, Pose]]) -> msg.RigidBodies:
    """One mocap frame with the bodies' measured poses, z up."""
    return msg.RigidBodies(
        header=header(capture_ns, MOCAP_FRAME),
        frame_number=number,
        rigidbodies=[msg.RigidBody(name, [], _pose(seen_pose(pose))) for name, pose in bodies],
    )


def odometry_frames(robot: str) -> tuple[str, str]:
    """Frames of the odometry of a robot in a namespace: that it counts in, and its own."""
    return within(robot, "odom"), within(robot, "base_footprint")


def odometry_message(stamp_ns: int, robot: str, pose: Pose, motion: Motion) -> msg.Odometry:
    """Wheel odometry of a robot: ``motion`` as its encoders and gyro measured it."""
    frame_id, child_frame_id = odometry_frames(robot)
    twist = msg.Twist(
        linear=msg.Vector3(x=motion.v, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=motion.u)
    )
    return msg.Odometry(
        header=header(stamp_ns, frame_id),
        child_frame_id=child_frame_id,
        pose=msg.PoseWithCovariance(pose=_pose(seen_pose(pose)), covariance=_NO_COVARIANCE),
        twist=msg.TwistWithCovariance(twist=twist, covariance=_NO_COVARIANCE),
    )


def _pose(seen: SeenPose) -> msg.Pose:
    return msg.Pose(
        position=msg.Point(x=seen.x, y=seen.y, z=0.0),
        orientation=msg.Quaternion(x=0.0, y=0.0, z=seen.qz, w=seen.qw),
    )
