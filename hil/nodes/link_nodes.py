"""The nodes of one follower, in a pair or in a chain."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.nodes.controller import ControllerNode
from hil.scenario.links import Link

if TYPE_CHECKING:
    from hil.nodes.estimator import EstimatorNode


def estimator_node(link: Link) -> EstimatorNode:
    """Estimator of a follower; it looks at its predecessor and at itself, and at nobody else."""
    # Brings compiled code along: a second of imports that a controller has no use for.
    from hil.nodes.estimator import EstimatorNode

    return EstimatorNode(link.scenario, link.node_name("estimator"), link.others)


def controller_node(link: Link) -> ControllerNode:
    """Controller of a follower; only that of a pair takes orders to change sides."""
    return ControllerNode(link.scenario, link.node_name("controller"), may_change=not link.in_chain)
