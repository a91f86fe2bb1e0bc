"""Poses of bodies out of the messages in which motion capture comes, and these messages out of poses.

All have the same content: bodies with a name, a position and, as a rule, an orientation, at a time, in a
frame of reference. Lengths and axes are those of the source; :func:`upright` makes them ours.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from rosbags.typesys.stores import ros2_humble as ros

from hil.scenario.lab import SourceType
from hil.wire import message_types as msg
from hil.wire.messages import decode_as, to_ns
from hil.wire.records import Placement

PoseStamped = ros.geometry_msgs__msg__PoseStamped
PoseWithCovarianceStamped = ros.geometry_msgs__msg__PoseWithCovarianceStamped
TransformStamped = ros.geometry_msgs__msg__TransformStamped
Transform = ros.geometry_msgs__msg__Transform
TFMessage = ros.tf2_msgs__msg__TFMessage

_NO_COVARIANCE = np.zeros(36)
_NO_TWIST = msg.Twist(linear=msg.Vector3(x=0.0, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=0.0))


class NamedPlace(NamedTuple):
    """A body at a time of the source's clock [ns], 0 where it tells none, in its frame of reference."""

    body: str
    stamp_ns: int
    frame_id: str
    place: Placement


MESSAGES: dict[SourceType, type[msg.Message]] = {
    "RigidBodies": msg.RigidBodies,
    "NamedPoseArray": msg.NamedPoseArray,
    "PoseStamped": PoseStamped,
    "PoseWithCovarianceStamped": PoseWithCovarianceStamped,
    "Odometry": msg.Odometry,
    "TransformStamped": TransformStamped,
    "TFMessage": TFMessage,
}
"""The message of each type of source."""


def source_type(typename: str) -> SourceType | None:
    """The type of source that a message type is, None for one that tells no poses.

    >>> source_type("geometry_msgs/msg/PoseStamped")
    'PoseStamped'
    """
    return next((name for name, kind in MESSAGES.items() if kind.__msgtype__ == typename), None)


def places_in(kind: SourceType, payload: bytes | memoryview, body: str = "") -> list[NamedPlace]:
    """What a message tells of bodies. ``body``: whose it is, where the topic says it and not the message.

    Raises :class:`hil.wire.messages.MalformedPayloadError` for a payload that is no message of that type, or
    has a stamp that no clock gives.
    """
    return places_of(decode_as(payload, MESSAGES[kind]), body)


def places_of(message: msg.Message, body: str = "") -> list[NamedPlace]:
    """The same of a message that has been decoded; none of one of another type."""
    if isinstance(message, msg.RigidBodies):
        seen = ((each.rigid_body_name, each.pose) for each in message.rigidbodies)
        return [_placed(name, message.header, pose) for name, pose in seen]
    if isinstance(message, msg.NamedPoseArray):
        return [_placed(each.name, message.header, each.pose) for each in message.poses]
    if isinstance(message, PoseStamped):
        return [_placed(body, message.header, message.pose)]
    if isinstance(message, PoseWithCovarianceStamped | msg.Odometry):
        return [_placed(body, message.header, message.pose.pose)]
    if isinstance(message, TransformStamped):
        return [_transformed(message, body)]
    if isinstance(message, TFMessage):
        return [_transformed(each, "") for each in message.transforms]
    return []


def upright(place: Placement, up: str, scale: float) -> Placement:
    """A place with z up and in metres, of one with axis ``up`` up and a unit of ``scale`` metres.

    What points along y with y up then points along z, and a body keeps its heading about the vertical.

    >>> upright(Placement(1000.0, 20.0, -500.0, 0.0, 0.6, 0.0, 0.8), "y", 0.001)
    Placement(x=1.0, y=0.5, z=0.02, qx=0.0, qy=-0.0, qz=0.6, qw=0.8)
    """
    x, y, z, qx, qy, qz, qw = place
    if up == "y":
        y, z, qy, qz = -z, y, -qz, qy
    return Placement(scale * x, scale * y, scale * z, qx, qy, qz, qw)


def laid(place: Placement, up: str, scale: float) -> Placement:
    """A place as such a source tells it; the way back of :func:`upright`."""
    x, y, z, qx, qy, qz, qw = place
    if up == "y":
        y, z, qy, qz = z, -y, qz, -qy
    return Placement(x / scale, y / scale, z / scale, qx, qy, qz, qw)


def pose_of(place: Placement) -> msg.Pose:
    """A place as a message."""
    return msg.Pose(
        position=msg.Point(x=place.x, y=place.y, z=place.z),
        orientation=msg.Quaternion(x=place.qx, y=place.qy, z=place.qz, w=place.qw),
    )


def message_of(kind: SourceType, head: msg.Header, seen: Iterable[tuple[str, Placement]]) -> msg.Message:
    """A message of a type of source, of one body where it holds one."""
    bodies = list(seen)
    if kind in OF_ONE:
        return OF_ONE[kind](head, *bodies[0])
    if kind == "NamedPoseArray":
        return msg.NamedPoseArray(head, [msg.NamedPose(name, pose_of(place)) for name, place in bodies])
    if kind == "TFMessage":
        return TFMessage(transforms=[_as_transform(head, name, place) for name, place in bodies])
    return msg.RigidBodies(head, 0, [msg.RigidBody(name, [], pose_of(place)) for name, place in bodies])


def _placed(body: str, head: msg.Header, pose: msg.Pose) -> NamedPlace:
    at, turn = pose.position, pose.orientation
    place = Placement(at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w)
    return NamedPlace(body, to_ns(head.stamp), head.frame_id, place)


def _transformed(message: TransformStamped, body: str) -> NamedPlace:
    by, turn = message.transform.translation, message.transform.rotation
    place = Placement(by.x, by.y, by.z, turn.x, turn.y, turn.z, turn.w)
    head = message.header
    return NamedPlace(body or message.child_frame_id, to_ns(head.stamp), head.frame_id, place)


def _as_stamped(head: msg.Header, _body: str, place: Placement) -> msg.Message:
    return PoseStamped(header=head, pose=pose_of(place))


def _as_covariant(head: msg.Header, _body: str, place: Placement) -> msg.Message:
    pose = msg.PoseWithCovariance(pose=pose_of(place), covariance=_NO_COVARIANCE)
    return PoseWithCovarianceStamped(header=head, pose=pose)


def _as_odometry(head: msg.Header, body: str, place: Placement) -> msg.Message:
    return msg.Odometry(
        header=head,
        child_frame_id=body,
        pose=msg.PoseWithCovariance(pose=pose_of(place), covariance=_NO_COVARIANCE),
        twist=msg.TwistWithCovariance(twist=_NO_TWIST, covariance=_NO_COVARIANCE),
    )


def _as_transform(head: msg.Header, body: str, place: Placement) -> TransformStamped:
    by = msg.Vector3(x=place.x, y=place.y, z=place.z)
    return TransformStamped(
        header=head,
        child_frame_id=body,
        transform=Transform(translation=by, rotation=pose_of(place).orientation),
    )


OF_ONE: dict[SourceType, Callable[[msg.Header, str, Placement], msg.Message]] = {
    "PoseStamped": _as_stamped,
    "PoseWithCovarianceStamped": _as_covariant,
    "Odometry": _as_odometry,
    "TransformStamped": _as_transform,
}
"""Types whose messages hold one body each, and how they are made."""
