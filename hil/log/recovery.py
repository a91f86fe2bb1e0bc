"""Making a log whole that was cut off or damaged: all that can be read is copied into one with an index."""

from __future__ import annotations

import mmap
import struct
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import Writer

from hil.errors import AbreastError, UsageError
from hil.log.mcap_chunks import MAGIC
from hil.log.mcap_pieces import RECORD_HEAD, Piece, pieces
from hil.log.mcap_summary import McapSummary, read_summary
from hil.log.reader import DAMAGE, check_mcap
from hil.log.writer import LIBRARY

_CHUNK_SPAN = struct.Struct("<QQ")
_INDEX_HEAD = struct.Struct("<HI")
_INDEX_ENTRY_BYTES = 16
_LONGEST_CHUNK_NS = 86_400_000_000_000
_UNREADABLE_HEADER = Header(profile="ros2", library="")
_PLAIN_RECORDS: dict[int, type[Header | Schema | Channel | Metadata | Attachment]] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
}


class Span(NamedTuple):
    """From one log time to another one [ns]."""

    from_ns: int
    to_ns: int


@dataclass(frozen=True, slots=True)
class Recovery:
    """What came of a recovery.

    ``messages``, ``bytes``: what the new log holds and its size. ``first_ns``, ``last_ns``: log time of its
    first and last message (None without messages). ``complete``: the source had all its messages, none was
    lost. ``damaged``: something else than an end that was cut off is lost. ``lost``: how many messages, None
    where nobody can know. ``lost_bytes``: bytes of the source that could not be used. ``lost_until_ns``: log
    time up to which lost messages reached at least, where the torn part still tells. ``gaps``: in log time,
    what is gone in between.
    """

    messages: int
    bytes: int
    first_ns: int | None
    last_ns: int | None
    complete: bool
    damaged: bool
    lost: int | None
    lost_bytes: int
    lost_until_ns: int | None
    gaps: tuple[Span, ...]

    def gaps_s(self) -> list[tuple[float, float]]:
        """The gaps in seconds since the log began, as far as that is known."""
        begin_ns = min(gap.from_ns for gap in self.gaps) if self.gaps else 0
        begin_ns = begin_ns if self.first_ns is None else min(begin_ns, self.first_ns)
        return [((gap.from_ns - begin_ns) * 1e-9, (gap.to_ns - begin_ns) * 1e-9) for gap in self.gaps]

    def said(self) -> str:
        """What is gone, in one line."""
        count = "an unknown number of" if self.lost is None else str(self.lost)
        where = ", ".join(f"{first:.3f} to {last:.3f} s" for first, last in self.gaps_s())
        return f"{count} messages are gone, {self.messages} are kept" + f" (gone: {where})" * bool(where)


def recover(source: Path, target: Path) -> Recovery:
    """Copy all whole messages and metadata of ``source``, which may be cut off, to the new log ``target``.

    Only the part that was being written when the log was cut off is lost, and chunks that are damaged. A
    whole log gives an equivalent copy. Raises :class:`UsageError` if the source is no MCAP file or the target
    exists or cannot be created, and :class:`AbreastError` if reading or writing fails on the way; there is no
    target then.
    """
    check_mcap(source)
    if target.exists() and target.samefile(source):
        raise UsageError(f"log {target}: is the log to recover; give another name for the recovered one")
    try:
        written = target.open("xb")
    except FileExistsError:
        raise UsageError(f"log {target}: exists already; give another name or move it away") from None
    except OSError as error:
        raise UsageError(f"log {target}: cannot be written ({error.strerror}); give another place") from None
    try:
        with written, source.open("rb") as stream:
            summary = _summary_of(stream)
            copy = _Copy(written, summary)
            with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
                copy.take_all(data)
            copy.finish()
    except OSError as error:
        target.unlink(missing_ok=True)
        reason = error.strerror or str(error)
        raise AbreastError(f"log {target}: recovering {source} failed ({reason}); free the disk") from error
    except BaseException:
        target.unlink(missing_ok=True)
        raise
    return Recovery(
        messages=copy.messages,
        bytes=target.stat().st_size,
        first_ns=copy.first_ns,
        last_ns=copy.last_ns,
        complete=copy.saw_end and not copy.lost_bytes,
        damaged=copy.damaged,
        lost=copy.lost(),
        lost_bytes=copy.lost_bytes,
        lost_until_ns=copy.lost_until_ns,
        gaps=copy.gaps(),
    )


def _summary_of(stream: BinaryIO) -> McapSummary:
    """What the end of a log tells of it; nothing where it has none that can be read."""
    try:
        return read_summary(stream) or McapSummary()
    except (*DAMAGE, OSError):
        return McapSummary()


class _Copy:
    """The new log, and the account of what went into it and what didn't."""

    def __init__(self, target: BinaryIO, summary: McapSummary) -> None:
        self._writer = Writer(target)
        self._summary = summary
        self._started = False
        self._schema_ids: dict[int, int] = {0: 0}
        self._channel_ids: dict[int, int] = {}
        self._gone = _Gone(summary)
        self.messages = 0
        self.first_ns: int | None = None
        self.last_ns: int | None = None
        self.saw_end = False
        self.damaged = False
        self.lost_bytes = 0
        self.lost_until_ns: int | None = None

    def take_all(self, data: mmap.mmap) -> None:
        """Take every whole record of the source's data section."""
        begins = self._gone.begins()
        for piece in pieces(data, begins):
            if piece.opcode == Opcode.DATA_END or data[piece.start : piece.end] == MAGIC:
                self.saw_end = True
            elif piece.opcode is None:
                self._lose_hole(data, piece)
            elif piece.opcode == Opcode.MESSAGE_INDEX:
                self._gone.count(data[piece.start : piece.end])
            else:
                self._take_piece(data, piece)

    def lost(self) -> int | None:
        """How many messages are gone: by the summary, else by the indexes of chunks that are."""
        if self._summary.statistics is not None:
            return max(0, self._summary.statistics.message_count - self.messages)
        return self._gone.counted if self.saw_end and self._gone.is_counted else None

    def gaps(self) -> tuple[Span, ...]:
        """Where something is gone."""
        return self._gone.gaps()

    def finish(self) -> None:
        """Write the index and the end of the new log."""
        self._start(_UNREADABLE_HEADER)
        self._writer.finish()  # type: ignore[no-untyped-call]  # the package leaves it unannotated

    def _start(self, header: Header) -> None:
        if not self._started:
            self._writer.start(profile=header.profile, library=LIBRARY)
            self._started = True

    def _take(self, record: McapRecord) -> None:
        self._start(record if isinstance(record, Header) else _UNREADABLE_HEADER)
        if isinstance(record, Message):
            self._take_message(record)
        elif isinstance(record, Schema) and record.id not in self._schema_ids:
            self._schema_ids[record.id] = self._writer.register_schema(
                record.name, record.encoding, record.data
            )
        elif isinstance(record, Channel) and record.id not in self._channel_ids:
            if record.schema_id in self._schema_ids:
                self._channel_ids[record.id] = self._writer.register_channel(
                    record.topic,
                    record.message_encoding,
                    self._schema_ids[record.schema_id],
                    record.metadata,
                )
        elif isinstance(record, Metadata):
            self._writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Attachment):
            self._writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )

    def _take_piece(self, data: mmap.mmap, piece: Piece) -> None:
        opcode, body = piece.opcode or 0, data[piece.start : piece.end]
        try:
            records = _parse(opcode, body)
        except DAMAGE:
            self.damaged = True
            self.lost_bytes += len(body)
            if opcode == Opcode.CHUNK:
                self._gone.chunk(piece.start - RECORD_HEAD.size, body, self.last_ns)
            return
        if opcode == Opcode.CHUNK:
            self._gone.kept(piece.start - RECORD_HEAD.size)
        for record in records:
            self._take(record)

    def _lose_hole(self, data: mmap.mmap, hole: Piece) -> None:
        self.lost_bytes += hole.end - hole.start
        if hole.end < len(data):
            self.damaged = True
            self._gone.hole(self.last_ns)
        elif data[hole.start] == Opcode.CHUNK:
            span = _told_by_chunk(data[hole.start + RECORD_HEAD.size : hole.end])
            self.lost_until_ns = None if span is None else span.to_ns

    def _take_message(self, message: Message) -> None:
        channel_id = self._channel_ids.get(message.channel_id) or self._by_summary(message.channel_id)
        if channel_id is None:
            self.damaged = True
            self.lost_bytes += len(message.data)
            return
        self._writer.add_message(
            channel_id, message.log_time, message.data, message.publish_time, message.sequence
        )
        self._gone.goes_on(message.log_time)
        self.messages += 1
        self.first_ns = message.log_time if self.first_ns is None else min(message.log_time, self.first_ns)
        self.last_ns = max(message.log_time, self.last_ns or 0)

    def _by_summary(self, number: int) -> int | None:
        """A channel of which the summary alone tells, as the chunk that introduced it is gone."""
        channel = self._summary.channels.get(number)
        if channel is None:
            return None
        schema = self._summary.schemas.get(channel.schema_id)
        for record in (schema, channel):
            if record is not None:
                self._take(record)
        return self._channel_ids.get(number)


class _Gone:
    """What is gone, in log time and in messages."""

    def __init__(self, summary: McapSummary) -> None:
        self._spans = {chunk.offset: Span(chunk.first_ns, chunk.last_ns) for chunk in summary.chunks}
        self._kept: set[int] = set()
        self._found: list[Span] = []
        self._hole_from: list[int | None] = []
        self._in_chunk = False
        self.counted = 0
        self.is_counted = True

    def begins(self) -> list[int]:
        """Where chunks are known to begin."""
        return sorted(self._spans)

    def kept(self, offset: int) -> None:
        """The chunk at an offset was read."""
        self._kept.add(offset)
        self._in_chunk = False

    def chunk(self, offset: int, body: bytes, last_ns: int | None) -> None:
        """The chunk at an offset cannot be read; its messages are counted by the indexes behind it."""
        self._in_chunk = True
        span = _told_by_chunk(body)
        if offset in self._spans:
            return
        if span is not None:
            self._found.append(span)
        else:
            self._hole_from.append(last_ns)

    def count(self, index: bytes) -> None:
        """The index of a channel in a chunk, which may be one that cannot be read."""
        if self._in_chunk and len(index) >= _INDEX_HEAD.size:
            self.counted += _INDEX_HEAD.unpack_from(index)[1] // _INDEX_ENTRY_BYTES

    def hole(self, last_ns: int | None) -> None:
        """Something that nobody can tell what it was is gone behind a log time."""
        self._in_chunk = self.is_counted = False
        if not self._spans:
            self._hole_from.append(last_ns)

    def goes_on(self, log_ns: int) -> None:
        """A message was read, the first behind holes if there were any."""
        self._found += [Span(min(since or log_ns, log_ns), log_ns) for since in self._hole_from]
        self._hole_from.clear()

    def gaps(self) -> tuple[Span, ...]:
        """Where something is gone, in the order of log time; what touches is one."""
        merged: list[Span] = []
        unread = [span for offset, span in self._spans.items() if offset not in self._kept]
        for span in sorted([*self._found, *unread]):
            if merged and span.from_ns <= merged[-1].to_ns:
                merged[-1] = Span(merged[-1].from_ns, max(merged[-1].to_ns, span.to_ns))
            else:
                merged.append(span)
        return tuple(merged)


def _told_by_chunk(body: bytes) -> Span | None:
    """Log times that the head of a chunk tells, if they are some."""
    if len(body) < _CHUNK_SPAN.size:
        return None
    first_ns, last_ns = _CHUNK_SPAN.unpack_from(body)
    return Span(first_ns, last_ns) if 0 < first_ns <= last_ns <= first_ns + _LONGEST_CHUNK_NS else None


def _parse(opcode: int, body: bytes) -> list[McapRecord]:
    """Return the records that matter for a copy; raises one of DAMAGE for a body that makes no sense."""
    data = ReadDataStream(BytesIO(body))
    if opcode == Opcode.CHUNK:
        return breakup_chunk(Chunk.read(data), validate_crc=True)
    if opcode == Opcode.MESSAGE:
        return [Message.read(data, len(body))]
    kind = _PLAIN_RECORDS.get(opcode)
    return [kind.read(data)] if kind else []
