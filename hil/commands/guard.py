"""``abreast guard``: the guard of one robot, between the wire and its driver."""

from __future__ import annotations

import math
from pathlib import Path

import click

from hil.commands.seconds import DURATION
from hil.commands.wire_options import endpoints_of, wire_options
from hil.log.report_json import say


@click.command("guard", params=wire_options())
@click.argument("scenario")
@click.option("--robot", required=True, metavar="NAME", help="The robot, by its name in SCENARIO.")
@click.option("--ros", is_flag=True, help="Reach the driver by rclpy, without a bridge.")
@click.option(
    "--write",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Write what abreast-guard needs on the robot, and end.",
)
@click.option("--duration", type=DURATION, help="End after S seconds.")
def command(
    scenario: str,
    robot: str,
    ros: bool,
    write: Path | None,
    connect: str | None,
    listen: str | None,
    secure: Path | None,
    zenoh_config: Path | None,
    duration: float | None,
    overrides: tuple[str, ...],
) -> None:
    """Guard a robot of SCENARIO: what is not fresh, of one sender and within limits does not drive it.

    It reads what is wanted of the robot and alone tells its driver. To be run on the robot; with --listen the
    robot's bridge connects to it, and is reached also when the link to the lab is cut.
    """
    from hil.errors import UsageError
    from hil.guard.order_of import guard_order
    from hil.guard.serving import serve
    from hil.scenario.files import load_scenario

    order = guard_order(load_scenario(scenario, overrides), robot)
    if write is not None:
        try:
            write.write_text(order.as_text(), encoding="utf-8")
        except OSError as error:
            raise UsageError(f"--write {write}: {error.strerror or error}; give another file") from None
        say(f"wrote {write}; on {robot}: abreast-guard {write.name}")
        return
    endpoints = endpoints_of(connect, listen, zenoh_config, secure, "guard")
    serve(order, endpoints, ros=ros, duration_s=duration or math.inf)
