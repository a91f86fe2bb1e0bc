"""Checks of this machine: room for a log, a port to listen on, a router to reach."""

from __future__ import annotations

import shutil
import socket
from pathlib import Path

from hil.doctor.check import Check, check

_LEAST_GB = 1.0


def disk_check(folder: Path, least_gb: float = _LEAST_GB) -> Check:
    """Whether there is room for logs in a folder, or where it is to be made."""
    there = next(each for each in (folder, *folder.absolute().parents) if each.exists())
    free_gb = shutil.disk_usage(there).free * 1e-9
    advice = "make room, or write logs elsewhere with --out"
    return check("disk", free_gb >= least_gb, f"{free_gb:.1f} GB free", f"at least {least_gb:g} GB", advice)


def port_check(port: int, host: str = "127.0.0.1") -> Check:
    """Whether a router could listen there."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
            taken = False
        except OSError:
            taken = True
    advice = "another router is there: connect to it with --connect, or end it, or listen on another port"
    return check("port", not taken, f"{host}:{port} is {'taken' if taken else 'free'}", "a free port", advice)


def route_check(endpoint: str, reason: str) -> Check:
    """Whether the router was reached; ``reason``: why not, empty if it was."""
    advice = (
        "start abreast router, or a run or bridge that listens, or name another one with --connect; "
        "one that has keys wants --secure DIR"
    )
    seen = reason or f"a router at {endpoint}"
    return check("router", not reason, seen, f"a router at {endpoint}", advice)
