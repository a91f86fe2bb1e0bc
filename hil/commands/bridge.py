"""``abreast bridge``: motion captures of others, and ROS 2, brought to the wire."""

from __future__ import annotations

from pathlib import Path

import click

from formation.collector import collector_paused
from hil.bridge.up_axis import Up
from hil.commands.daemon import DEFAULT_ENDPOINT
from hil.commands.seconds import DURATION
from hil.scenario.files import load_scenario

_CONFIG = click.Path(path_type=Path, dir_okay=False)


@click.group("bridge")
def command() -> None:
    """Bring what other systems send to the wire."""


@command.command("natnet")
@click.argument("scenario", default="turtlebot3")
@click.option("--server", required=True, metavar="ADDR", help="Where Motive runs: HOST or HOST:PORT [1510].")
@click.option("--multicast", is_flag=True, help="Join the multicast group even if Motive says unicast.")
@click.option("--up", type=click.Choice(["y", "z"]), help="Motive's up axis [the scenario's source.up].")
@click.option("--connect", metavar="ENDPOINT", help=f"Router to connect to [{DEFAULT_ENDPOINT}].")
@click.option("--listen", metavar="ENDPOINT", help="Be the router, at this endpoint.")
@click.option("--zenoh-config", type=_CONFIG, help="Zenoh config file, in place of both.")
@click.option("--duration", type=DURATION, help="End after S seconds.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key.")
@click.option("--tethered", is_flag=True, hidden=True)
def bridge_natnet(
    scenario: str,
    server: str,
    multicast: bool,
    up: Up | None,
    connect: str | None,
    listen: str | None,
    zenoh_config: Path | None,
    duration: float | None,
    overrides: tuple[str, ...],
    tethered: bool,
) -> None:
    """Publish the rigid bodies that OptiTrack's Motive streams, by the names of SCENARIO."""
    with collector_paused():
        from hil.bridge.bridging import run_bridge
        from hil.bridge.datagram_sockets import address_of
        from hil.bridge.mocap_wire import MocapWire
        from hil.bridge.natnet_bridge import NatNetBridge, Server
        from hil.bridge.natnet_packets import COMMAND_PORT
        from hil.live.daemon import Ending
        from hil.wire.session import Endpoints

    ending = Ending()
    ending.on_signals()
    if tethered:
        ending.on_parent_gone()
    chosen = load_scenario(scenario, overrides)
    place = Server(*address_of(server, COMMAND_PORT), multicast)
    wire = MocapWire("bridge/natnet", chosen, up, _say)
    if not (connect or listen or zenoh_config):
        connect = DEFAULT_ENDPOINT
    endpoints = Endpoints(connect, listen, zenoh_config)
    run_bridge(
        lambda _: NatNetBridge(place, wire, _say),
        chosen,
        endpoints,
        ending,
        duration,
        lambda: _say(f"ready, {chosen.name} on {endpoints.describe()}"),
    )


@command.command("ros2")
@click.argument("scenario", default="turtlebot3")
@click.option("--connect", metavar="ENDPOINT", help=f"Router to connect to [{DEFAULT_ENDPOINT}].")
@click.option("--listen", metavar="ENDPOINT", help="Be the router, at this endpoint.")
@click.option("--zenoh-config", type=_CONFIG, help="Zenoh config file, in place of both.")
@click.option("--duration", type=DURATION, help="End after S seconds.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key.")
@click.option("--tethered", is_flag=True, hidden=True)
def bridge_ros2(
    scenario: str,
    connect: str | None,
    listen: str | None,
    zenoh_config: Path | None,
    duration: float | None,
    overrides: tuple[str, ...],
    tethered: bool,
) -> None:
    """Join a ROS 2 network by rclpy: motion capture and odometry of SCENARIO in, commands out."""
    with collector_paused():
        from hil.bridge.bridging import run_bridge
        from hil.bridge.ros_bridge import RosBridge
        from hil.bridge.ros_graph import RosGraph, require_ros
        from hil.bridge.ros_routes import routes_of
        from hil.live.daemon import Ending
        from hil.wire.session import Endpoints

    ending = Ending()
    ending.on_signals()
    if tethered:
        ending.on_parent_gone()
    chosen = load_scenario(scenario, overrides)
    routes, domain = routes_of(chosen), chosen.wire.domain or None
    require_ros(routes)
    if not (connect or listen or zenoh_config):
        connect = DEFAULT_ENDPOINT
    endpoints = Endpoints(connect, listen, zenoh_config)
    run_bridge(
        lambda wire: RosBridge(wire, routes, lambda hear: RosGraph("abreast", domain, routes, hear), _say),
        chosen,
        endpoints,
        ending,
        duration,
        lambda: _say(f"ready, {chosen.name} on {endpoints.describe()}"),
    )


def _say(line: str) -> None:
    click.echo(f"abreast bridge: {line}", err=True)
