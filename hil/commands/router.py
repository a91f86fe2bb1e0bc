"""``abreast router``: the router of a lab on its own, so that it outlives recorders and runs."""

from __future__ import annotations

from pathlib import Path

import click

from hil.commands.wire_options import SECURE
from hil.errors import UsageError
from hil.log.report_json import note
from hil.wire.endpoints import DEFAULT_ENDPOINT, SECURE_ENDPOINT

_LONGEST_WAIT_S = 0.2


@click.command("router", params=[SECURE])
@click.option("--listen", metavar="ENDPOINT", help=f"Where it listens [{DEFAULT_ENDPOINT}].")
@click.option(
    "--zenoh-config", type=click.Path(path_type=Path, dir_okay=False), help="Zenoh config file, in its place."
)
@click.option("--tethered", is_flag=True, hidden=True)
def command(secure: Path | None, listen: str | None, zenoh_config: Path | None, tethered: bool) -> None:
    """Be the router that all others connect to, until Ctrl-C or SIGTERM.

    It listens on loopback unless told otherwise. With --secure it lets in whoever has a key of DIR, and each
    role does what it is for; without it everybody who reaches the endpoint may do everything.
    """
    import time

    from hil.live.daemon import Ending
    from hil.live.service import Service
    from hil.wire.link_watch import links_said
    from hil.wire.mailbox import Bell
    from hil.wire.refused_links import refused_links_said
    from hil.wire.role_keys import RoleKeys
    from hil.wire.roles import ROUTER
    from hil.wire.session import Endpoints, NoRouterError, close_session, open_session, refuse_deaf

    if listen and zenoh_config:
        raise UsageError(f"--listen {listen}: the config file says where it listens; leave one of both out")
    if not zenoh_config:
        listen = listen or (SECURE_ENDPOINT if secure else DEFAULT_ENDPOINT)
    endpoints = Endpoints(None, listen, zenoh_config, RoleKeys(secure, ROUTER) if secure else None)
    refuse_deaf(endpoints)
    ending, asked, service = Ending(), Bell(), Service()
    ending.notify(asked.ring)
    ending.on_signals()
    if tethered:
        ending.on_parent_gone()
    with refused_links_said(_say):
        try:
            session = open_session(endpoints, give_up=lambda: ending.asked)
        except NoRouterError as error:
            raise UsageError(str(error)) from None
        try:
            how = f"by the keys of {secure}" if secure else "open to all who reach it"
            with links_said(session, _say):
                service.ready(time.monotonic())
                _say(f"ready, {endpoints.describe()}, {how}")
                while not ending.asked:
                    asked.wait(_LONGEST_WAIT_S)
                    service.goes_round(time.monotonic())
                service.ends()
        finally:
            close_session(session)


def _say(line: str) -> None:
    note(f"abreast router: {line}")
