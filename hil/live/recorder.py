"""The recorder: everything on the wire into one log, what cannot be decoded included."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hil.live.certificate_process import CertificateProcess
from hil.live.disk_sync import DiskSync
from hil.live.disk_watch import FINDING, DiskWatch, refuse_full_disk
from hil.log.metadata import LIVE, log_metadata
from hil.log.origin import made_here
from hil.log.rotating_log import RotatingLog
from hil.nodes.findings import named_findings
from hil.nodes.node import Outgoing, counted, diagnostics, is_due, named_counts, no_counts, outgoing
from hil.scenario.schema import Scenario
from hil.wire import topics
from hil.wire.events import OVERSIZED, Event
from hil.wire.message_types import Malformed
from hil.wire.messages import MalformedPayloadError, decode, encode, header, typename_of

NAME = "recorder"
_FLUSH_NS = 180_000_000  # fuller chunks are smaller; what a kill may cost is 0.2 s
_DIAGNOSTICS_NS = 500_000_000
_LAST_CHANCE = 1.0  # s, for a run that ends before its certificate is there


class Recorder:
    """Writes each payload with its time of arrival. A worker of :mod:`hil.live.daemon`.

    A payload that is not a valid message of its topic's type would make the log unreadable for others: it
    goes to the topic ``malformed``, byte for byte, and so does what stands for one that is too large.
    """

    thorough = True

    def __init__(self, scenario: Scenario, path: Path) -> None:
        self._types = topics.types_of(scenario)
        self.subscribes = tuple(topic for topic in self._types if topic not in topics.ONLY_IN_LOGS)
        if path.parent.is_dir():
            refuse_full_disk(path.parent)
        self._log = RotatingLog(path, log_metadata(scenario, LIVE) | made_here(), scenario.recorder)
        self._sync = DiskSync()
        self._watch = self._watched()
        self._malformed = self._oversized = no_counts()
        self._next_flush_ns = 0
        self._next_report_ns = 0
        self._scarce = ""
        self._logged_ns = 0
        self._certifying = CertificateProcess(scenario)

    def begin(self, now_ns: int) -> None:
        """Start the timers."""
        self._next_flush_ns = self._next_report_ns = now_ns

    def due_ns(self) -> int:
        """Time of the next flush: what was written before it survives a kill."""
        return self._next_flush_ns

    def take(self, event: Event, now_ns: int) -> tuple[Outgoing, ...]:
        """Write an arrival, or flush."""
        if event.topic:
            self._write(event, now_ns)
        if not is_due(self._next_flush_ns, _FLUSH_NS, now_ns):
            return ()
        self._log.flush()
        self._next_flush_ns = now_ns + _FLUSH_NS
        if not is_due(self._next_report_ns, _DIAGNOSTICS_NS, now_ns):
            return ()
        self._next_report_ns = now_ns + _DIAGNOSTICS_NS
        self._scarce = self._watch.scarce()
        self._log.add_metadata(self._certifying.result())
        return (self._report(now_ns),)

    def end(self, now_ns: int) -> tuple[Outgoing, ...]:
        """Write the recorder's own last report and finish the file."""
        report = self._report(now_ns)
        self._write(Event(report.topic, report.payload), now_ns)
        self._log.flush()
        self._log.add_metadata(self._certifying.result(_LAST_CHANCE))
        self.close()
        return ()

    def close(self) -> None:
        """Finish the file; safe to call again."""
        self._certifying.close()
        try:
            self._log.close()
        finally:
            self._sync.close()

    def _watched(self) -> DiskWatch:
        """The file that is written now, from now on synced and looked after."""
        log = self._log.log
        self._sync.follow(log.path, log.descriptor())
        return DiskWatch(log.path, log.descriptor())

    def _write(self, event: Event, now_ns: int) -> None:
        topic, typename, payload = event.topic, self._types[event.topic], event.payload
        try:
            decode(payload, typename)
        except MalformedPayloadError:
            if payload is OVERSIZED:
                self._oversized = counted(self._oversized, topic)
            else:
                self._malformed = counted(self._malformed, topic)
            kept = Malformed(header(now_ns, ""), topic, np.frombuffer(payload, dtype=np.uint8))
            topic, typename, payload = topics.MALFORMED, typename_of(Malformed), encode(kept)
        # In order even if the clock is set back, so that a replay finds it in order.
        self._logged_ns = max(now_ns, self._logged_ns + 1)
        self._log.write(topic, typename, payload, self._logged_ns, now_ns)
        if self._log.log.path != self._watch.path:
            self._watch = self._watched()

    def _report(self, now_ns: int) -> Outgoing:
        gone, refused = self._watch.gone(), self._sync.failure
        if refused:
            refused = f"log {self._watch.path}: the disk does not keep what is written ({refused})"
        lost = f"the disk does not keep the index of {self._watch.path}" if self._log.log.index_lost else ""
        seen = "; ".join(filter(None, (gone, refused, self._scarce, lost)))
        values = {
            "messages": self._log.messages,
            **named_counts("malformed", self._malformed),
            **named_counts("oversized", self._oversized),
            **named_findings({FINDING: seen} if seen else {}),
        }
        return outgoing(topics.DIAGNOSTICS, diagnostics(NAME, now_ns, gone or refused, values), now_ns)
