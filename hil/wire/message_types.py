"""The messages that flow between the daemons, as typed Python classes.

Our own and the motion-capture types are dataclasses with the fields of the ``.msg`` files under
``hil/wire/msg``, where units, frames and signs are stated; they are not frozen, as a frozen one takes three
times as long to make, and a run makes thousands a second. The standard ROS 2 types are those of ``rosbags``.
Sequences of a decoded message are lists, numeric arrays are read-only numpy arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys.stores import ros2_humble as ros

Time = ros.builtin_interfaces__msg__Time
Header = ros.std_msgs__msg__Header
Point = ros.geometry_msgs__msg__Point
Quaternion = ros.geometry_msgs__msg__Quaternion
Vector3 = ros.geometry_msgs__msg__Vector3
Pose = ros.geometry_msgs__msg__Pose
PoseWithCovariance = ros.geometry_msgs__msg__PoseWithCovariance
Twist = ros.geometry_msgs__msg__Twist
TwistStamped = ros.geometry_msgs__msg__TwistStamped
TwistWithCovariance = ros.geometry_msgs__msg__TwistWithCovariance
Odometry = ros.nav_msgs__msg__Odometry
KeyValue = ros.diagnostic_msgs__msg__KeyValue
DiagnosticStatus = ros.diagnostic_msgs__msg__DiagnosticStatus
DiagnosticArray = ros.diagnostic_msgs__msg__DiagnosticArray
String = ros.std_msgs__msg__String


class Message(Protocol):
    """Anything that has a ROS 2 type name, such as ``nav_msgs/msg/Odometry``."""

    __msgtype__: ClassVar[str]


@dataclass(slots=True)
class Marker:
    """One motion-capture marker."""

    id_type: int
    marker_index: int
    marker_name: str
    translation: Point
    __msgtype__: ClassVar[str] = "mocap4r2_msgs/msg/Marker"


@dataclass(slots=True)
class RigidBody:
    """One motion-capture body; nothing in it tells a tracked body from a lost one."""

    rigid_body_name: str
    markers: Sequence[Marker]
    pose: Pose
    __msgtype__: ClassVar[str] = "mocap4r2_msgs/msg/RigidBody"


@dataclass(slots=True)
class RigidBodies:
    """One motion-capture frame, stamped with its capture time."""

    header: Header
    frame_number: int
    rigidbodies: Sequence[RigidBody]
    __msgtype__: ClassVar[str] = "mocap4r2_msgs/msg/RigidBodies"


@dataclass(slots=True)
class NamedPose:
    """One body of a :class:`NamedPoseArray`."""

    name: str
    pose: Pose
    __msgtype__: ClassVar[str] = "motion_capture_tracking_interfaces/msg/NamedPose"


@dataclass(slots=True)
class NamedPoseArray:
    """One motion-capture frame as motion_capture_tracking sends it, stamped at its receipt or not at all."""

    header: Header
    poses: Sequence[NamedPose]
    __msgtype__: ClassVar[str] = "motion_capture_tracking_interfaces/msg/NamedPoseArray"


@dataclass(slots=True)
class Consumed:
    """Receipt of one input: digest of its payload and when it was taken in."""

    digest: int
    received: Time
    __msgtype__: ClassVar[str] = "abreast_msgs/msg/Consumed"


@dataclass(slots=True, eq=False)
class LeaderEstimate:
    """What a follower believes about its leader at ``header.stamp``.

    ``covariance`` is float64 of shape (25,). Two estimates are the same if their encodings are.
    """

    header: Header
    measured: Time
    computed: Time
    rho: float
    alpha2: float
    rho_dot: float
    alpha2_dot: float
    v1: float
    alpha1: float
    u1: float
    v2: float
    u2: float
    covariance: NDArray[np.float64]
    nis: float
    status: int
    reason: str
    bound_v1: float
    bound_alpha1: float
    bound_h: float
    consumed: Sequence[Consumed]
    __msgtype__: ClassVar[str] = "abreast_msgs/msg/LeaderEstimate"


@dataclass(slots=True)
class CertifiedEstimate:
    """An estimate with guaranteed error radii, both NaN where ``failed`` names an assumption that failed."""

    header: Header
    computed: Time
    v1: float
    radius_v1: float
    alpha1: float
    radius_alpha1: float
    measurements: int
    failed: str
    __msgtype__: ClassVar[str] = "abreast_msgs/msg/CertifiedEstimate"


@dataclass(slots=True)
class Command:
    """A controller's decision and what it rests on; the robot itself gets a ``TwistStamped`` or ``Twist``."""

    header: Header
    capture: Time
    measured: Time
    v2: float
    u2: float
    v2_wanted: float
    u2_wanted: float
    saturated: bool
    stop: str
    fresh: bool
    consumed: Sequence[Consumed]
    __msgtype__: ClassVar[str] = "abreast_msgs/msg/Command"


@dataclass(slots=True)
class Truth:
    """True state of an emulated pair in the world frame; only judges may read it."""

    header: Header
    frame_number: int
    leader_x: float
    leader_y: float
    leader_theta: float
    v1: float
    u1: float
    follower_x: float
    follower_y: float
    follower_theta: float
    v2: float
    u2: float
    __msgtype__: ClassVar[str] = "abreast_msgs/msg/Truth"


@dataclass(slots=True)
class RangeBearing:
    """The leader as a sensor on the follower sees it."""

    header: Header
    rho: float
    alpha2: float
    __msgtype__: ClassVar[str] = "abreast_msgs/msg/RangeBearing"


@dataclass(slots=True, eq=False)
class Malformed:
    """A payload that could not be decoded; ``payload`` is uint8 of shape (n,)."""

    header: Header
    topic: str
    payload: NDArray[np.uint8]
    __msgtype__: ClassVar[str] = "abreast_msgs/msg/Malformed"


OWN_TYPES: tuple[type[Message], ...] = (
    Marker,
    RigidBody,
    RigidBodies,
    NamedPose,
    NamedPoseArray,
    Consumed,
    LeaderEstimate,
    CertifiedEstimate,
    Command,
    Truth,
    RangeBearing,
    Malformed,
)
"""The types that abreast defines beyond the standard ROS 2 ones."""
