"""Options of ``abreast emulator`` that let it serve its motion capture as Motive would."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from hil.commands.whole_numbers import Whole
from hil.errors import UsageError

if TYPE_CHECKING:
    from hil.bridge.natnet_emulator import NatNetEmulator, Serving

_PORT = Whole(0, 65_535)


@dataclass(frozen=True, slots=True)
class NatNetOptions:
    """What was given; ``natnet``: whether to serve at all."""

    natnet: bool = False
    natnet_address: str = "127.0.0.1"
    natnet_version: str = "3.1"
    natnet_command_port: int = 1510
    natnet_data_port: int = 1511
    natnet_multicast: bool = False

    def serving(self) -> Serving:
        """How to serve. Raises :class:`UsageError` for an address that is none."""
        from hil.bridge.datagram_sockets import address_of
        from hil.bridge.natnet_emulator import Serving
        from hil.bridge.natnet_packets import VERSIONS

        versions = {str(version): version for version in VERSIONS}
        if self.natnet_version not in versions:
            raise UsageError(f"--natnet-version {self.natnet_version}: expected {', '.join(versions)}")
        address, _ = address_of(self.natnet_address, 0)
        return Serving(
            address,
            versions[self.natnet_version],
            self.natnet_command_port,
            self.natnet_data_port,
            self.natnet_multicast,
        )


def natnet_options() -> list[click.Parameter]:
    """The options, to be gathered in :class:`NatNetOptions`."""
    given = NatNetOptions()
    return [
        click.Option(["--natnet"], is_flag=True, help="Serve the motion capture by NatNet, as Motive would."),
        click.Option(["--natnet-address"], default=given.natnet_address, show_default=True, metavar="ADDR"),
        click.Option(["--natnet-version"], default=given.natnet_version, show_default=True, metavar="V"),
        click.Option(
            ["--natnet-command-port"], type=_PORT, default=given.natnet_command_port, show_default=True
        ),
        click.Option(["--natnet-data-port"], type=_PORT, default=given.natnet_data_port, show_default=True),
        click.Option(["--natnet-multicast"], is_flag=True, help="Stream to a group, not to each client."),
    ]


def served(emulator: NatNetEmulator, address: str) -> str:
    """Where it is served, in one line."""
    info = emulator.info
    bodies = ", ".join(f"{name!r} ({number})" for number, name in enumerate(emulator.names, start=1))
    how = f"multicast to {info.group}" if info.multicast else "unicast"
    return (
        f"NatNet {info.version} on {address}, command port {emulator.command_port}, "
        f"data port {info.data_port}, {how}: {bodies}"
    )
