"""What drivers are told, heard in ROS 2 where the drivers of real robots hear it."""

from __future__ import annotations

import contextlib
import importlib.util
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from hil.errors import UsageError
from hil.guard.ros_driver import NO_RCLPY


def refuse_without_ros() -> None:
    """Raise :class:`UsageError` where rclpy is not installed."""
    if importlib.util.find_spec("rclpy") is None:
        raise UsageError(NO_RCLPY)


class RosEar:
    """Hears ``geometry_msgs/TwistStamped`` on topics of a ROS domain, in a thread of its own.

    ``hear``: called with a topic's name, the bytes of a message, and when it came, by the monotonic clock [s]
    and the host's [ns].
    """

    def __init__(
        self, domain: int, names: Sequence[str], hear: Callable[[str, bytes, float, int], None]
    ) -> None:
        import rclpy
        from geometry_msgs.msg import TwistStamped
        from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        self._rclpy: Any = rclpy
        self._context: Any = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self._node: Any = rclpy.create_node("drivers", context=self._context)
        for name in names:

            def note(payload: bytes, name: str = name) -> None:
                hear(name, payload, time.monotonic(), time.time_ns())

            self._node.create_subscription(TwistStamped, f"/{name}", note, 100, raw=True)
        executor: Any = SingleThreadedExecutor(context=self._context)
        executor.add_node(self._node)

        def spin() -> None:
            with contextlib.suppress(ExternalShutdownException):
                executor.spin()

        self._spinning = threading.Thread(target=spin, daemon=True)
        self._spinning.start()

    def close(self) -> None:
        """Leave ROS."""
        self._rclpy.shutdown(context=self._context)
        self._spinning.join()
