"""``abreast bridge``: motion captures of others, and ROS 2, brought to the wire; the wire to Foxglove."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict, Unpack

import click

from formation.collector import collector_paused
from hil.bridge.seen_frame import Up
from hil.commands.command_group import CommandGroup
from hil.commands.seconds import DURATION
from hil.commands.whole_numbers import Whole
from hil.commands.wire_options import endpoints_of, wire_options
from hil.log.report_json import note
from hil.scenario.files import load_scenario
from hil.scenario.schema import Scenario

if TYPE_CHECKING:
    from hil.bridge.bridging import Bridge
    from hil.wire.pubsub import Wire

_KINDS = ("vicon", "qualisys", "vrpn", "optitrack")


class _Given(TypedDict):
    """Values of the options that all bridges have."""

    scenario: str
    connect: str | None
    listen: str | None
    secure: Path | None
    zenoh_config: Path | None
    duration: float | None
    overrides: tuple[str, ...]
    tethered: bool


@click.group("bridge", cls=CommandGroup)
def command() -> None:
    """Bring what other systems send to the wire, or the wire to viewers."""


def _options() -> list[click.Parameter]:
    """What all bridges are told."""
    return [
        click.Argument(["scenario"], default="turtlebot3"),
        *wire_options(),
        click.Option(["--duration"], type=DURATION, help="End after S seconds."),
        click.Option(["--tethered"], is_flag=True, hidden=True),
    ]


@command.command("natnet", params=_options())
@click.option("--server", required=True, metavar="ADDR", help="Where Motive runs: HOST or HOST:PORT [1510].")
@click.option("--multicast", is_flag=True, help="Join the multicast group even if Motive says unicast.")
@click.option("--up", type=click.Choice(["y", "z"]), help="Motive's up axis [the scenario's source.up].")
def bridge_natnet(server: str, multicast: bool, up: Up | None, **given: Unpack[_Given]) -> None:
    """Publish the rigid bodies that OptiTrack's Motive streams, by the names of SCENARIO."""
    with collector_paused():
        from hil.bridge.datagram_sockets import address_of
        from hil.bridge.mocap_wire import MocapWire
        from hil.bridge.natnet_bridge import NatNetBridge, Server
        from hil.bridge.natnet_packets import COMMAND_PORT

    chosen = load_scenario(given["scenario"], given["overrides"])
    place = Server(*address_of(server, COMMAND_PORT), multicast)
    wire = MocapWire("bridge/natnet", chosen, up, _say)
    _run(lambda _: NatNetBridge(place, wire, _say), chosen, given)


@command.command("mocap", params=_options())
@click.option("--type", "kind", required=True, type=click.Choice(_KINDS), help="Which one it is.")
@click.option("--server", required=True, metavar="ADDR", help="Where it runs: HOST or HOST:PORT.")
@click.option("--up", type=click.Choice(["y", "z"]), help="Its up axis [the scenario's source.up].")
def bridge_mocap(kind: str, server: str, up: Up | None, **given: Unpack[_Given]) -> None:
    """Publish the bodies of a motion capture through the library motioncapture, by the names of SCENARIO."""
    with collector_paused():
        from hil.bridge.mocap_wire import MocapWire
        from hil.bridge.motioncapture_bridge import MotionCaptureBridge, connector

    chosen = load_scenario(given["scenario"], given["overrides"])
    host, _, port = server.partition(":")
    source, wire = connector(kind, host, port), MocapWire("bridge/mocap", chosen, up, _say)
    _run(lambda _: MotionCaptureBridge(source, f"{kind} {server}", wire), chosen, given)


@command.command("ros2", params=_options())
def bridge_ros2(**given: Unpack[_Given]) -> None:
    """Join a ROS 2 network by rclpy: motion capture and odometry of SCENARIO in, commands out."""
    with collector_paused():
        from hil.bridge.ros_bridge import RosBridge
        from hil.bridge.ros_graph import RosGraph, carried
        from hil.bridge.ros_routes import routes_of

    chosen = load_scenario(given["scenario"], given["overrides"])
    routes, domain = carried(routes_of(chosen), _say), chosen.wire.domain or None
    _run(
        lambda wire: RosBridge(wire, routes, lambda hear: RosGraph("abreast", domain, routes, hear), _say),
        chosen,
        given,
        "bridge",
    )


@command.command("foxglove", params=_options())
@click.option("--port", type=Whole(0, 65535), default=8765, show_default=True, help="0: any free.")
@click.option("--address", default="127.0.0.1", show_default=True, help="Others than loopback let all look.")
def bridge_foxglove(port: int, address: str, **given: Unpack[_Given]) -> None:
    """Serve what passes in the lab of SCENARIO to Foxglove or Lichtblick: topics, transforms, a 3D scene.

    Whoever connects may look, and nothing else. docs/foxglove.md has the layout.
    """
    with collector_paused():
        from hil.bridge.foxglove_bridge import FoxgloveBridge

    chosen = load_scenario(given["scenario"], given["overrides"])

    def serve(wire: Wire) -> Bridge:
        bridge = FoxgloveBridge(wire, chosen, address, port)
        _say(f"Foxglove finds it at {bridge.url}; layouts: abreast export --layouts DIR")
        return bridge

    _run(serve, chosen, given, "viewer")


def _run(
    make_bridge: Callable[[Wire], Bridge], scenario: Scenario, given: _Given, role: str = "mocap"
) -> None:
    """Run a bridge until it is told to end."""
    with collector_paused():
        from hil.bridge.bridging import run_bridge
        from hil.live.daemon import Ending

    ending = Ending()
    ending.on_signals()
    if given["tethered"]:
        ending.on_parent_gone()
    endpoints = endpoints_of(given["connect"], given["listen"], given["zenoh_config"], given["secure"], role)

    def say_ready() -> None:
        _say(f"ready, {scenario.name} on {endpoints.describe()}")

    run_bridge(make_bridge, scenario, endpoints, ending, given["duration"], say_ready)


def _say(line: str) -> None:
    note(f"abreast bridge: {line}")
