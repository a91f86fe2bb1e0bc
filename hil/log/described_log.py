"""Logs that say of themselves in messages too what stands in their metadata."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from hil.log.description import description
from hil.log.writer import LogWriter
from hil.wire import topics
from hil.wire.message_types import String
from hil.wire.messages import typename_of

PERIOD_NS = 5_000_000_000
"""What is cut out of a log says by what it was made if it is at least this long."""

_STRING = typename_of(String)


class DescribedLog(LogWriter):
    """A :class:`LogWriter` that puts a description on the topic :data:`hil.wire.topics.LOG`.

    It stands in front of the first message, of the first one after metadata were added, and every five
    seconds of log time. ``begun_ns``: when a log began of which this is a later piece; else it becomes the
    time of the first message.
    """

    def __init__(
        self,
        path: Path,
        metadata: Mapping[str, Mapping[str, str]],
        flush_every_s: float = 0.2,
        begun_ns: int | None = None,
    ) -> None:
        self._told: dict[str, Mapping[str, str]] = {}
        self.begun_ns = begun_ns
        self._next_ns = 0
        super().__init__(path, metadata, flush_every_s)

    def write(self, topic: str, typename: str, payload: bytes, log_ns: int, publish_ns: int) -> None:
        """Append a message, and a description in front of it where one is due."""
        if log_ns >= self._next_ns:
            self._describe(log_ns, publish_ns)
        super().write(topic, typename, payload, log_ns, publish_ns)

    def add_metadata(self, metadata: Mapping[str, Mapping[str, str]]) -> None:
        """Write more metadata records, at once; with the next message they are described too."""
        super().add_metadata(metadata)
        if metadata:
            self._told.update(metadata)
            self._next_ns = 0

    def _describe(self, log_ns: int, publish_ns: int) -> None:
        if self.begun_ns is None:
            self.begun_ns = log_ns
        self._next_ns = log_ns + PERIOD_NS
        super().write(topics.LOG, _STRING, description(self._told, self.begun_ns), log_ns, publish_ns)
