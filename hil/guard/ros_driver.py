"""A robot's driver behind ROS 2 on the robot itself: no bridge and no wire lies between it and the guard."""

from __future__ import annotations

import os
from typing import Any

from formation.pose import Motion
from hil.errors import UsageError
from hil.guard.order import GuardOrder

NO_RCLPY = "--ros: rclpy is not installed here; source ROS 2's setup.bash, or leave --ros out"

_DEPTH = 1


class RosDriver:
    """Publishes what the driver is told by rclpy, on the topic that the order names.

    Raises :class:`UsageError` where rclpy is not installed.
    """

    def __init__(self, order: GuardOrder) -> None:
        try:
            import rclpy
            from geometry_msgs.msg import Twist, TwistStamped
            from rclpy.signals import SignalHandlerOptions
        except ImportError:
            raise UsageError(NO_RCLPY) from None
        self._rclpy: Any = rclpy
        self._context: Any = rclpy.Context()
        domain = order.ros_domain or None
        no_handlers = SignalHandlerOptions.NO
        rclpy.init(context=self._context, domain_id=domain, signal_handler_options=no_handlers)
        self._node: Any = rclpy.create_node(f"abreast_guard_{os.getpid()}", context=self._context)
        self._kind: Any = TwistStamped if order.stamped else Twist
        self._stamped, self._frame = order.stamped, order.ros_topic.rpartition("/")[0]
        self._publisher: Any = self._node.create_publisher(self._kind, f"/{order.ros_topic}", _DEPTH)

    def tell(self, motion: Motion, now_ns: int) -> None:
        """Publish a command."""
        message = self._kind()
        twist = message.twist if self._stamped else message
        if self._stamped:
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(now_ns, 10**9)
            message.header.frame_id = self._frame
        twist.linear.x, twist.angular.z = motion.v, motion.u
        self._publisher.publish(message)

    def close(self) -> None:
        """Leave ROS."""
        self._node.destroy_node()
        self._rclpy.shutdown(context=self._context)
