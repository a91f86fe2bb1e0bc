"""Robots that nobody listens for: who says so, and for how long that holds a start up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from hil.wire import message_types as msg
from hil.wire.finding_keys import PREFIX

PATIENCE_S = 20.0
"""For so long [s] a start is held up: a robot comes up by then, or who says so knows of another one."""

_SILENT_S = 3.0
_MOST = 64
"""Reporters that are kept: anybody may report under any name."""


class Told(NamedTuple):
    """Since when a reporter has said that a robot does not listen, and when it said so last [ns]."""

    since_ns: int
    last_ns: int


DeafRobots = Mapping[str, Told]
"""Reporters by their names."""


def with_report(deaf: DeafRobots, report: msg.DiagnosticArray, now_ns: int) -> DeafRobots:
    """The same after a report. A controller's finding is on how its robot moves, and counts for nothing."""
    after = dict(deaf)
    for status in report.status:
        name = status.name.removeprefix("abreast/")
        says = any(value.key == f"{PREFIX}deaf_robot" for value in status.values)
        if not says or name.partition("/")[0] == "controller":
            after.pop(name, None)
        elif name in after or len(after) < _MOST:
            # The clock may have been set back.
            since_ns = min(after[name].since_ns, now_ns) if name in after else now_ns
            after[name] = Told(since_ns, now_ns)
    return after


def waits_for(deaf: DeafRobots, now_ns: int) -> str:
    """What a start is held up by at a time, in words; empty for nothing."""
    names = [
        name
        for name, told in sorted(deaf.items())
        if now_ns - told.last_ns < _SILENT_S * 1e9 and now_ns - told.since_ns < PATIENCE_S * 1e9
    ]
    return f"waiting for a robot to listen, of which {', '.join(names)} tells" if names else ""
