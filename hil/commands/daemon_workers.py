"""What each daemon is made of, loaded when it is wanted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hil.commands.natnet_options import NatNetOptions, served
from hil.commands.own_parts import remarks_on
from hil.errors import UsageError
from hil.log.report_json import note
from hil.scenario.links import Link
from hil.scenario.schema import Scenario

if TYPE_CHECKING:
    from hil.live.daemon import Ending, Worker
    from hil.live.listener_watch import ListenerWatch
    from hil.live.node_worker import Parting
    from hil.nodes.node import Node
    from hil.wire.pubsub import Wire


@dataclass(frozen=True, slots=True)
class Order:
    """What a daemon is started for.

    ``links``: the followers that it serves, if it serves any. ``out``: the recorder's log.
    ``needs``: the daemons that emulator, leader or who serves followers wait for. ``natnet``: how the
    emulator serves its frames by NatNet. ``countdown_s``: from when all are well to when the leader sets off;
    ``by_hand``: somebody else drives it.
    ``by_keys``: these leave orders to operators and guards.
    """

    scenario: Scenario
    links: tuple[Link, ...]
    out: Path | None
    needs: frozenset[str]
    natnet: NatNetOptions
    countdown_s: float = 0.0
    by_hand: bool = False
    by_keys: bool = False


def _leader(order: Order) -> Worker:
    from hil.live.node_worker import NodeWorker, Parting
    from hil.nodes.leader_driver import LeaderDriver
    from hil.nodes.leader_watch import LeaderWatch
    from hil.nodes.link_nodes import leader_standstill

    if order.by_hand:
        return NodeWorker([LeaderWatch(order.scenario, order.needs)], on_report=on_report())
    driver = LeaderDriver(order.scenario, order.needs, order.countdown_s)
    parting = Parting(
        "the leader ended",
        lambda now_ns: [leader_standstill(order.scenario, now_ns)],
        stop_all=not order.by_keys,
    )
    return NodeWorker([driver], parting=parting, on_report=on_report())


def _emulator(order: Order) -> Worker:
    from hil.emulator.foreign_mocap import ForeignMocapNode
    from hil.emulator.node import EmulatorNode
    from hil.live.node_worker import NodeWorker
    from hil.wire import topics
    from hil.wire.source_topics import converts

    if order.scenario.source.emulated:
        return _beside_real(order)
    node = EmulatorNode(order.scenario, order.needs)
    if order.natnet.natnet:
        from hil.bridge.natnet_emulator import NatNetEmulator

        emulator = NatNetEmulator(node, order.natnet.serving(), on_report=on_report())
        note(f"abreast emulator: serves {served(emulator, order.natnet.natnet_address)}")
        return emulator
    if not converts(order.scenario):
        return NodeWorker([node], on_report=on_report())
    frames = (topics.RIGID_BODIES,)
    foreign = ForeignMocapNode(order.scenario)
    return NodeWorker([node, foreign], within=frames, on_report=on_report(), unspoken=frames)


def _beside_real(order: Order) -> Worker:
    from hil.emulator.beside_real import LAB_FRAMES, BesideReal
    from hil.live.node_worker import NodeWorker
    from hil.nodes.source import SourceNode

    source, robot = SourceNode(order.scenario, LAB_FRAMES), BesideReal(order.scenario, order.needs)
    nodes: list[Node[Any]] = [source, robot]
    return NodeWorker(nodes, within=(LAB_FRAMES,), on_report=on_report(), unspoken=(LAB_FRAMES,))


def serve_alone(order: Order, ending: Ending, duration_s: float | None) -> None:
    """Run the emulator without a wire: the leader drives its program, the followers stand."""
    from hil.bridge.natnet_emulator import NatNetEmulator, run_alone
    from hil.emulator.node import EmulatorNode

    emulator = NatNetEmulator(EmulatorNode(order.scenario), order.natnet.serving(), alone=True)
    line = f"abreast emulator: ready, serves {served(emulator, order.natnet.natnet_address)}"
    run_alone(emulator, ending, duration_s, lambda: note(line))


def _estimator(order: Order) -> Worker:
    from hil.live.node_worker import NodeWorker
    from hil.nodes.link_nodes import estimator_node, frames_within, source_nodes

    source = source_nodes(order.links, order.scenario)
    return NodeWorker(
        [*source, *map(estimator_node, order.links)],
        within=frames_within(source),
        on_report=on_report(),
    )


def _controller(order: Order) -> Worker:
    from hil.live.node_worker import NodeWorker
    from hil.nodes.link_nodes import controller_node

    controllers = [controller_node(link) for link in order.links]
    return NodeWorker(
        controllers,
        parting=_parting("controller", order),
        after_tick=remarks_on({node.law for node in controllers}),
        on_report=on_report(),
    )


def _follower(order: Order) -> Worker:
    from hil.live.node_worker import NodeWorker
    from hil.nodes.link_nodes import controller_node, estimator_node, frames_within, source_nodes

    controllers = [controller_node(link) for link in order.links]
    source = source_nodes(order.links, order.scenario)
    return NodeWorker(
        [*source, *map(estimator_node, order.links), *controllers],
        within=[*frames_within(source), *(node.topics.estimate for node in controllers)],
        parting=_parting("follower", order),
        after_tick=remarks_on({node.law for node in controllers}),
        on_report=on_report(),
    )


def on_report() -> Callable[[bytes], None]:
    """What says on stderr what nodes find and wait for, once when it begins and once when it ends."""
    from hil.live.finding_lines import FindingLines, ProblemLines

    findings, problems = FindingLines(note), ProblemLines(note)

    def hear(payload: bytes) -> None:
        findings.hear(payload)
        problems.hear(payload)

    return hear


def watch_of(name: str, order: Order) -> Callable[[Wire], ListenerWatch] | None:
    """What watches who listens to the robots that a daemon drives, if it drives any."""
    from hil.live.listener_watch import Commanded, ListenerWatch
    from hil.wire.key_layout import layout_of
    from hil.wire.topics import link_topics

    named = [(link.node_name("listeners"), link_topics(link)) for link in order.links]
    robots = [Commanded(node, each.cmd_vel, each.odom, each.wanted) for node, each in named]
    if name == "leader" and not order.by_hand:
        first = named[0][1]
        told = first.leader_cmd_vel, first.leader_odom, first.leader_wanted
        robots = [Commanded("leader_listeners", *told)]
    elif name not in ("follower", "controller"):
        return None
    return lambda wire: ListenerWatch(wire, layout_of(order.scenario), robots, on_report())


def overheard(name: str, order: Order) -> frozenset[str]:
    """Commands to followers that a daemon hears for the start alone, which are meant for their robots."""
    from hil.wire.topics import link_topics

    if name == "leader" or (name == "emulator" and order.scenario.source.emulated == "leader"):
        return frozenset(link_topics(link).wanted for link in order.links)
    return frozenset()


def _parting(name: str, order: Order) -> Parting:
    from hil.live.node_worker import Parting
    from hil.nodes.link_nodes import standstill

    return Parting(
        f"the {name} ended",
        lambda now_ns: [standstill(link, now_ns) for link in order.links],
        stop_all=not order.by_keys,
    )


def _recorder(order: Order) -> Worker:
    from hil.live.recorder import Recorder

    if order.out is None:
        raise UsageError("abreast recorder: give the log to write with --out")
    return Recorder(order.scenario, order.out)


WORKERS: dict[str, Callable[[Order], Worker]] = {
    "emulator": _emulator,
    "leader": _leader,
    "follower": _follower,
    "estimator": _estimator,
    "controller": _controller,
    "recorder": _recorder,
}
"""What a daemon does, by its name; made once its wire is there."""
