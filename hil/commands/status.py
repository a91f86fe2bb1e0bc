"""``abreast status``: all that passes on a lab's wire, in the terminal."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.commands.daemon import DEFAULT_ENDPOINT

if TYPE_CHECKING:
    from rich.table import Table

    from hil.live.lab_state import LabState

_FIRST_LOOK_S = 1.5
_REFRESH_S = 0.25
_CONFIG = click.Path(path_type=Path, dir_okay=False)


@click.command("status")
@click.argument("scenario", default="turtlebot3")
@click.option("--connect", metavar="ENDPOINT", help=f"Router to connect to [{DEFAULT_ENDPOINT}].")
@click.option("--zenoh-config", type=_CONFIG, help="Zenoh config file, in its place.")
@click.option("--once", is_flag=True, help="Look for a moment, print, and end.")
@click.option("--json", "as_json", is_flag=True, help="The same as one JSON object on stdout.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key.")
def command(
    scenario: str,
    connect: str | None,
    zenoh_config: Path | None,
    once: bool,
    as_json: bool,
    overrides: tuple[str, ...],
) -> None:
    """Show daemons, bodies, robots, ages and refusals of the lab of SCENARIO, live."""
    from rich.console import Console
    from rich.live import Live

    from hil.live.lab_state import LabState, hear_for
    from hil.scenario.files import load_scenario
    from hil.wire.key_layout import layout_of
    from hil.wire.pubsub import Wire
    from hil.wire.session import Endpoints, close_session, open_session

    chosen = load_scenario(scenario, overrides)
    state = LabState(chosen)
    endpoints = Endpoints(None if zenoh_config else connect or DEFAULT_ENDPOINT, None, zenoh_config)
    session = open_session(endpoints, patience=3.0)
    wire = Wire(session, layout=layout_of(chosen))
    try:
        wire.subscribe(state.topics, shown=False)
        take, clock = wire.inbox.take, time.monotonic
        hear_for(state, take, clock, clock() + _FIRST_LOOK_S)
        if as_json:
            click.echo(json.dumps(state.as_dict(clock())))
        elif once:
            Console().print(_table(state, clock()))
        else:
            with Live(_table(state, clock()), auto_refresh=False) as shown:
                while True:
                    hear_for(state, take, clock, clock() + _REFRESH_S)
                    shown.update(_table(state, clock()), refresh=True)
    except KeyboardInterrupt:
        pass
    finally:
        wire.close()
        close_session(session)


def _table(state: LabState, now: float) -> Table:
    from rich.table import Table

    from hil.live.lab_state import told_lines

    table = Table(box=None, pad_edge=False)
    for title in ("what", "last, rate", "says"):
        table.add_column(title, overflow="fold")
    for row in told_lines(state, now):
        table.add_row(*row)
    return table
