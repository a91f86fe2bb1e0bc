"""``abreast-guard``: the guard on a robot that has no more than Python and Zenoh."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from hil.errors import AbreastError
from hil.wire.endpoints import DEFAULT_ENDPOINT, SECURE_ENDPOINT


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the console script; the exit code is 0 for an end by a signal, and 2 for bad usage or bad input."""
    given = _parser().parse_args(arguments)
    try:
        # After what is told in no time: help, and what is wrong with the options.
        from hil.guard.order import read_order
        from hil.guard.serving import serve
        from hil.wire.role_keys import RoleKeys
        from hil.wire.roles import GUARD
        from hil.wire.session import Endpoints

        connect = given.connect
        if not (given.connect or given.listen or given.zenoh_config):
            connect = SECURE_ENDPOINT if given.secure else DEFAULT_ENDPOINT
        keys = RoleKeys(given.secure, GUARD) if given.secure else None
        endpoints = Endpoints(connect, given.listen, given.zenoh_config, keys)
        serve(read_order(given.order), endpoints, ros=given.ros)
    except AbreastError as error:
        sys.stderr.write(f"abreast-guard: {' '.join(str(error).split())}\n")
        return error.exit_code
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="abreast-guard",
        description="Stand between the wire and a robot's driver: what is not fresh does not drive it.",
    )
    parser.add_argument("order", type=Path, help="file of abreast guard SCENARIO --robot NAME --write FILE")
    parser.add_argument("--connect", metavar="ENDPOINT", help=f"router to connect to [{DEFAULT_ENDPOINT}]")
    parser.add_argument("--listen", metavar="ENDPOINT", help="be a router for the bridge, there")
    parser.add_argument("--secure", type=Path, metavar="DIR", help="keys by which to join a router with some")
    parser.add_argument("--zenoh-config", type=Path, metavar="FILE", help="Zenoh config, in place of both")
    parser.add_argument("--ros", action="store_true", help="reach the driver by rclpy, without a bridge")
    return parser


if __name__ == "__main__":
    sys.exit(main())
