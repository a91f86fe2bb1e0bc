"""TurtleBot3 as ROS 2 has them, in a process of their own: rclpy and nothing of ours.

"ready" is printed when they are there, "met" when the graph knows who hears and who commands each of them.
Odometry comes at 20 Hz. Commands are cut to whole steps by ``int(100 v)``, answered with a first-order lag,
and kept for ever: there is no timeout. `rclpy_robots.py CONFIG`, where CONFIG is JSON:

    {"domain": 83, "poses_to": 27470, "duration_s": 60, "robots": [
        {"namespace": "leader", "pose": [0.3, 0.0, 1.5], "type": "TwistStamped", "hand": null}, ...]}

True poses go by UDP to the motion capture on that port, 120 times a second, and with ``"table": PATH`` into
a CSV at the end: time [s], both poses, v and u of the first robot, of each capture. A robot with a ``hand``
{v, u_mean, u_amplitude, omega} is driven by it, from when a line comes on standard input. At its end, or that
of standard input, the process prints one line of JSON: of each robot the commands heard, its pose and its
speed.
"""

from __future__ import annotations

import csv
import json
import math
import select
import socket
import struct
import sys
import time
from typing import Any

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile

CAPTURES_HZ = 120.0
ODOMETRY_S = 0.05
V_MAX, U_MAX = 0.22, 2.84
SUBSTEPS = 4


class Robot:
    """One robot: its node in ROS, and how it moves."""

    def __init__(self, context: Any, given: dict[str, Any]) -> None:
        namespace = given["namespace"]
        self.node = rclpy.create_node("turtlebot3_node", namespace=namespace or None, context=context)
        self.pose = list(given["pose"])
        self.odometry_pose = [0.0, 0.0, 0.0]
        self.asked = self.speed = (0.0, 0.0)
        self.hand, self.lag = given.get("hand"), given.get("lag_s", 0.1)
        self.heard = 0
        kind = TwistStamped if given.get("type", "TwistStamped") == "TwistStamped" else Twist
        if given.get("listens", True):
            self.node.create_subscription(kind, "cmd_vel", self._on_command, QoSProfile(depth=10))
        self._odometry = self.node.create_publisher(Odometry, "odom", QoSProfile(depth=10))
        self._commands = f"/{namespace}/cmd_vel" if namespace else "/cmd_vel"

    def is_met(self) -> bool:
        """Whether somebody listens to its odometry and somebody sends it commands, as the graph knows."""
        heard: int = self._odometry.get_subscription_count()
        told: int = self.node.count_publishers(self._commands)
        return heard > 0 and told > 0

    def _on_command(self, message: Any) -> None:
        twist = message.twist if hasattr(message, "twist") else message
        self.heard += 1
        v, u = int(twist.linear.x * 100) / 100, int(twist.angular.z * 100) / 100
        self.asked = max(-V_MAX, min(V_MAX, v)), max(-U_MAX, min(U_MAX, u))

    def move(self, seconds: float, driven_s: float | None) -> None:
        """Move on; ``driven_s``: since its hand began to drive."""
        if self.hand and driven_s is not None:
            turn = self.hand["u_amplitude"] * math.sin(self.hand["omega"] * driven_s)
            self.asked = self.hand["v"], self.hand["u_mean"] + turn
        step = seconds / SUBSTEPS
        for _ in range(SUBSTEPS):
            share = 1.0 - math.exp(-step / self.lag)
            v, u = (is_ + share * (to - is_) for is_, to in zip(self.speed, self.asked, strict=True))
            self.speed = v, u
            for pose in (self.pose, self.odometry_pose):
                middle = pose[2] + u * step / 2
                pose[0] += v * step * math.cos(middle)
                pose[1] += v * step * math.sin(middle)
                pose[2] = math.remainder(pose[2] + u * step, math.tau)

    def tell(self) -> None:
        """Publish odometry."""
        told = Odometry()
        told.header.stamp = self.node.get_clock().now().to_msg()
        told.header.frame_id, told.child_frame_id = "odom", "base_footprint"
        x, y, theta = self.odometry_pose
        told.pose.pose.position.x, told.pose.pose.position.y = x, y
        told.pose.pose.orientation.z, told.pose.pose.orientation.w = math.sin(theta / 2), math.cos(theta / 2)
        told.twist.twist.linear.x, told.twist.twist.angular.z = self.speed
        self._odometry.publish(told)


def main() -> None:
    given = json.loads(sys.argv[1])
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=given["domain"])
    executor = SingleThreadedExecutor(context=context)
    robots = [Robot(context, each) for each in given["robots"]]
    for robot in robots:
        executor.add_node(robot.node)
    mocap = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    began = moved = told = time.time()
    driven_from: float | None = None
    captured = 0
    rows: list[list[float]] = []
    print("ready", flush=True)
    are_met = False
    while time.time() - began < given["duration_s"]:
        until = began + (captured + 1) / CAPTURES_HZ
        while (left := until - time.time()) > 0.0:
            executor.spin_once(timeout_sec=left)
        now = time.time()
        if select.select([sys.stdin], [], [], 0.0)[0]:
            if not sys.stdin.readline():
                break
            driven_from = driven_from or now
        for robot in robots:
            robot.move(now - moved, None if driven_from is None else now - driven_from)
        moved = now
        captured = int((now - began) * CAPTURES_HZ)
        poses = [number for robot in robots for number in robot.pose]
        mocap.sendto(struct.pack(f"<d{len(poses)}d", now, *poses), ("127.0.0.1", given["poses_to"]))
        rows.append([now, *poses, *robots[0].speed])
        if not are_met and all(robot.is_met() for robot in robots):
            are_met = True
            print("met", flush=True)
        if now >= told + ODOMETRY_S:
            told += ODOMETRY_S
            for robot in robots:
                robot.tell()
    if "table" in given:
        with open(given["table"], "w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(rows)
    result = {
        robot.node.get_namespace(): {"heard": robot.heard, "pose": robot.pose, "speed": robot.speed}
        for robot in robots
    }
    print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main()
