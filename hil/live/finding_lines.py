"""Lines for a terminal: what nodes begin to find and find no more, and what nodes or a start wait for."""

from __future__ import annotations

import re
from collections.abc import Callable

from hil.nodes.findings import Findings, finding_line, findings_in, findings_json
from hil.wire.finding_keys import PREFIX
from hil.wire.message_types import DiagnosticArray
from hil.wire.messages import MalformedPayloadError, decode_as

_PREFIX = PREFIX.encode()
_NUMBER = re.compile(r"[-+]?[0-9.]+ (s|deg|mm|m)\b|sd [0-9.]+")


class FindingLines:
    """Hears the diagnostics of nodes, and says what is new in them, one line for each finding."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._known: dict[str, Findings] = {}

    def hear(self, payload: bytes) -> None:
        """Hear a diagnostics message; what cannot be read is passed over."""
        if not self._known and _PREFIX not in payload:
            return
        try:
            report = decode_as(payload, DiagnosticArray)
        except MalformedPayloadError:
            return
        for node, findings in findings_in(report).items():
            self.note(node, findings)

    def note(self, node: str, findings: Findings) -> None:
        """Say how what a node finds differs from what it found before."""
        before = self._known.get(node, {})
        for finding in findings_json(findings):
            if finding["name"] not in before:
                self._say(f"{node} finds {finding_line(finding)}")
        for name in before:
            if name not in findings:
                self._say(f"{node} finds {name} no more")
        self._known[node] = dict(findings)
        if not findings:
            del self._known[node]


class ProblemLines:
    """Hears the diagnostics of nodes, and says what each waits for or cannot do, and when that is over.

    Only what two reports in a row say is told: what is there half a second after a start was not waited for.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._heard: dict[str, str] = {}
        self._told: dict[str, str] = {}

    def hear(self, payload: bytes) -> None:
        """Hear a diagnostics message; what cannot be read is passed over."""
        try:
            report = decode_as(payload, DiagnosticArray)
        except MalformedPayloadError:
            return
        for status in report.status:
            self.note(status.name.removeprefix("abreast/"), "" if status.level == 0 else status.message)

    def note(self, node: str, problem: str) -> None:
        """Say how a node's problem differs from the one that was told; figures with a unit do not."""
        counted = _NUMBER.sub("", problem)
        before, self._heard[node] = self._heard.get(node), counted
        if counted != before or counted == self._told.get(node, ""):
            return
        self._told[node] = counted
        self._say(f"{node}: {problem}" if problem else f"{node} waits no more")


class WaitingLines:
    """Says for what a start waits, whenever that is something else; seconds that are counted down are not."""

    def __init__(self, say: Callable[[str], object]) -> None:
        self._say = say
        self._known = ""

    def hear(self, waits: str) -> None:
        """Hear what is waited for now."""
        counted = _NUMBER.sub("", waits)
        if counted != self._known:
            self._known = counted
            self._say(waits)
