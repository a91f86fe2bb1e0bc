"""Lines for a terminal, when a node begins to find something and when it finds it no more."""

from __future__ import annotations

from collections.abc import Callable

from hil.nodes.findings import PREFIX, Findings, finding_line, findings_in, findings_json
from hil.wire.message_types import DiagnosticArray
from hil.wire.messages import MalformedPayloadError, decode_as

_PREFIX = PREFIX.encode()


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
