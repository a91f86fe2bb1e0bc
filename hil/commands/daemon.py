"""``abreast emulator``, ``follower``, ``estimator`` and so on: one daemon each, in the foreground."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from formation.collector import collector_paused
from hil.commands.natnet_options import NatNetOptions, natnet_options, served
from hil.commands.own_parts import load_own_parts, remarks_on
from hil.commands.seconds import DURATION, Seconds
from hil.errors import UsageError
from hil.scenario.certify import CERTIFY
from hil.scenario.files import load_scenario
from hil.scenario.links import HOSTED, Link, link_of, links_of
from hil.scenario.schema import Scenario

if TYPE_CHECKING:
    from hil.live.daemon import Ending, Worker
    from hil.live.listener_watch import ListenerWatch
    from hil.live.node_worker import Parting
    from hil.nodes.node import Node
    from hil.wire.pubsub import Wire

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"


@dataclass(frozen=True, slots=True)
class Order:
    """What a daemon is started for.

    ``links``: the followers that it serves, if it serves any. ``out``: the recorder's log.
    ``needs``: the daemons that emulator or leader wait for. ``natnet``: how the emulator serves its frames by
    NatNet. ``countdown_s``: from then on to when the leader sets off; ``by_hand``: somebody else drives it.
    """

    scenario: Scenario
    links: tuple[Link, ...]
    out: Path | None
    needs: frozenset[str]
    natnet: NatNetOptions
    countdown_s: float = 0.0
    by_hand: bool = False


def daemon_command(name: str, summary: str) -> click.Command:
    """The command of one daemon."""

    def callback(
        scenario: str,
        connect: str | None,
        listen: str | None,
        zenoh_config: Path | None,
        duration: float | None,
        overrides: tuple[str, ...],
        out: Path | None = None,
        needs: str = "estimator,controller",
        followers: tuple[str, ...] = (),
        tethered: bool = False,
        certify: bool = False,
        countdown: float = 0.0,
        by_hand: bool = False,
        **natnet: Any,
    ) -> None:
        # Wire and messages take a third of a second to load, which help needs not.
        with collector_paused():
            from hil.live.daemon import Ending, Presence, run_daemon
            from hil.wire.messages import prepare
            from hil.wire.session import Endpoints
            from hil.wire.topics import types_of

        ending = Ending()
        ending.on_signals()
        if tethered:
            ending.on_parent_gone()
        options = NatNetOptions(**natnet)
        alone = options.natnet and not (connect or listen or zenoh_config)
        if not (connect or listen or zenoh_config):
            connect = DEFAULT_ENDPOINT
        chosen = load_scenario(scenario, (*overrides, CERTIFY) if certify else overrides)
        if name in HOSTED:
            load_own_parts(chosen, estimates=name != "controller")
        needed = frozenset(filter(None, needs.split(",")))
        links = tuple(link_of(chosen, name) for name in dict.fromkeys(followers)) or links_of(chosen)
        order = Order(chosen, links, out, needed, options, countdown, by_hand)
        if alone:
            _serve_alone(order, ending, duration)
            return
        endpoints = Endpoints(connect, listen, zenoh_config)

        def say_ready() -> None:
            whom = f" for {', '.join(followers)}" if followers else ""
            click.echo(f"abreast {name}: ready{whom}, {chosen.name} on {endpoints.describe()}", err=True)

        prepare(types_of(chosen).values())
        dropped = run_daemon(
            collector_paused()(lambda: _WORKERS[name](order)),
            chosen,
            endpoints,
            ending,
            duration,
            say_ready,
            Presence(name, _watch_of(order) if name in ("follower", "controller") else None),
        )
        if dropped:
            click.echo(f"abreast {name}: {dropped} messages came too fast and were dropped", err=True)

    path = click.Path(path_type=Path, dir_okay=False)
    options: list[click.Parameter] = [
        click.Argument(["scenario"]),
        click.Option(["--connect"], metavar="ENDPOINT", help=f"Router to connect to [{DEFAULT_ENDPOINT}]."),
        click.Option(["--listen"], metavar="ENDPOINT", help="Be the router, at this endpoint."),
        click.Option(["--zenoh-config"], type=path, help="Zenoh config file, in place of both."),
        click.Option(["--duration"], type=DURATION, help="End after S seconds."),
        click.Option(["--set", "overrides"], multiple=True, metavar="KEY=VALUE", help="Override a key."),
        click.Option(["--tethered"], is_flag=True, hidden=True),
    ]
    if name == "recorder":
        options.append(click.Option(["--out"], type=path, required=True, help="Log to write (.mcap)."))
    if name in HOSTED:
        whom = "A follower of a chain to serve, by its name; may be given again. Without it all."
        options.append(click.Option(["--follower", "followers"], multiple=True, metavar="NAME", help=whom))
    if name in ("follower", "estimator"):
        what = "Publish a guaranteed error radius of every estimate."
        options.append(click.Option(["--certify"], is_flag=True, help=what))
    if name == "leader":
        options += _leader_options()
    if name in ("emulator", "leader"):
        needs = "Daemons that must be well before the leader sets off, by commas."
        options.append(
            click.Option(["--needs"], default="estimator,controller", show_default=True, help=needs)
        )
    if name == "emulator":
        options += natnet_options()
    return click.Command(name, callback=callback, params=options, help=f"Run {summary}.")


def _leader_options() -> list[click.Parameter]:
    from hil.nodes.leader_driver import COUNTDOWN_S

    count = "Seconds from when all are well to when the leader sets off."
    hand = "Drive nobody: tell only when the leader sets off, whoever drives it."
    return [
        click.Option(["--countdown"], type=Seconds(0.0), default=COUNTDOWN_S, show_default=True, help=count),
        click.Option(["--by-hand"], is_flag=True, help=hand),
    ]


def _leader(order: Order) -> Worker:
    from hil.live.node_worker import NodeWorker, Parting
    from hil.nodes.leader_driver import LeaderDriver
    from hil.nodes.leader_watch import LeaderWatch
    from hil.nodes.link_nodes import leader_standstill

    if order.by_hand:
        return NodeWorker([LeaderWatch(order.scenario, order.needs)], on_report=_on_report())
    driver = LeaderDriver(order.scenario, order.needs, order.countdown_s)
    parting = Parting("the leader ended", lambda now_ns: [leader_standstill(order.scenario, now_ns)])
    return NodeWorker([driver], parting=parting, on_report=_on_report())


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

        emulator = NatNetEmulator(node, order.natnet.serving(), on_report=_on_report())
        click.echo(f"abreast emulator: serves {served(emulator, order.natnet.natnet_address)}", err=True)
        return emulator
    if not converts(order.scenario):
        return NodeWorker([node], on_report=_on_report())
    frames = (topics.RIGID_BODIES,)
    foreign = ForeignMocapNode(order.scenario)
    return NodeWorker([node, foreign], within=frames, on_report=_on_report(), unspoken=frames)


def _beside_real(order: Order) -> Worker:
    from hil.emulator.beside_real import LAB_FRAMES, BesideReal
    from hil.live.node_worker import NodeWorker
    from hil.nodes.source import SourceNode

    source, robot = SourceNode(order.scenario, LAB_FRAMES), BesideReal(order.scenario, order.needs)
    nodes: list[Node[Any]] = [source, robot]
    return NodeWorker(nodes, within=(LAB_FRAMES,), on_report=_on_report(), unspoken=(LAB_FRAMES,))


def _serve_alone(order: Order, ending: Ending, duration_s: float | None) -> None:
    """Run the emulator without a wire: the leader drives its program, the followers stand."""
    from hil.bridge.natnet_emulator import NatNetEmulator, run_alone
    from hil.emulator.node import EmulatorNode

    emulator = NatNetEmulator(EmulatorNode(order.scenario), order.natnet.serving(), alone=True)
    line = f"abreast emulator: ready, serves {served(emulator, order.natnet.natnet_address)}"
    run_alone(emulator, ending, duration_s, lambda: click.echo(line, err=True))


def _estimator(order: Order) -> Worker:
    from hil.live.node_worker import NodeWorker
    from hil.nodes.link_nodes import estimator_node, frames_within, source_nodes

    source = source_nodes(order.links, order.scenario)
    return NodeWorker(
        [*source, *map(estimator_node, order.links)],
        within=frames_within(source),
        on_report=_on_report(),
    )


def _controller(order: Order) -> Worker:
    from hil.live.node_worker import NodeWorker
    from hil.nodes.link_nodes import controller_node

    controllers = [controller_node(link) for link in order.links]
    return NodeWorker(
        controllers,
        parting=_parting("controller", order),
        after_tick=remarks_on({node.law for node in controllers}),
        on_report=_on_report(),
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
        on_report=_on_report(),
    )


def _on_report() -> Callable[[bytes], None]:
    """What says on stderr what nodes find and wait for, once when it begins and once when it ends."""
    from hil.live.finding_lines import FindingLines, ProblemLines

    def say(line: str) -> None:
        click.echo(line, err=True)

    findings, problems = FindingLines(say), ProblemLines(say)

    def hear(payload: bytes) -> None:
        findings.hear(payload)
        problems.hear(payload)

    return hear


def _watch_of(order: Order) -> Callable[[Wire], ListenerWatch]:
    """What watches who listens to the robots that are driven."""
    from hil.live.listener_watch import Commanded, ListenerWatch
    from hil.wire.key_layout import layout_of
    from hil.wire.topics import link_topics

    named = [(link.node_name("listeners"), link_topics(link)) for link in order.links]
    robots = [Commanded(node, each.cmd_vel, each.odom) for node, each in named]
    return lambda wire: ListenerWatch(wire, layout_of(order.scenario), robots, _on_report())


def _parting(name: str, order: Order) -> Parting:
    from hil.live.node_worker import Parting
    from hil.nodes.link_nodes import standstill

    return Parting(f"the {name} ended", lambda now_ns: [standstill(link, now_ns) for link in order.links])


def _recorder(order: Order) -> Worker:
    from hil.live.recorder import Recorder

    if order.out is None:
        raise UsageError("abreast recorder: give the log to write with --out")
    return Recorder(order.scenario, order.out)


_WORKERS: dict[str, Callable[[Order], Worker]] = {
    "emulator": _emulator,
    "leader": _leader,
    "follower": _follower,
    "estimator": _estimator,
    "controller": _controller,
    "recorder": _recorder,
}
