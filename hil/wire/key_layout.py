"""Where a topic lies on the wire: the Zenoh key that carries it, as whoever bridges to ROS 2 lays it out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from msgspec import UnsetType

from hil.scenario.schema import Scenario
from hil.wire.source_topics import source_names


@dataclass(frozen=True, slots=True)
class KeyLayout:
    """Keys of topics. ``prefix``: in front of each; ``names``: of topics that have another one on the wire.

    >>> KeyLayout(prefix="lab", names={"follower/odom": "tb3_1/odom"}).key("follower/odom")
    'lab/tb3_1/odom'
    """

    prefix: str = ""
    names: Mapping[str, str] = field(default_factory=dict)

    def name(self, topic: str) -> str:
        """What a topic is called in ROS, without the leading slash."""
        return self.names.get(topic, topic)

    def key(self, topic: str) -> str:
        """Key expression of a topic."""
        name = self.name(topic)
        return f"{self.prefix}/{name}" if self.prefix else name


OURS = KeyLayout()
"""A topic's name is its key."""


def layout_of(scenario: Scenario) -> KeyLayout:
    """Layout of a scenario's topics."""
    given = scenario.wire.topics
    named = {} if isinstance(given, UnsetType) else {topic: name.strip("/") for topic, name in given.items()}
    return KeyLayout(scenario.wire.prefix, source_names(scenario) | named)
