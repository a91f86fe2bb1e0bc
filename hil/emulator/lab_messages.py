"""What the emulated lab sends: mocap frames, odometry and truth as ROS 2 messages."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from formation.pose import Motion, Pose
from hil.emulator.mocap import SeenPose, seen_pose
from hil.emulator.robot import Robot, pose_of
from hil.wire import message_types as msg
from hil.wire.messages import header

_NO_COVARIANCE = np.zeros(36)
_MOCAP_FRAME = "mocap"


def frame_message(capture_ns: int, number: int, bodies: Iterable[tuple[str, Pose]]) -> msg.RigidBodies:
    """One mocap frame with the bodies' measured poses, z up."""
    return seen_message(capture_ns, number, ((name, seen_pose(pose)) for name, pose in bodies))


def seen_message(capture_ns: int, number: int, bodies: Iterable[tuple[str, SeenPose]]) -> msg.RigidBodies:
    """One mocap frame with the bodies as it shows them."""
    return msg.RigidBodies(
        header=header(capture_ns, _MOCAP_FRAME),
        frame_number=number,
        rigidbodies=[msg.RigidBody(name, [], _pose(seen)) for name, seen in bodies],
    )


def odometry_message(stamp_ns: int, robot: str, pose: Pose, motion: Motion) -> msg.Odometry:
    """Wheel odometry of a robot: ``motion`` as its encoders and gyro measured it."""
    return told_message(stamp_ns, robot, seen_pose(pose), motion)


def told_message(stamp_ns: int, robot: str, seen: SeenPose, motion: Motion) -> msg.Odometry:
    """Wheel odometry of a robot, its pose as messages tell it."""
    twist = msg.Twist(
        linear=msg.Vector3(x=motion.v, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=motion.u)
    )
    return msg.Odometry(
        header=header(stamp_ns, f"{robot}/odom"),
        child_frame_id=f"{robot}/base_footprint",
        pose=msg.PoseWithCovariance(pose=_pose(seen), covariance=_NO_COVARIANCE),
        twist=msg.TwistWithCovariance(twist=twist, covariance=_NO_COVARIANCE),
    )


def truth_message(stamp_ns: int, number: int, leader: Robot, follower: Robot) -> msg.Truth:
    """True state of both robots at the capture time of a frame."""
    first, second = pose_of(leader), pose_of(follower)
    return msg.Truth(
        header=header(stamp_ns, _MOCAP_FRAME),
        frame_number=number,
        leader_x=first.x,
        leader_y=first.y,
        leader_theta=first.theta,
        v1=leader.motion.v,
        u1=leader.motion.u,
        follower_x=second.x,
        follower_y=second.y,
        follower_theta=second.theta,
        v2=follower.motion.v,
        u2=follower.motion.u,
    )


def _pose(seen: SeenPose) -> msg.Pose:
    return msg.Pose(
        position=msg.Point(x=seen.x, y=seen.y, z=0.0),
        orientation=msg.Quaternion(x=0.0, y=0.0, z=seen.qz, w=seen.qw),
    )
