"""``abreast stop``: stop all robots of a lab, and see that they are told so."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from hil.commands.wire_options import endpoints_of, wire_options
from hil.log.report_json import note, say


@click.command("stop", params=wire_options(listens=False))
@click.argument("reason", default="stopped by hand")
@click.option("--scenario", default="turtlebot3", show_default=True, help="Whose robots: a name or a file.")
def command(
    reason: str,
    scenario: str,
    connect: str | None,
    secure: Path | None,
    zenoh_config: Path | None,
    overrides: tuple[str, ...],
) -> None:
    """Stop everybody for REASON: controllers by a stop message, and robots by a command to stand.

    Ends with 0 once all robots are told to stand, are heard of, and nobody tells one otherwise, else with 1.
    """
    from hil.live.stopping import stop_all
    from hil.scenario.files import load_scenario
    from hil.wire.pubsub import joined

    chosen = load_scenario(scenario, overrides)
    endpoints = endpoints_of(connect, None, zenoh_config, secure, "operator")
    with joined(endpoints, chosen, "stop", patience=3.0) as wire:
        stopped = stop_all(wire, chosen, reason)
    if not stopped.done:
        other = "; are these not your robots, give --scenario FILE of your lab, and see that its bridge runs"
        note(f"abreast stop: {stopped.line()}{other if stopped.unheard else ''}")
        sys.exit(1)
    say(stopped.line())
