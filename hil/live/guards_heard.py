"""What guards say of their robots, as whoever arms them hears it."""

from __future__ import annotations

from hil.guard.report import GUARDS
from hil.wire.message_types import DiagnosticArray
from hil.wire.messages import MalformedPayloadError, decode_as

_MOST = 1000


class GuardsHeard:
    """``held``: why a guard lets its robot not be driven, by the robot's name; empty where it lets it."""

    def __init__(self) -> None:
        self.held: dict[str, str] = {}

    def hear(self, report: bytes) -> None:
        """Take in diagnostics; what is none is left."""
        try:
            said = decode_as(report, DiagnosticArray).status
        except MalformedPayloadError:
            return
        for status in said:
            name = status.name.removeprefix("abreast/")
            if not name.startswith(GUARDS) or len(self.held) > _MOST:
                continue
            latched = any(value.key == "latched" and value.value for value in status.values)
            self.held[name.removeprefix(GUARDS)] = status.message if latched else ""

    def are_armed(self, robot: str) -> bool:
        """Whether the guard of a robot, or all that were heard, lets it be driven."""
        if robot:
            return self.held.get(robot) == ""
        return bool(self.held) and not any(self.held.values())
