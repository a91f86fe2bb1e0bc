"""An operator in ROS 2, in a process of its own: rclpy and nothing of ours.

``rclpy_operator.py CONFIG``, where CONFIG is JSON: ``{"domain": 83}``. It is ready once somebody else listens
to /stop and publishes it; then it publishes each line of its input there, and prints what comes there from
anybody, until its input ends.
"""

from __future__ import annotations

import json
import select
import sys

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from std_msgs.msg import String


def main() -> None:
    given = json.loads(sys.argv[1])
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=given["domain"])
    node = rclpy.create_node("operator", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    publisher = node.create_publisher(String, "/stop", QoSProfile(depth=10))
    node.create_subscription(String, "/stop", lambda told: print(told.data, flush=True), QoSProfile(depth=10))
    while node.count_publishers("/stop") < 2 or node.count_subscribers("/stop") < 2:
        executor.spin_once(timeout_sec=0.1)
    print("ready", flush=True)
    while True:
        executor.spin_once(timeout_sec=0.02)
        if select.select([sys.stdin], [], [], 0.0)[0]:
            line = sys.stdin.readline().strip()
            if not line:
                return
            publisher.publish(String(data=line))


if __name__ == "__main__":
    main()
