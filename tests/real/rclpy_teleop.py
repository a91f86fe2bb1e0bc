"""A person who drives robots by remote control, in a process of its own: rclpy and nothing of ours.

``rclpy_teleop.py CONFIG``, where CONFIG is JSON:

    {"domain": 30, "robots": ["tb3_0", "tb3_1"], "seconds": 30}

Every robot is driven in left and right bends by ``Twist``, and is left standing.
"""

from __future__ import annotations

import json
import math
import sys
import time

import rclpy
from geometry_msgs.msg import Twist
from rclpy.qos import QoSProfile

FASTEST, HARDEST, TURNS = 0.12, 0.9, (0.9, 0.7)


def main() -> None:
    given = json.loads(sys.argv[1])
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=given["domain"])
    node = rclpy.create_node("teleop", context=context)
    wheels = [
        node.create_publisher(Twist, f"/{name}/cmd_vel", QoSProfile(depth=10)) for name in given["robots"]
    ]
    begun = time.monotonic()
    while (t := time.monotonic() - begun) < given["seconds"]:
        for omega, wheel in zip(TURNS, wheels, strict=True):
            told = Twist()
            told.linear.x = FASTEST * (0.7 + 0.3 * math.sin(0.5 * t))
            told.angular.z = HARDEST * math.sin(omega * t)
            wheel.publish(told)
        time.sleep(0.05)
    for _ in range(10):
        for wheel in wheels:
            wheel.publish(Twist())
        time.sleep(0.05)


if __name__ == "__main__":
    main()
