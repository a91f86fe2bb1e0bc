"""What the emulated lab sends: mocap frames, odometry and truth as ROS 2 messages."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from formation.pose import Motion, Pose
from hil.emulator.robot import Robot
from hil.wire import message_types as msg
from hil.wire.messages import header

_NO_COVARIANCE = np.zeros(36)
_MOCAP_FRAME = "mocap"


def frame_message(capture_ns: int, number: int, bodies: Iterable[tuple[str, Pose]]) -> msg.RigidBodies:
    """One mocap frame with the bodies' measured poses, z up."""
    return msg.RigidBodies(
        header=header(capture_ns, _MOCAP_FRAME),
        frame_number=number,
        rigidbodies=[msg.RigidBody(name, [], _pose(pose)) for name, pose in bodies],
    )


def odometry_message(stamp_ns: int, robot: str, pose: Pose, motion: Motion) -> msg.Odometry:
    """Wheel odometry of a robot: ``motion`` as its encoders and gyro measured it."""
    twist = msg.Twist(
        linear=msg.Vector3(x=motion.v, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=motion.u)
    )
    return msg.Odometry(
        header=header(stamp_ns, f"{robot}/odom"),
        child_frame_id=f"{robot}/base_footprint",
        pose=msg.PoseWithCovariance(pose=_pose(pose), covariance=_NO_COVARIANCE),
        twist=msg.TwistWithCovariance(twist=twist, covariance=_NO_COVARIANCE),
    )


def truth_message(stamp_ns: int, number: int, leader: Robot, follower: Robot) -> msg.Truth:
    """True state of both robots at the capture time of a frame."""
    return msg.Truth(
        header=header(stamp_ns, _MOCAP_FRAME),
        frame_number=number,
        leader_x=leader.pose.x,
        leader_y=leader.pose.y,
        leader_theta=leader.pose.theta,
        v1=leader.motion.v,
        u1=leader.motion.u,
        follower_x=follower.pose.x,
        follower_y=follower.pose.y,
        follower_theta=follower.pose.theta,
        v2=follower.motion.v,
        u2=follower.motion.u,
    )


def _pose(pose: Pose) -> msg.Pose:
    half = 0.5 * pose.theta
    return msg.Pose(
        position=msg.Point(x=pose.x, y=pose.y, z=0.0),
        orientation=msg.Quaternion(x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)),
    )
