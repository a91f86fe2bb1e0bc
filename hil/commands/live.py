"""``abreast live``: a page in the browser that shows a lab while it drives, and stops it."""

from __future__ import annotations

import asyncio
import socket
from pathlib import Path

import click

from hil.commands.page_options import page_options
from hil.commands.wire_options import wire_options
from hil.log.report_json import note

_NICENESS = 5
"""Of the page beside a run: it shows a lab, and whoever drives in it goes first."""


@click.command("live", params=[*page_options(), *wire_options(listens=False)])
@click.argument("scenario", default="turtlebot3")
@click.option("--listening", type=int, hidden=True)
@click.option("--tethered", is_flag=True, hidden=True)
def command(
    scenario: str,
    connect: str | None,
    secure: Path | None,
    zenoh_config: Path | None,
    live_port: int | None,
    live_address: str | None,
    listening: int | None,
    tethered: bool,
    overrides: tuple[str, ...],
) -> None:
    """Show the lab of SCENARIO in a browser while it drives: what is believed, decided and wrong, and a stop.

    The page is served on this machine only, unless --live-address says otherwise; then the address that is
    printed has a token, without which nobody sees or stops anything. Without --connect, where nobody is at
    the usual endpoint, it shows the one run of yours on this machine.
    """
    from hil.commands.found_runs import lab_or_run
    from hil.live.daemon import Ending
    from hil.live.priority import step_aside
    from hil.live_page.admission import Admission
    from hil.live_page.live_page import LivePage
    from hil.live_page.serving import (
        LOOPBACK,
        address_of,
        bound,
        is_open,
        new_token,
        own_names,
        serve,
    )
    from hil.scenario.files import load_scenario
    from hil.scenario.guarded import with_guards
    from hil.wire.session import allowed_keys, close_session, open_session

    lab = lab_or_run(connect, zenoh_config, secure, "operator", scenario)
    chosen = load_scenario(lab.scenario, overrides)
    if listening is None and not lab.is_run:
        chosen = with_guards(chosen)
    endpoints = lab.endpoints
    ending = Ending()
    ending.on_signals()
    if tethered:
        ending.on_parent_gone()
        step_aside(_NICENESS)
    if listening is not None:
        held = socket.socket(fileno=listening)
    else:
        held = bound(live_address or LOOPBACK, live_port)
    token = new_token()
    admission = Admission(token, own_names(), is_open(held, endpoints))
    with held:
        session = open_session(endpoints, 3.0, lambda: ending.asked)
        if listening is None:
            _say(f"open {address_of(held, '' if admission.open else token)}")

        async def go() -> None:
            page = LivePage(session, chosen, admission, allowed_keys(endpoints), _say)
            await serve(page, held, ending)

        try:
            asyncio.run(go())
        finally:
            close_session(session)


def _say(line: str) -> None:
    note(f"abreast live: {line}")
