"""The copy of a log that may be damaged: what is whole of it goes in, of the rest an account is kept.

A chunk counts by its sum, a message without one by being a message of its type, metadata by their sums.
Reference: the MCAP format specification, version 0.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator, Sequence
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Metadata, Schema
from mcap.writer import Writer

from hil.errors import UsageError
from hil.log import metadata_sums
from hil.log.chunk_unpacking import chunk_records, packed_records
from hil.log.declarations import Declaration, Declarations
from hil.log.description import ORIGIN, described
from hil.log.lost_spans import LostSpans, told_by_chunk
from hil.log.mcap_chunks import MAGIC
from hil.log.mcap_pieces import RECORD_HEAD, Piece, pieces
from hil.log.mcap_summary import McapSummary, WholeFields
from hil.log.reader import DAMAGE
from hil.log.writer import LIBRARY
from hil.wire.messages import MalformedPayloadError, decode, typestore_of
from hil.wire.topics import LOG

_MESSAGE = struct.Struct("<HIQQ")
_UNREADABLE_HEADER = Header(profile="ros2", library="")
_PLAIN_RECORDS: dict[int, type[Header | Schema | Channel | Metadata | Attachment]] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
}


class _Message(NamedTuple):
    """A message as a log has it. ``summed``: whether a sum tells that it is as it was written."""

    channel_id: int
    sequence: int
    log_ns: int
    publish_ns: int
    payload: bytes
    summed: bool


_Record = Header | Schema | Channel | Metadata | Attachment | _Message


class WholeCopy:
    """The new log, and the account of what went into it and what didn't.

    ``saw_end``: the source goes up to its end. ``damaged``: something else than that end is gone.
    ``restored``, ``lost_metadata``: names of metadata records that were not as they were written, those that
    the log's messages tell again and those that are gone.
    """

    def __init__(self, target: BinaryIO, data: mmap.mmap, summary: McapSummary) -> None:
        self._writer = Writer(target)
        self._data, self._summary = data, summary
        self._started = False
        self._schema_ids: dict[int, int] = {0: 0}
        self._channels: dict[int, tuple[int, Channel, Schema | None] | None] = {}
        self._names = {index.offset: index.name for index in summary.metadata}
        self._declared = Declarations(summary, self._all_declarations)
        self._metadata: dict[str, dict[str, str]] = {}
        self._descriptions: list[bytes] = []
        self._attachments = self._metadata_records = 0
        self.gone = LostSpans(summary)
        self.messages = 0
        self.first_ns: int | None = None
        self.last_ns: int | None = None
        self.saw_end = False
        self.damaged = False
        self.lost_bytes = 0
        self.lost_until_ns: int | None = None
        self.restored: list[str] = []
        self.lost_metadata: list[str] = []

    def take_all(self) -> None:
        """Take every whole record of the source's data section, and finish the new log."""
        data = self._data
        for piece in pieces(data, self.gone.begins()):
            if piece.opcode == Opcode.DATA_END or data[piece.start : piece.end] == MAGIC:
                self.saw_end = True
            elif piece.opcode is None:
                self._lose_hole(piece)
            elif piece.opcode == Opcode.MESSAGE_INDEX:
                self.gone.hear_index(data[piece.start : piece.end])
            else:
                self._take_piece(piece)
        self._start(_UNREADABLE_HEADER)
        for channel in self._declared.channels():
            self._registered(channel.id)
        self._add_metadata()
        self._writer.finish()  # type: ignore[no-untyped-call]  # the package leaves it unannotated

    def lost(self) -> int | None:
        """How many messages are gone: by the summary, else by the indexes of chunks that are."""
        if self._summary.statistics is not None:
            return max(0, self._summary.statistics.message_count - self.messages)
        return self.gone.counted if self.saw_end and self.gone.is_counted else None

    def is_all(self) -> bool:
        """Whether nothing is gone."""
        told = self._summary.statistics
        if told is None:
            return self.saw_end and not self.damaged and not self.lost_metadata
        says = self._metadata_records >= told.metadata_count or bool(self._descriptions)
        attached = self._attachments >= told.attachment_count
        return self.messages >= told.message_count and attached and says and not self.lost_metadata

    def _start(self, header: Header) -> None:
        if not self._started:
            self._writer.start(profile=header.profile, library=LIBRARY)
            self._started = True

    def _take_piece(self, piece: Piece) -> None:
        opcode, body = piece.opcode or 0, self._data[piece.start : piece.end]
        if opcode == Opcode.MESSAGE and self.gone.in_chunks:
            # Who writes chunks writes all messages into them: this was something else.
            self._lose_hole(piece)
            return
        try:
            records = list(_parse(opcode, body))
            self._refuse_renamed(piece.start - RECORD_HEAD.size, records)
        except DAMAGE:
            self.damaged = True
            self.lost_bytes += len(body)
            if opcode == Opcode.CHUNK:
                self.gone.lose_chunk(piece.start - RECORD_HEAD.size, body, self.last_ns)
            return
        if opcode == Opcode.CHUNK:
            self.gone.keep(piece.start - RECORD_HEAD.size)
        for record in records:
            self._take(record)

    def _refuse_renamed(self, offset: int, records: Sequence[_Record]) -> None:
        """Raise ValueError for metadata whose name is not what the summary says."""
        name = self._names.get(offset)
        if any(isinstance(record, Metadata) and name not in (None, record.name) for record in records):
            raise ValueError(f"metadata {name!r} have another name")

    def _take(self, record: _Record) -> None:
        self._start(record if isinstance(record, Header) else _UNREADABLE_HEADER)
        if isinstance(record, _Message):
            self._take_message(record)
        elif isinstance(record, Schema | Channel):
            self._declared.hear(record)
        elif isinstance(record, Metadata):
            self._metadata_records += 1
            self._metadata[record.name] = dict(record.metadata)
        elif isinstance(record, Attachment):
            self._attachments += 1
            self._writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )

    def _take_message(self, message: _Message) -> None:
        known = self._registered(message.channel_id)
        if known is None or not (message.summed or _is_of_its_type(message.payload, *known[1:])):
            self.damaged = True
            self.lost_bytes += len(message.payload)
            self.gone.lose_message(message.log_ns)
            return
        number, channel, _ = known
        self._writer.add_message(
            number, message.log_ns, message.payload, message.publish_ns, message.sequence
        )
        if channel.topic == LOG:
            self._descriptions.append(message.payload)
        self.gone.goes_on(message.log_ns)
        self.messages += 1
        self.first_ns = message.log_ns if self.first_ns is None else min(message.log_ns, self.first_ns)
        self.last_ns = max(message.log_ns, self.last_ns or 0)

    def _registered(self, number: int) -> tuple[int, Channel, Schema | None] | None:
        """A channel of the source as the copy has it, with what it is; None if nothing tells."""
        if number not in self._channels:
            self._channels[number] = self._register(number)
        return self._channels[number]

    def _register(self, number: int) -> tuple[int, Channel, Schema | None] | None:
        channel = self._declared.channel(number)
        if channel is None:
            return None
        schema = self._declared.schema_of(channel)
        if schema is None and channel.schema_id:
            return None
        if schema is not None and schema.id not in self._schema_ids:
            self._schema_ids[schema.id] = self._writer.register_schema(
                schema.name, schema.encoding, schema.data
            )
        schema_id = self._schema_ids[channel.schema_id]
        copied = self._writer.register_channel(
            channel.topic, channel.message_encoding, schema_id, channel.metadata
        )
        return copied, channel, schema

    def _all_declarations(self) -> Iterator[Declaration]:
        for piece in pieces(self._data, self.gone.begins()):
            if piece.opcode in (Opcode.CHUNK, Opcode.SCHEMA, Opcode.CHANNEL):
                try:
                    records = list(_parse(piece.opcode, self._data[piece.start : piece.end]))
                except DAMAGE:
                    continue
                yield from (record for record in records if isinstance(record, Schema | Channel))

    def _lose_hole(self, hole: Piece) -> None:
        self.lost_bytes += hole.end - hole.start
        if hole.end < len(self._data):
            self.damaged = True
            self.gone.lose_hole(self.last_ns)
        elif self._data[hole.start] == Opcode.CHUNK:
            span = told_by_chunk(self._data[hole.start + RECORD_HEAD.size : hole.end], self.last_ns)
            if span is not None:
                self.lost_until_ns = span.to_ns
                self.gone.lose_end(span, self.last_ns)

    def _add_metadata(self) -> None:
        """Metadata whose sums are right, and in the place of others what the messages tell of them."""
        records = dict(self._metadata)
        sums = records.pop(metadata_sums.RECORD, {})
        told = described(self._descriptions)
        told.pop(ORIGIN, None)
        if not sums.keys() <= records.keys():
            # What has a name that nothing was summed under had another one.
            records = {name: entries for name, entries in records.items() if name in sums}
        # Messages are under the sums of their chunks.
        sums = sums or metadata_sums.sums_of(told)
        for name in metadata_sums.changed(records, sums):
            if name in told and told[name] != records.get(name):
                records[name] = told[name]
                self.restored.append(name)
            elif name not in told:
                records.pop(name, None)
                self.lost_metadata.append(name)
        if sums:
            records[metadata_sums.RECORD] = metadata_sums.sums_of(records)
        for name, entries in records.items():
            self._writer.add_metadata(name, entries)


def _is_of_its_type(payload: bytes, channel: Channel, schema: Schema | None) -> bool:
    """Whether a payload is a message of the type that its channel says, as far as that can be told."""
    if schema is None or channel.message_encoding != "cdr" or schema.encoding != "ros2msg" or not schema.data:
        return True
    try:
        decode(payload, schema.name, typestore_of(schema.name, schema.data.decode()))
    except MalformedPayloadError:
        return False
    except (UsageError, ValueError):
        return True
    return True


def _parse(opcode: int, body: bytes) -> Iterator[_Record]:
    """The records that matter for a copy; raises one of DAMAGE for a body that makes no sense."""
    if opcode == Opcode.CHUNK:
        chunk = Chunk.read(WholeFields(body))
        data, summed = chunk_records(chunk), bool(chunk.uncompressed_crc)
        for kind, start, end in packed_records(data):
            yield from _plain(kind, data[start:end], summed=summed)
    else:
        yield from _plain(opcode, body, summed=False)


def _plain(opcode: int, body: bytes, *, summed: bool) -> Iterator[_Record]:
    if opcode == Opcode.MESSAGE:
        channel_id, sequence, log_ns, publish_ns = _MESSAGE.unpack_from(body)
        yield _Message(channel_id, sequence, log_ns, publish_ns, body[_MESSAGE.size :], summed)
    elif (kind := _PLAIN_RECORDS.get(opcode)) is not None:
        yield kind.read(WholeFields(body))
