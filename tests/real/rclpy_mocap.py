"""A motion capture as ROS 2 has them, in a process of its own: rclpy and nothing of ours.

`rclpy_mocap.py CONFIG`, where CONFIG is JSON:

    {"domain": 83, "poses_at": 27470, "duration_s": 60, "bodies": ["1", "2"], "type": "RigidBodies",
     "topic": "rigid_bodies", "sigma_position": 0.0003, "sigma_heading": 0.0035, "latency_s": 0.03}

It hears the true poses of the robots by UDP, and publishes them with noise and as late as that, stamped with
their capture: ``RigidBodies`` as mocap4ros2 does, or ``PoseStamped`` for each body, ``{body}`` in its topic.
"""

from __future__ import annotations

import json
import math
import random
import socket
import struct
import sys
import time
from typing import Any

import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

MARKER = "int8 id_type\nint32 marker_index\nstring marker_name\ngeometry_msgs/Point translation\n"
BODY = "string rigid_body_name\nmocap4r2_msgs/Marker[] markers\ngeometry_msgs/Pose pose\n"
FRAME = "std_msgs/Header header\nuint32 frame_number\nmocap4r2_msgs/RigidBody[] rigidbodies\n"

Pose = tuple[float, float, float]


class RigidBodies:
    """Publishes frames as mocap4ros2 does."""

    def __init__(self, node: Any, given: dict[str, Any], profile: QoSProfile) -> None:
        from mocap4r2_msgs.msg import RigidBodies as Kind  # type: ignore[import-not-found]

        self._store = get_typestore(Stores.ROS2_JAZZY)
        for name, text in (("Marker", MARKER), ("RigidBody", BODY), ("RigidBodies", FRAME)):
            self._store.register(get_types_from_msg(text, f"mocap4r2_msgs/msg/{name}"))
        self._publisher = node.create_publisher(Kind, given["topic"], profile)
        self._bodies, self._number = given["bodies"], 0

    def publish(self, stamp_ns: int, poses: list[Pose]) -> None:
        kinds = self._store.types
        self._number += 1
        bodies = []
        for name, (x, y, theta) in zip(self._bodies, poses, strict=True):
            point = kinds["geometry_msgs/msg/Point"](x=x, y=y, z=0.1)
            turn = kinds["geometry_msgs/msg/Quaternion"](
                x=0.0, y=0.0, z=math.sin(theta / 2), w=math.cos(theta / 2)
            )
            pose = kinds["geometry_msgs/msg/Pose"](position=point, orientation=turn)
            bodies.append(kinds["mocap4r2_msgs/msg/RigidBody"](rigid_body_name=name, markers=[], pose=pose))
        stamp = kinds["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="map")
        frame = kinds["mocap4r2_msgs/msg/RigidBodies"](
            header=header, frame_number=self._number, rigidbodies=bodies
        )
        kind = "mocap4r2_msgs/msg/RigidBodies"
        self._publisher.publish(bytes(self._store.serialize_cdr(frame, kind, little_endian=True)))


class PoseForEach:
    """Publishes a pose for each body, as vrpn_mocap does."""

    def __init__(self, node: Any, given: dict[str, Any], profile: QoSProfile) -> None:
        names = [given["topic"].replace("{body}", body) for body in given["bodies"]]
        self._publishers = [node.create_publisher(PoseStamped, name, profile) for name in names]

    def publish(self, stamp_ns: int, poses: list[Pose]) -> None:
        for publisher, (x, y, theta) in zip(self._publishers, poses, strict=True):
            told = PoseStamped()
            told.header.stamp = Time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
            told.header.frame_id = "map"
            told.pose.position.x, told.pose.position.y, told.pose.position.z = x, y, 0.1
            told.pose.orientation.z, told.pose.orientation.w = math.sin(theta / 2), math.cos(theta / 2)
            publisher.publish(told)


def main() -> None:
    given = json.loads(sys.argv[1])
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=given["domain"])
    node = rclpy.create_node("mocap", context=context)
    profile = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
    capture = (RigidBodies if given["type"] == "RigidBodies" else PoseForEach)(node, given, profile)
    heard = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    heard.bind(("127.0.0.1", given["poses_at"]))
    heard.settimeout(0.002)
    drawn = random.Random(given.get("seed", 1))
    position, heading = given.get("sigma_position", 0.0), given.get("sigma_heading", 0.0)
    waiting: list[tuple[float, list[Pose]]] = []
    until = time.time() + given["duration_s"]
    print("ready", flush=True)
    while time.time() < until:
        try:
            captured, *numbers = struct.unpack(f"<d{3 * len(given['bodies'])}d", heard.recv(1500))
            poses = [
                (x + drawn.gauss(0, position), y + drawn.gauss(0, position), theta + drawn.gauss(0, heading))
                for x, y, theta in zip(numbers[::3], numbers[1::3], numbers[2::3], strict=True)
            ]
            waiting.append((captured, poses))
        except TimeoutError:
            pass
        while waiting and time.time() >= waiting[0][0] + given.get("latency_s", 0.0):
            captured, poses = waiting.pop(0)
            capture.publish(int(captured * 1e9), poses)


if __name__ == "__main__":
    main()
