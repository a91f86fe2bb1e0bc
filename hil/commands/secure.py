"""``abreast secure``: keys by which a lab's router knows who is who, and lets each do what it is for."""

from __future__ import annotations

import datetime
from pathlib import Path

import click

from hil.commands.command_group import CommandGroup
from hil.commands.guard_option import NO_GUARD
from hil.commands.whole_numbers import Whole
from hil.extras import needs_extra
from hil.log.report_json import say


@click.group("secure", cls=CommandGroup)
def command() -> None:
    """Make the keys of a lab, which all commands take by --secure DIR."""


@command.command("init")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--scenario", default="turtlebot3", show_default=True, help="Whose topics: a name or a file.")
@click.option(
    "--host", "hosts", multiple=True, metavar="NAME", help="Where the router is reached; may be given again."
)
@click.option("--no-guard", is_flag=True, help=NO_GUARD)
@click.option("--days", type=Whole(1, 3650), default=825, show_default=True, help="How long they are valid.")
@click.option("--force", is_flag=True, help="Make all anew; nobody gets in by the old ones then.")
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key of the scenario."
)
def init(
    folder: Path,
    scenario: str,
    hosts: tuple[str, ...],
    no_guard: bool,
    days: int,
    force: bool,
    overrides: tuple[str, ...],
) -> None:
    """Make keys in DIR: a certificate for each role, and Zenoh configurations by which each may do its part.

    A machine needs ca.pem and the files of the roles that it has. Whoever has the key of a role has the role.
    """
    from hil.log.origin import LOCAL_TIME
    from hil.scenario.files import load_scenario
    from hil.scenario.guarded import with_guards
    from hil.wire.roles import ROLES

    try:
        from hil.live.tls_keys import Deployment, make_keys
    except ModuleNotFoundError as error:
        raise needs_extra("secure", error) from None
    chosen = with_guards(load_scenario(scenario, overrides), present=not no_guard)
    now = datetime.datetime.now(datetime.UTC)
    wanted = Deployment(chosen, hosts, days)
    make_keys(folder, wanted, now=now, replacing=force)
    until = (now + datetime.timedelta(days=days)).astimezone().strftime(LOCAL_TIME)
    say(f"{folder}: keys of {', '.join(ROLES)} for {chosen.name}, valid until {until}")
