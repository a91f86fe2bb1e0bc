from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from hil.message_types import (
    Command,
    Consumed,
    DiagnosticArray,
    DiagnosticStatus,
    KeyValue,
    LeaderEstimate,
    Malformed,
    Marker,
    Message,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    RangeBearing,
    RigidBodies,
    RigidBody,
    Truth,
    Twist,
    TwistStamped,
    TwistWithCovariance,
    Vector3,
)
from hil.messages import header, to_time

STAMP_NS = 1_700_000_000_123_456_789


@pytest.fixture(scope="session")
def sample_messages() -> dict[str, Message]:
    """One message of every type that is logged, by topic, with texts and lists that shift the alignment."""
    stamp = header(STAMP_NS, "world")
    pose = Pose(position=Point(x=0.1, y=-0.2, z=0.3), orientation=Quaternion(x=0.0, y=0.0, z=0.6, w=0.8))
    twist = Twist(linear=Vector3(x=0.1, y=0.0, z=0.0), angular=Vector3(x=0.0, y=0.0, z=-0.7))
    marker = Marker(id_type=-1, marker_index=3, marker_name="m", translation=Point(x=1.0, y=2.0, z=3.0))
    consumed = [Consumed(2**64 - 1, to_time(STAMP_NS)), Consumed(0, to_time(0))]
    level = DiagnosticStatus(
        level=1, name="mocap", message="late", hardware_id="", values=[KeyValue(key="frames", value="12")]
    )
    estimate = LeaderEstimate(
        header=stamp,
        measured=to_time(STAMP_NS),
        computed=to_time(STAMP_NS + 1),
        rho=0.2,
        alpha2=1.5,
        rho_dot=-0.01,
        alpha2_dot=0.02,
        v1=0.08,
        alpha1=-1.6,
        u1=0.7,
        v2=0.09,
        u2=-0.5,
        covariance=np.arange(25.0),
        nis=float("nan"),
        status=1,
        reason="ärger",
        bound_v1=0.1,
        bound_alpha1=0.2,
        bound_h=float("inf"),
        consumed=consumed,
    )
    return {
        "rigid_bodies": RigidBodies(
            stamp, 7, [RigidBody("leader", [marker, marker], pose), RigidBody("follower", [], pose)]
        ),
        "leader/odom": Odometry(
            header=stamp,
            child_frame_id="base_link",
            pose=PoseWithCovariance(pose=pose, covariance=np.zeros(36)),
            twist=TwistWithCovariance(twist=twist, covariance=np.ones(36)),
        ),
        "follower/cmd_vel": TwistStamped(header=stamp, twist=twist),
        "leader/cmd_vel": twist,
        "follower/leader_estimate": estimate,
        "follower/command": Command(
            stamp, to_time(1), to_time(2), 0.1, 0.2, float("nan"), 0.4, True, "stale", False, consumed
        ),
        "truth": Truth(stamp, 9, *(float(value) for value in range(10))),
        "follower/range_bearing": RangeBearing(stamp, 0.25, -1.0),
        "malformed": Malformed(stamp, "rigid_bodies", np.array([1, 2, 255], dtype=np.uint8)),
        "diagnostics": DiagnosticArray(header=stamp, status=[level]),
    }


def _plain(value: object) -> object:
    if dataclasses.is_dataclass(value):
        # The classes of rosbags count their type name and their constants as fields.
        names = [field.name for field in dataclasses.fields(value)]
        return {name: _plain(getattr(value, name)) for name in names if name[0] != "_" and not name.isupper()}
    if hasattr(value, "__slots__") and type(value).__module__.startswith("mcap_ros2"):
        return {name: _plain(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, (list, tuple, bytes, np.ndarray)):
        return [_plain(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


@pytest.fixture(scope="session")
def plain() -> Callable[[object], object]:
    """Turn a message of any library into dictionaries, lists and numbers."""
    return _plain
