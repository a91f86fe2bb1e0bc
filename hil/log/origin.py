"""Where and when a log was made, and by which versions: what a live log says of that, and what any tells."""

from __future__ import annotations

import platform
import time
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

from hil.log.description import RECORD
from hil.log.metadata import LIVE
from hil.log.reader import Log

MADE = "abreast.made"
"""Metadata record of live logs alone: those of lockstep are the same wherever they are made."""

_PACKAGES = ("numpy", "numba", "eclipse-zenoh", "rosbags", "mcap")


@dataclass(frozen=True, slots=True)
class Origin:
    """What a log tells of how it was made; texts are empty where it does not.

    ``begun``: date and time with zone, of the host that recorded it. ``packages``: name and version of each.
    ``scenario_toml``: the scenario that it was made by.
    """

    version: str = ""
    mode: str = ""
    seed: str = ""
    begun: str = ""
    host: str = ""
    system: str = ""
    python: str = ""
    packages: str = ""
    scenario_toml: str = ""


LOCAL_TIME = "%Y-%m-%d %H:%M:%S %z (%Z)"
"""How a person reads when something was: in the time of his place, with its zone."""


def made_here() -> dict[str, dict[str, str]]:
    """Metadata record of a log that is begun now, on this host."""
    return {
        MADE: {
            "begun": time.strftime(LOCAL_TIME),
            "host": platform.node(),
            "system": platform.platform(),
            "python": platform.python_version(),
            "packages": ", ".join(filter(None, map(_versioned, _PACKAGES))),
        }
    }


def origin_of(log: Log) -> Origin:
    """What a log tells of its origin; when a live one began by its first message, if nothing else tells."""
    record: Mapping[str, str] = log.metadata.get(RECORD, {})
    made: Mapping[str, str] = log.metadata.get(MADE, {})
    begun = made.get("begun", "")
    if not begun and record.get("mode") == LIVE and log.start_ns is not None:
        begun = time.strftime(LOCAL_TIME, time.localtime(log.start_ns // 1_000_000_000))
    return Origin(
        begun=begun,
        **{name: record.get(name, "") for name in ("version", "mode", "seed", "scenario_toml")},
        **{name: made.get(name, "") for name in ("host", "system", "python", "packages")},
    )


def _versioned(package: str) -> str:
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return ""
