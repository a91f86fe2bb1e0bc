"""The last report of every node in a log, and what any found and refused, without decoding all the others."""

from __future__ import annotations

import struct

from hil.log.reader import Log, Record
from hil.nodes.findings import all_found, findings_in
from hil.nodes.troubles import REFUSED, Trouble, troubles_in
from hil.wire import topics
from hil.wire.finding_keys import PREFIX
from hil.wire.message_types import DiagnosticArray
from hil.wire.messages import MalformedPayloadError, to_ns

_UINT32 = struct.Struct("<I")
_PREFIX, _REFUSED = PREFIX.encode(), REFUSED.encode()
_FRAME_AT, _PLAIN = 12, b"\x00\x01"


class LastReports:
    """Hears diagnostics in the order of the log."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self._typename = log.topics.get(topics.DIAGNOSTICS, "")
        self._last: dict[bytes, bytes] = {}
        self._found: dict[str, dict[str, str]] = {}
        self._troubles: dict[str, list[Trouble]] = {}

    def hear(self, payload: bytes) -> None:
        """Take one in the place of the one before of the same nodes."""
        key = _who(payload)
        self._last.pop(key, None)
        self._last[key] = payload
        if (_PREFIX in payload or _REFUSED in payload) and (report := self._decoded(payload)) is not None:
            self._found = all_found([self._found, findings_in(report)])
            for node, trouble in troubles_in(report).items():
                self._troubles.setdefault(node, []).append(trouble)

    def found(self) -> dict[str, dict[str, str]]:
        """Findings of all reports by the nodes' names; nodes that never had any may be left out."""
        return self._found

    def troubles(self) -> dict[str, list[Trouble]]:
        """Troubles of all reports that tell of any, by the nodes' names."""
        return self._troubles

    def _decoded(self, payload: bytes) -> DiagnosticArray | None:
        try:
            message = self._log.decode(Record(topics.DIAGNOSTICS, self._typename, payload, 0, 0, 0))
            if not isinstance(message, DiagnosticArray):
                return None
            to_ns(message.header.stamp)
        except MalformedPayloadError:
            return None
        return message

    def values(self) -> dict[str, dict[str, str]] | None:
        """Values by the nodes' names; None if a last report is none, so that one before it counts."""
        found: dict[str, dict[str, str]] = {}
        for payload in self._last.values():
            if (message := self._decoded(payload)) is None:
                return None
            for status in message.status:
                values = {entry.key: entry.value for entry in status.values}
                found[status.name.removeprefix("abreast/")] = values
        return found


def _who(payload: bytes) -> bytes:
    """What tells reports of different nodes apart: the name, or all of what is not a plain report of one."""
    try:
        at = _after_text(payload, _FRAME_AT)
        (count,) = _UINT32.unpack_from(payload, at)
        begin = _aligned(at + 5)
        end = _after_text(payload, at + 5)
    except struct.error:
        return payload
    return payload[begin:end] if payload[:2] == _PLAIN and count == 1 else payload


def _aligned(at: int) -> int:
    return (at + 3) & -4


def _after_text(payload: bytes, at: int) -> int:
    begin = _aligned(at)
    (length,) = _UINT32.unpack_from(payload, begin)
    return _aligned(begin + 4 + length)
