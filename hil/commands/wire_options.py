"""Options of all commands that join the wire of a lab."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.wire.endpoints import DEFAULT_ENDPOINT, SECURE_ENDPOINT

if TYPE_CHECKING:
    from hil.wire.session import Endpoints


SECURE = click.Option(
    ["--secure"],
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Keys by which to join a router that has some (abreast secure init).",
)


def wire_options(*, listens: bool = True) -> list[click.Parameter]:
    """``--connect``, ``--listen`` where a command may be the router, ``--zenoh-config`` and so on."""
    config = click.Path(path_type=Path, dir_okay=False)
    instead = "Zenoh config file, in place of both." if listens else "Zenoh config file, in its place."
    listen = click.Option(["--listen"], metavar="ENDPOINT", help="Be the router, at this endpoint.")
    return [
        click.Option(["--connect"], metavar="ENDPOINT", help=f"Router to connect to [{DEFAULT_ENDPOINT}]."),
        *([listen] if listens else []),
        SECURE,
        click.Option(["--zenoh-config"], type=config, help=instead),
        click.Option(["--set", "overrides"], multiple=True, metavar="KEY=VALUE", help="Override a key."),
    ]


def endpoints_of(
    connect: str | None, listen: str | None, zenoh_config: Path | None, secure: Path | None, role: str
) -> Endpoints:
    """Endpoints that were given, or the one on loopback where none was, for a command of a role."""
    from hil.wire.role_keys import RoleKeys
    from hil.wire.roles import ROLES
    from hil.wire.session import Endpoints

    if not (connect or listen or zenoh_config):
        connect = SECURE_ENDPOINT if secure else DEFAULT_ENDPOINT
    keys = next(RoleKeys(secure, each) for each in ROLES if each == role) if secure else None
    return Endpoints(connect, listen, zenoh_config, keys)
