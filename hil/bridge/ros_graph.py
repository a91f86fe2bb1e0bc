"""ROS 2 as a bridge needs it: a node whose subscriptions and publishers carry bytes. Imports rclpy late.

A message is never taken apart here; its class is needed for its name and its layout in DDS only.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

from hil.bridge.ros_routes import Route
from hil.errors import UsageError

_INSTALL = (
    "source the setup.bash of a ROS 2 of this Python, or pip install 'abreast[ros]' (Python 3.11 or 3.12)"
)


def carried(routes: tuple[Route, ...], say: Callable[[str], None]) -> tuple[Route, ...]:
    """The routes that ROS can carry here. A motion capture whose messages it does not know is left out.

    That is said: it may come by another bridge. Raises :class:`UsageError` without rclpy, or another package.
    """
    _imported("rclpy")
    found = []
    for route in routes:
        try:
            message_class(route.typename)
        except UsageError as error:
            if not route.sensed:
                raise
            say(f"{route.name} is not brought in ({error})")
            continue
        found.append(route)
    return tuple(found)


class RosGraph:
    """A node of ROS 2 and its routes. ``heard``: called with the topic and the bytes of what comes in.

    Raises :class:`UsageError` where rclpy or a message package is not there.
    """

    def __init__(
        self, name: str, domain: int | None, routes: tuple[Route, ...], heard: Callable[[str, bytes], None]
    ) -> None:
        rclpy = _imported("rclpy")
        executors, signals, qos = (_imported(f"rclpy.{part}") for part in ("executors", "signals", "qos"))
        kinds = {route.typename: message_class(route.typename) for route in routes}
        self._context = rclpy.Context()
        try:
            rclpy.init(
                args=[],
                context=self._context,
                domain_id=domain,
                signal_handler_options=signals.SignalHandlerOptions.NO,
            )
        except RuntimeError as error:
            raise UsageError(f"bridge ros2: ROS 2 does not come up ({error}); {_INSTALL}") from None
        self._node = rclpy.create_node(
            name, context=self._context, enable_rosout=False, start_parameter_services=False
        )
        self._executor = executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._routes = {route.topic: route for route in routes}
        self._publishers: dict[str, Any] = {}
        for route in routes:
            profile = qos.QoSProfile(
                depth=route.depth,
                reliability=qos.ReliabilityPolicy.RELIABLE
                if route.reliable
                else qos.ReliabilityPolicy.BEST_EFFORT,
            )
            kind = kinds[route.typename]
            if route.way != "out":
                hear = _hearing(route.topic, heard)
                self._node.create_subscription(kind, route.name, hear, profile, raw=True)
            if route.way != "in":
                self._publishers[route.topic] = self._node.create_publisher(kind, route.name, profile)

    def spin(self, timeout: float) -> None:
        """Hear what is there, at the latest after ``timeout`` [s]."""
        self._executor.spin_once(timeout_sec=timeout)

    def publish(self, topic: str, payload: bytes) -> None:
        """Publish a message that is given as its bytes."""
        self._publishers[topic].publish(payload)

    def listeners(self, topic: str) -> list[str]:
        """Types by which others listen to a topic that we publish, one for each, such as ``pkg/msg/Type``."""
        route = self._routes[topic]
        own = 1 if route.way == "both" else 0
        told = self._node.get_subscriptions_info_by_topic(route.name)
        return [info.topic_type for info in told][own:]

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown(timeout_sec=1.0)
        self._node.destroy_node()
        self._context.try_shutdown()


def message_class(typename: str) -> Any:
    """Python class of a message type by its name, such as ``nav_msgs/msg/Odometry``.

    Raises :class:`UsageError` where its package is not installed.
    """
    package, _, name = typename.split("/")
    try:
        kind = getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        raise UsageError(
            f"bridge ros2: the ROS package {package} has no {name} here, expected {typename}; install "
            f"ros-<distro>-{package.replace('_', '-')} or source the workspace that has it"
        ) from None
    return kind


def _imported(module: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise UsageError(f"bridge ros2: rclpy cannot be imported ({error}); {_INSTALL}") from None


def _hearing(topic: str, heard: Callable[[str, bytes], None]) -> Callable[[bytes], None]:
    return lambda payload: heard(topic, bytes(payload))
