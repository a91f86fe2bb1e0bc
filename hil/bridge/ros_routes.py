"""Which topics a bridge to ROS 2 carries, and which way: from the robots to us, or from us to them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from hil.wire.key_layout import layout_of
from hil.wire.source_topics import source_topics
from hil.wire.topics import DIAGNOSTICS, RIGID_BODIES, STOP, link_topics, types_of

Way = Literal["in", "out", "both"]

SENSOR_DEPTH = 10
_ORDER_DEPTH = 10


@dataclass(frozen=True, slots=True)
class Route:
    """A topic that is carried: its ``name`` in ROS, its type, which way, and how it is kept there.

    ``way``: "in" from ROS to us. ``reliable``: else best effort, which hears any publisher. ``drives``: it
    tells a robot to drive, so that nobody hearing it is a finding once it was told something, or from the
    beginning where it is ``due``. ``optional``: it need not come. ``sensed``: it is of a motion capture.
    """

    topic: str
    name: str
    typename: str
    way: Way
    reliable: bool
    depth: int
    drives: bool = False
    due: bool = False
    optional: bool = False
    sensed: bool = False


def routes_of(scenario: Scenario) -> tuple[Route, ...]:
    """Routes of a scenario: motion capture, odometry and orders in; commands and diagnostics out; stop both.

    The prefix of the wire is the bridge's own, and is in none of the names in ROS.
    """
    layout, types = layout_of(scenario), types_of(scenario)
    sources = {topic: each.typename for topic, each in source_topics(scenario).items()}
    sensed = sources or {RIGID_BODIES: types[RIGID_BODIES]}
    captured = frozenset(sensed)
    pairs = [link_topics(link) for link in links_of(scenario)]
    for topic in (odom for pair in pairs for odom in (pair.leader_odom, pair.odom)):
        sensed[topic] = types[topic]

    def route(topic: str, way: Way, depth: int, *, reliable: bool = True) -> Route:
        kind = sensed.get(topic) or types[topic]
        return Route(topic, f"/{layout.name(topic)}", kind, way, reliable, depth, sensed=topic in captured)

    first = pairs[0].leader_cmd_vel
    # One that is emulated has nobody in ROS to listen for it.
    is_real = scenario.source.emulated != "follower"
    return (
        *(route(topic, "in", SENSOR_DEPTH, reliable=False) for topic in sensed),
        *(replace(route(pair.side, "in", _ORDER_DEPTH), optional=True) for pair in pairs),
        replace(route(first, "out", 1), drives=True),
        *(replace(route(pair.cmd_vel, "out", 1), drives=True, due=is_real) for pair in pairs),
        route(DIAGNOSTICS, "out", _ORDER_DEPTH),
        route(STOP, "both", _ORDER_DEPTH),
    )
