"""Writing MCAP with chunks that end where the caller says.

The ``mcap`` package's own writer ends a chunk by size alone, so whatever is still in memory is lost with the
process. What goes into which chunk is decided here, and the two records that there are many of are packed
here, since a log must not cost what it tells of; all other record layouts are that package's.
Reference: the MCAP format specification, version 0.
"""

from __future__ import annotations

import struct
import sys
import zlib
from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from hil.log.index_spool import IndexSpool

MAGIC = b"\x89MCAP0\r\n"

_MESSAGE_HEAD = struct.Struct("<BQHIQQ")
_pack_head = _MESSAGE_HEAD.pack
_HEAD_BYTES = _MESSAGE_HEAD.size
_FIXED_BYTES = 22
_INDEX_HEAD = struct.Struct("<BQHI")
_INDEX_FIXED_BYTES = 6
_PAIR_BYTES = 16
_LEVEL = 6  # 4 % smaller than with 1; 2 % more would take seven times as long
_MESSAGE = int(Opcode.MESSAGE)
_LAST_SEQUENCE = 0xFFFFFFFF
_FOOTER_HEAD = struct.Struct("<BQQQ")
_FOOTER_BYTES = 20


class ChunkedMcap:
    """An MCAP file in the making: ``emit`` gets whole records, which one after the other are the file.

    ``folder``: where indexes wait for its end, None for in memory. Where they are lost there is no summary.
    """

    def __init__(
        self, emit: Callable[[bytes], None], profile: str, library: str, folder: Path | None = None
    ) -> None:
        self._emit_bytes = emit
        self._offset = 0
        self._declarations = bytearray()
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._metadata_indexes: list[MetadataIndex] = []
        self._chunks = 0
        self._message_counts: dict[int, int] = {}
        self._span: tuple[int, int] | None = None
        # The open chunk: its records in pieces, their size, and by channel log time and offset in turn.
        self._pieces: list[bytes] = []
        self._size = 0
        self._entries: dict[int, list[int]] = {}
        self._compressor = zstandard.ZstdCompressor(level=_LEVEL)
        self._emit(MAGIC + _bytes_of([Header(profile=profile, library=library)]))
        # A run of hours has ten a second.
        self._chunk_indexes = IndexSpool(folder)

    def add_metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """Write a metadata record at once."""
        record = _bytes_of([Metadata(name=name, metadata=dict(entries))])
        self._metadata_indexes.append(MetadataIndex(offset=self._offset, length=len(record), name=name))
        self._emit(record)

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Declare a message type; returns its id."""
        schema = Schema(id=len(self._schemas) + 1, name=name, encoding=encoding, data=data)
        self._schemas.append(schema)
        self._declare(schema)
        return schema.id

    def add_channel(self, topic: str, schema_id: int, encoding: str, metadata: Mapping[str, str]) -> int:
        """Declare a topic of a message type; returns its id."""
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            schema_id=schema_id,
            message_encoding=encoding,
            metadata=dict(metadata),
        )
        self._channels.append(channel)
        self._message_counts[channel.id] = 0
        self._entries[channel.id] = []
        self._declare(channel)
        return channel.id

    def repeat_declarations(self) -> None:
        """Put all types and topics into the open chunk again: where an earlier one is lost they are known."""
        self._put(bytes(self._declarations))

    def add_message(self, channel_id: int, log_ns: int, publish_ns: int, payload: bytes) -> int:
        """Put a message into the open chunk, with the channel's next sequence number (from 0).

        Returns the size [bytes] of the open chunk, before compression.
        """
        entries, offset, length = self._entries[channel_id], self._size, len(payload)
        sequence = self._message_counts[channel_id] + (len(entries) >> 1)
        head = _pack_head(
            _MESSAGE, _FIXED_BYTES + length, channel_id, sequence & _LAST_SEQUENCE, log_ns, publish_ns
        )
        entries += (log_ns, offset)
        self._pieces += (head, payload)
        self._size = size = offset + _HEAD_BYTES + length
        return size

    def open_span(self) -> tuple[int, int] | None:
        """First and last log time in the open chunk; None if it holds no message."""
        times = [entries[::2] for entries in self._entries.values() if entries]
        return (min(map(min, times)), max(map(max, times))) if times else None

    def close_chunk(self) -> None:
        """End the open chunk and write it with its index; does nothing if it holds no message."""
        span = self.open_span()
        if span is None:
            return
        first, last = span
        indexed = {number: entries for number, entries in self._entries.items() if entries}
        data = b"".join(self._pieces)
        self._pieces, self._size = [], 0
        self._entries = {number: [] for number in self._entries}
        for number, entries in indexed.items():
            self._message_counts[number] += len(entries) >> 1
        self._span = (min(first, self._span[0]), max(last, self._span[1])) if self._span else (first, last)
        chunk = Chunk(
            compression="zstd",
            data=self._compressor.compress(data),
            message_start_time=first,
            message_end_time=last,
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=len(data),
        )
        written = [_bytes_of([chunk])]
        chunk_bytes = end = len(written[0])
        index_offsets: dict[int, int] = {}
        for number, entries in indexed.items():
            index_offsets[number] = self._offset + end
            written.append(_message_index(number, entries))
            end += len(written[-1])
        index = ChunkIndex(
            chunk_start_offset=self._offset,
            chunk_length=chunk_bytes,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            uncompressed_size=chunk.uncompressed_size,
            message_start_time=first,
            message_end_time=last,
            message_index_offsets=index_offsets,
            message_index_length=end - chunk_bytes,
        )
        self._chunk_indexes.add(_bytes_of([index]))
        self._chunks += 1
        self._emit(b"".join(written))

    @property
    def index_lost(self) -> bool:
        """Whether the log will have no summary, as the disk did not keep what goes into it."""
        return self._chunk_indexes.lost

    def finish(self) -> None:
        """Write what is still in memory, the summary and the end of the file."""
        self.close_chunk()
        index_bytes = self._chunk_indexes.size()
        if self.index_lost:
            self._emit(self.bare_end())
            return
        data_end = _bytes_of([DataEnd(data_section_crc=0)])
        summary_start = self._offset + len(data_end)
        groups: list[tuple[Opcode, Iterable[bytes], int]] = [
            _group(Opcode.SCHEMA, self._schemas),
            _group(Opcode.CHANNEL, self._channels),
            _group(Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunk_indexes.blocks(), index_bytes),
            _group(Opcode.METADATA_INDEX, self._metadata_indexes),
        ]
        self._emit(data_end)
        offsets: list[SummaryOffset] = []
        crc = 0
        for opcode, blocks, length in groups:
            if length:
                start = self._offset
                offsets.append(SummaryOffset(group_opcode=opcode, group_start=start, group_length=length))
                for block in blocks:
                    self._emit(block)
                    crc = zlib.crc32(block, crc)
        offsets_start, told = self._offset, _bytes_of(offsets)
        footer_head = _FOOTER_HEAD.pack(Opcode.FOOTER, _FOOTER_BYTES, summary_start, offsets_start)
        crc = zlib.crc32(footer_head, zlib.crc32(told, crc))
        footer = Footer(summary_start=summary_start, summary_offset_start=offsets_start, summary_crc=crc)
        self._emit(told + _bytes_of([footer]) + MAGIC)

    def close(self) -> None:
        """Let go of what is kept aside, finished or not."""
        self._chunk_indexes.close()

    @staticmethod
    def bare_end() -> bytes:
        """The end of a file that has no room for a summary: whoever reads it looks at all of its records."""
        footer = Footer(summary_start=0, summary_offset_start=0, summary_crc=0)
        return _bytes_of([DataEnd(data_section_crc=0), footer]) + MAGIC

    def _declare(self, record: Schema | Channel) -> None:
        data = _bytes_of([record])
        self._declarations += data
        self._put(data)

    def _put(self, record: bytes) -> None:
        self._pieces.append(record)
        self._size += len(record)

    def _statistics(self) -> Statistics:
        first, last = self._span or (0, 0)
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts={number: count for number, count in self._message_counts.items() if count},
            chunk_count=self._chunks,
            message_count=sum(self._message_counts.values()),
            message_start_time=first,
            message_end_time=last,
            metadata_count=len(self._metadata_indexes),
            schema_count=len(self._schemas),
        )

    def _emit(self, data: bytes) -> None:
        self._emit_bytes(data)
        self._offset += len(data)


def _group(opcode: Opcode, records: Iterable[McapRecord]) -> tuple[Opcode, Iterable[bytes], int]:
    """Records of the summary: their kind, their bytes and how many these are."""
    data = _bytes_of(records)
    return opcode, [data], len(data)


def _message_index(channel_id: int, entries: Sequence[int]) -> bytes:
    """Index of one channel's messages in a chunk; ``entries``: log time and offset of each in turn."""
    pairs = array("Q", entries)
    if sys.byteorder == "big":
        pairs.byteswap()
    size = _PAIR_BYTES * (len(entries) >> 1)
    return (
        _INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, _INDEX_FIXED_BYTES + size, channel_id, size) + pairs.tobytes()
    )


def _bytes_of(records: Iterable[McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]  # the package leaves it unannotated
    return data
