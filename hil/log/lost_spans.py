"""What is gone of a damaged log, in log time and in messages: as far as something tells, and no further."""

from __future__ import annotations

import struct
from typing import NamedTuple

from hil.log.mcap_summary import McapSummary

_CHUNK_SPAN = struct.Struct("<QQ")
_INDEX_HEAD = struct.Struct("<HI")
_INDEX_ENTRY = struct.Struct("<QQ")
_LONGEST_NS = 86_400_000_000_000


class Span(NamedTuple):
    """From one log time to another one [ns]."""

    from_ns: int
    to_ns: int


class _BrokenChunk:
    """A chunk that cannot be read, while the indexes of its messages may follow."""

    def __init__(self, offset: int, told: Span | None, last_ns: int | None) -> None:
        self.offset, self.told, self.last_ns = offset, told, last_ns
        self.indexed: Span | None = None

    def hear(self, times: list[int]) -> None:
        """Log times of an index of it."""
        first, last = min(times), max(times)
        known = self.indexed or Span(first, last)
        self.indexed = Span(min(known.from_ns, first), max(known.to_ns, last))


class LostSpans:
    """The account of what is gone. ``counted``: messages of broken chunks by their indexes.

    ``is_counted``: whether these are all that are gone in the midst. ``in_chunks``: whether there are chunks.
    """

    def __init__(self, summary: McapSummary) -> None:
        self._spans = {chunk.offset: Span(chunk.first_ns, chunk.last_ns) for chunk in summary.chunks}
        self._kept: set[int] = set()
        self._found: list[Span] = []
        self._hole_from: list[int | None] = []
        self._broken: _BrokenChunk | None = None
        self.in_chunks = bool(self._spans)
        self.counted = 0
        self.is_counted = True

    def begins(self) -> list[int]:
        """Where chunks are known to begin."""
        return sorted(self._spans)

    def keep(self, offset: int) -> None:
        """The chunk at an offset was read."""
        self._settle()
        self.in_chunks = True
        self._kept.add(offset)

    def lose_chunk(self, offset: int, body: bytes, last_ns: int | None) -> None:
        """The chunk at an offset cannot be read; its messages are counted by the indexes behind it."""
        self._settle()
        self.in_chunks = True
        self._broken = _BrokenChunk(offset, told_by_chunk(body, last_ns), last_ns)

    def hear_index(self, index: bytes) -> None:
        """The index of a channel in a chunk, which may be one that cannot be read."""
        if self._broken is None or len(index) < _INDEX_HEAD.size:
            return
        length, entries = _INDEX_HEAD.unpack_from(index)[1], index[_INDEX_HEAD.size :]
        if length == len(entries) and length and length % _INDEX_ENTRY.size == 0:
            times = [log_ns for log_ns, _ in _INDEX_ENTRY.iter_unpack(entries)]
            self.counted += len(times)
            self._broken.hear(times)

    def lose_hole(self, last_ns: int | None) -> None:
        """Something that nobody can tell what it was is gone behind a log time."""
        self._settle()
        self.is_counted = False
        if not self._spans:
            self._hole_from.append(last_ns)

    def lose_message(self, log_ns: int) -> None:
        """A message of which it is not known what it is."""
        self.counted += 1
        self._found.append(Span(log_ns, log_ns))

    def lose_end(self, span: Span, last_ns: int | None) -> None:
        """The chunk in which the log breaks off."""
        self._settle()
        begin_ns = span.from_ns if last_ns is None else min(last_ns, span.from_ns)
        self._found.append(Span(begin_ns, span.to_ns))

    def goes_on(self, log_ns: int) -> None:
        """A message was read, the first behind holes if there were any."""
        if self._hole_from:
            self._found += [Span(min(since or log_ns, log_ns), log_ns) for since in self._hole_from]
            self._hole_from.clear()

    def spans(self) -> tuple[Span, ...]:
        """Where something is gone, in the order of log time; what touches is one."""
        self._settle()
        merged: list[Span] = []
        unread = [span for offset, span in self._spans.items() if offset not in self._kept]
        for span in sorted([*self._found, *unread]):
            if merged and span.from_ns <= merged[-1].to_ns:
                merged[-1] = Span(merged[-1].from_ns, max(merged[-1].to_ns, span.to_ns))
            else:
                merged.append(span)
        return tuple(merged)

    def _settle(self) -> None:
        """All that tells of a broken chunk was heard. Its indexes are whole: the chunk is what is not."""
        broken, self._broken = self._broken, None
        if broken is None:
            return
        if broken.indexed is None:
            self.is_counted = False
        if broken.offset in self._spans:
            return
        span = broken.indexed or broken.told
        if span is not None:
            self._found.append(span)
        else:
            self._hole_from.append(broken.last_ns)


def told_by_chunk(body: bytes, last_ns: int | None) -> Span | None:
    """Log times that the head of a chunk tells, if they can be those behind what was read last."""
    if len(body) < _CHUNK_SPAN.size:
        return None
    span = Span(*_CHUNK_SPAN.unpack_from(body))
    sound = 0 < span.from_ns <= span.to_ns <= span.from_ns + _LONGEST_NS
    near = last_ns is None or abs(span.from_ns - last_ns) < _LONGEST_NS
    return span if sound and near else None
