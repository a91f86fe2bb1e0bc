"""``abreast status``: all that passes on a lab's wire, in the terminal."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.commands.wire_options import wire_options
from hil.errors import CheckFailedError, UsageError
from hil.log.report_json import print_with_nulls, result_console

if TYPE_CHECKING:
    from rich.table import Table

    from hil.live.lab_state import LabState

_FIRST_LOOK_S = 1.5
_REFRESH_S = 0.25


@click.command("status", params=wire_options(listens=False))
@click.argument("scenario", default="turtlebot3")
@click.option("--once", is_flag=True, help="Look for a moment, print, and end.")
@click.option(
    "--needs",
    metavar="NODES",
    help="With --once: end with 1 unless these nodes, by commas, are heard and well.",
)
@click.option("--json", "as_json", is_flag=True, help="The same as one JSON object on stdout.")
def command(
    scenario: str,
    connect: str | None,
    secure: Path | None,
    zenoh_config: Path | None,
    once: bool,
    needs: str | None,
    as_json: bool,
    overrides: tuple[str, ...],
) -> None:
    """Show daemons, bodies, robots, ages and refusals of the lab of SCENARIO, live.

    Without --connect, where nobody is at the usual endpoint, it shows the one run of yours on this machine.
    """
    from rich.live import Live

    from hil.commands.found_runs import lab_or_run
    from hil.live.lab_state import LabState, hear_for
    from hil.scenario.files import load_scenario
    from hil.wire.pubsub import joined

    if needs is not None and not (once or as_json):
        raise UsageError(f"--needs {needs}: is for one look; give --once or --json with it")
    wanted = [name.strip() for name in needs.split(",")] if needs is not None else []
    if not all(wanted):
        raise UsageError(f"--needs {needs!r}: expected names of nodes, by commas")
    lab = lab_or_run(connect, zenoh_config, secure, "viewer", scenario)
    chosen = load_scenario(lab.scenario, overrides)
    state = LabState(chosen)
    clock = time.monotonic
    with joined(lab.endpoints, chosen, patience=3.0) as wire:
        wire.subscribe(state.topics, shown=False)
        take = wire.inbox.take
        hear_for(state, take, clock, clock() + _FIRST_LOOK_S)
        console = result_console()
        # What cannot be drawn anew, as a file cannot, takes one look.
        once = once or not console.is_terminal or console.is_dumb_terminal
        if as_json:
            print_with_nulls(state.as_dict(clock()))
        elif once:
            console.print(_table(state, clock()))
        if once or as_json:
            if unwell := state.unwell(wanted, clock()):
                raise CheckFailedError("; ".join(unwell))
            return
        with (
            suppress(KeyboardInterrupt),
            Live(_table(state, clock()), console=console, auto_refresh=False) as shown,
        ):
            while True:
                hear_for(state, take, clock, clock() + _REFRESH_S)
                shown.update(_table(state, clock()), refresh=True)


def _table(state: LabState, now: float) -> Table:
    from rich.table import Table
    from rich.text import Text

    from hil.live.lab_state import told_lines

    table = Table(box=None, pad_edge=False)
    for title in ("what", "last, rate", "says"):
        table.add_column(title, overflow="fold")
    for row in told_lines(state, now):
        # What is on the wire may look like markup.
        table.add_row(*map(Text, row))
    return table
