"""Where a topic lies on the wire: the Zenoh key that carries it, as whoever bridges to ROS 2 lays it out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from msgspec import UnsetType

from hil.scenario.schema import Scenario
from hil.wire.messages import rihs01
from hil.wire.source_topics import source_names, source_topics
from hil.wire.topics import types_of

_NO_HASH = "TypeHashNotSupported"
_WITHOUT_HASHES = ("humble",)
"""Distributions in which types have no hash."""


@dataclass(frozen=True, slots=True)
class KeyLayout:
    """Keys of topics. ``prefix``: in front of each; ``names``: of topics that have another one on the wire.

    ``kind``: as of zenoh-bridge-ros2dds or of rmw_zenoh, which needs the ``types`` of topics, the ROS
    ``domain`` and the ``distro``.

    >>> KeyLayout(prefix="lab", names={"follower/odom": "tb3_1/odom"}).key("follower/odom")
    'lab/tb3_1/odom'
    """

    prefix: str = ""
    names: Mapping[str, str] = field(default_factory=dict)
    kind: Literal["ros2dds", "rmw_zenoh"] = "ros2dds"
    types: Mapping[str, str] = field(default_factory=dict)
    domain: int = 0
    distro: str = "jazzy"

    def name(self, topic: str) -> str:
        """What a topic is called in ROS, without the leading slash."""
        return self.names.get(topic, topic)

    def key(self, topic: str) -> str:
        """Key under which a topic is published."""
        return self._key(topic, self.type_hash(topic) if self.kind == "rmw_zenoh" else "")

    def heard(self, topic: str) -> str:
        """Key expression under which a topic is heard, whatever version of its type has been hashed."""
        return self._key(topic, "*")

    def type_hash(self, topic: str) -> str:
        """Hash of a topic's type as the distribution has it."""
        return _NO_HASH if self.distro in _WITHOUT_HASHES else rihs01(self.types[topic])

    def within(self, key: str) -> str:
        """A key with the prefix in front."""
        return f"{self.prefix}/{key}" if self.prefix else key

    def _key(self, topic: str, type_hash: str) -> str:
        name = self.name(topic)
        if self.kind == "ros2dds":
            return self.within(name)
        return self.within(f"{self.domain}/{name}/{dds_type(self.types[topic])}/{type_hash}")


OURS = KeyLayout()
"""A topic's name is its key."""


def dds_type(typename: str) -> str:
    """What a ROS type is called in DDS.

    >>> dds_type("nav_msgs/msg/Odometry")
    'nav_msgs::msg::dds_::Odometry_'
    """
    package, kind, name = typename.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_type(name: str) -> str:
    """The ROS type by what it is called in DDS; a name that is none comes back as it is.

    >>> ros_type("nav_msgs::msg::dds_::Odometry_")
    'nav_msgs/msg/Odometry'
    """
    match name.split("::"):
        case [package, kind, "dds_", own] if own.endswith("_"):
            return f"{package}/{kind}/{own[:-1]}"
    return name


def layout_of(scenario: Scenario) -> KeyLayout:
    """Layout of a scenario's topics."""
    wire = scenario.wire
    named = {} if isinstance(wire.topics, UnsetType) else _stripped(wire.topics)
    sources = {topic: each.typename for topic, each in source_topics(scenario).items()}
    names, types = source_names(scenario) | named, types_of(scenario) | sources
    return KeyLayout(wire.prefix, names, wire.layout, types, wire.domain, wire.distro)


def _stripped(names: Mapping[str, str]) -> dict[str, str]:
    return {topic: name.strip("/") for topic, name in names.items()}
