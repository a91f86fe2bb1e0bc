"""The nodes of one follower, in a pair or in a chain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from formation.pose import STANDSTILL
from hil.nodes.controller import ControllerNode
from hil.nodes.node import Outgoing, outgoing
from hil.nodes.source import SourceNode
from hil.scenario.links import Link, links_of
from hil.scenario.schema import Scenario
from hil.wire.drive_message import drive_message
from hil.wire.source_topics import converts
from hil.wire.topics import RIGID_BODIES, link_topics

if TYPE_CHECKING:
    from hil.nodes.estimator import EstimatorNode


def estimator_node(link: Link) -> EstimatorNode:
    """Estimator of a follower; it looks at its predecessor and at itself, and at nobody else."""
    # Brings compiled code along: a second of imports that a controller has no use for.
    from hil.nodes.estimator import EstimatorNode

    return EstimatorNode(link.scenario, link.node_name("estimator"), link.other_bodies)


def controller_node(link: Link) -> ControllerNode:
    """Controller of a follower; only that of a pair takes orders to change sides."""
    return ControllerNode(link.scenario, link.node_name("controller"), may_change=not link.in_chain)


def source_nodes(links: Sequence[Link], scenario: Scenario) -> list[SourceNode]:
    """What makes frames of a lab's own messages, where these links have the first and frames are to be made.

    One process does it for all, so that all followers of a chain are given the same frames. Where one robot
    is emulated the emulator does.
    """
    makes = converts(scenario) and not scenario.source.emulated
    return [SourceNode(scenario)] if makes and any(link.first for link in links) else []


def frames_within(source: Sequence[SourceNode]) -> tuple[str, ...]:
    """Topics on which such a node speaks to estimators in its own process."""
    return (RIGID_BODIES,) if source else ()


def standstill(link: Link, now_ns: int) -> Outgoing:
    """What makes a follower's robot stand, without its controller."""
    pair = link_topics(link)
    still = drive_message(STANDSTILL, now_ns, pair.follower, stamped=pair.stamped)
    return outgoing(pair.cmd_vel, still, now_ns)


def leader_standstill(scenario: Scenario, now_ns: int) -> Outgoing:
    """What makes the first robot stand, without its driver."""
    pair = link_topics(links_of(scenario)[0])
    still = drive_message(STANDSTILL, now_ns, pair.leader, stamped=pair.stamped)
    return outgoing(pair.leader_cmd_vel, still, now_ns)
