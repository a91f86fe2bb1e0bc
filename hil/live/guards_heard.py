"""What guards say of their robots, as whoever arms them hears it."""

from __future__ import annotations

from collections.abc import Collection

from hil.guard.report import GUARDS
from hil.wire.message_types import DiagnosticArray
from hil.wire.messages import MalformedPayloadError, decode_as

_MOST = 1000


class GuardsHeard:
    """``held``: why a guard lets its robot not be driven, by the robot's name; empty where it lets it.

    ``robots``: whose guards alone are heard; None for all.
    """

    def __init__(self, robots: Collection[str] | None = None) -> None:
        self.held: dict[str, str] = {}
        self._robots = robots

    def hear(self, report: bytes) -> set[str]:
        """Take in diagnostics, and tell of which robots' guards they were; what is none is left."""
        heard: set[str] = set()
        try:
            said = decode_as(report, DiagnosticArray).status
        except MalformedPayloadError:
            return heard
        for status in said:
            name = status.name.removeprefix("abreast/")
            robot = name.removeprefix(GUARDS)
            if not name.startswith(GUARDS) or (self._robots is not None and robot not in self._robots):
                continue
            if robot not in self.held and len(self.held) >= _MOST:
                continue
            latched = any(value.key == "latched" and value.value for value in status.values)
            self.held[robot] = status.message if latched else ""
            heard.add(robot)
        return heard

    def are_armed(self, robot: str) -> bool:
        """Whether the guard of a robot, or all that were heard, lets it be driven."""
        if robot:
            return self.held.get(robot) == ""
        return bool(self.held) and not any(self.held.values())
