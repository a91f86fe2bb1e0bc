"""A whole run in lockstep: emulator, estimators and controllers on a simulated clock, into a log."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from hil.emulator.node import EmulatorNode, EmulatorState
from hil.errors import CheckFailedError
from hil.lockstep.lockstep import EPOCH_NS, Lockstep
from hil.log.described_log import DescribedLog
from hil.log.metadata import certificate_metadata, log_metadata
from hil.nodes.link_nodes import controller_node, estimator_node
from hil.nodes.node import Node, Outgoing, outgoing
from hil.scenario.certificate import certificate_json, certificate_of
from hil.scenario.guarded import with_guards
from hil.scenario.links import links_of
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.message_types import String
from hil.wire.messages import prepare

START_TIMEOUT_NS = 10_000_000_000
STOPPING_NS = 600_000_000
"""Time given to the robots to come to rest after the stop, so that the log shows that they did."""

_LOOK_NS = 200_000_000

GoOn = Callable[[float], bool]


def _to_the_end(_driven_s: float) -> bool:
    return True


def make_nodes(scenario: Scenario) -> list[Node[Any]]:
    """The nodes of a run; making them loads and compiles all that they need."""
    prepare(topics.types_of(scenario).values())
    links = links_of(scenario)
    return [EmulatorNode(scenario), *map(estimator_node, links), *map(controller_node, links)]


class Prepared(NamedTuple):
    """A run that can begin: its nodes, and what its log says first."""

    nodes: list[Node[Any]]
    metadata: dict[str, dict[str, str]]


def prepared(scenario: Scenario) -> Prepared:
    """All that a run needs before it begins; making it loads and compiles whatever there is to."""
    # Nobody fails here, and nobody is a stranger.
    scenario = with_guards(scenario, present=False)
    certificate = certificate_metadata(certificate_json(certificate_of(scenario)))
    return Prepared(make_nodes(scenario), log_metadata(scenario, "lockstep") | certificate)


def run_lockstep(
    scenario: Scenario, log_path: Path, ready: Prepared | None = None, go_on: GoOn = _to_the_end
) -> float:
    """Run a scenario from the start barrier to standstill, write everything to ``log_path``; seconds driven.

    ``ready``: if it has been prepared before. ``go_on``: called now and then with the seconds that were
    driven; the robots are stopped where it says no. Raises :class:`CheckFailedError` if the leader never
    sets off.
    """
    nodes, metadata = ready or prepared(scenario)
    with DescribedLog(log_path, metadata) as log:

        def record(message: Outgoing, now_ns: int) -> None:
            log.write(message.topic, message.typename, message.payload, now_ns, now_ns)

        lockstep = Lockstep(nodes, record)
        since_ns = _wait_for_motion(lockstep)
        end_ns = since_ns + round(scenario.run.duration_s * 1e9)
        while lockstep.now_ns < end_ns and go_on((lockstep.now_ns - since_ns) * 1e-9):
            lockstep.run_until(min(end_ns, lockstep.now_ns + _LOOK_NS))
        driven_ns = lockstep.now_ns - since_ns
        reason = "end of run" if lockstep.now_ns == end_ns else "interrupted"
        lockstep.publish(outgoing(topics.STOP, String(data=reason), lockstep.now_ns))
        lockstep.run_until(lockstep.now_ns + STOPPING_NS)
        lockstep.farewell()
    return driven_ns * 1e-9


def timed_lockstep(
    scenario: Scenario, log_path: Path, ready: Prepared | None = None, go_on: GoOn = _to_the_end
) -> dict[str, float]:
    """The same, and how long it took without what there is to load: the part ``lockstep`` of the JSON."""
    ready = ready or prepared(scenario)
    begun = time.perf_counter()
    driven_s = run_lockstep(scenario, log_path, ready, go_on)
    took = time.perf_counter() - begun
    return {"wall_s": took, "times_real_time": driven_s / took}


def _wait_for_motion(lockstep: Lockstep) -> int:
    while lockstep.now_ns < EPOCH_NS + START_TIMEOUT_NS:
        lockstep.run_until(lockstep.now_ns + 10_000_000)
        state = lockstep.state_of("emulator")
        if isinstance(state, EmulatorState) and state.motion_since_ns is not None:
            return state.motion_since_ns
    raise CheckFailedError(
        f"the start barrier did not open within {START_TIMEOUT_NS * 1e-9:g} s of simulated time; "
        "a follower gets no frames or no odometry: check mocap.loss, mocap.latency_s and the rates"
    )
