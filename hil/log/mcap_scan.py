"""What the summary of an MCAP would tell, of one that has none: all of its records are looked at once.

Reference: the MCAP format specification, version 0.
"""

from __future__ import annotations

import io
import struct
from collections import Counter
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Metadata, MetadataIndex, Schema, Statistics

from hil.log.chunk_unpacking import chunk_records, packed_records
from hil.log.mcap_chunks import MAGIC
from hil.log.mcap_summary import ChunkPlace, McapSummary, WholeFields

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQ")
_LOOKED_AT = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.CHUNK, Opcode.MESSAGE, Opcode.METADATA)


def scanned_summary(stream: BinaryIO) -> McapSummary:
    """The summary of an MCAP by its records; without chunks where messages lie outside of some.

    Raises ValueError and what the ``mcap`` package does on bytes that are not as they were written.
    """
    scan = _Scan()
    stream.seek(len(MAGIC))
    while True:
        offset, head = stream.tell(), stream.read(_RECORD.size)
        if len(head) < _RECORD.size:
            raise ValueError("it has no end")
        opcode, length = _RECORD.unpack(head)
        if opcode == Opcode.FOOTER:
            return scan.summary()
        if opcode not in _LOOKED_AT:
            stream.seek(length, io.SEEK_CUR)
            continue
        body = stream.read(length)
        if len(body) < length:
            raise ValueError("a record is longer than what there is")
        scan.hear(opcode, body, offset)


class _Scan:
    def __init__(self) -> None:
        self._found = McapSummary()
        self._counts: Counter[int] = Counter()
        self._span: tuple[int, int] | None = None
        self._loose = False

    def hear(self, opcode: int, body: bytes, offset: int) -> None:
        """A record of the file, or of a chunk: then ``offset`` is that of the chunk."""
        if opcode == Opcode.MESSAGE:
            self._loose = True
            self._message(body)
        elif opcode == Opcode.CHUNK:
            self._chunk(body, offset)
        elif opcode == Opcode.METADATA:
            name = Metadata.read(WholeFields(body)).name
            index = MetadataIndex(offset=offset, length=_RECORD.size + len(body), name=name)
            self._found.metadata.append(index)
        else:
            self._declaration(opcode, body)

    def summary(self) -> McapSummary:
        first, last = self._span or (0, 0)
        found = self._found
        if self._loose:
            found.chunks.clear()
        found.chunks.sort(key=lambda chunk: (chunk.first_ns, chunk.offset))
        found.statistics = Statistics(
            message_count=sum(self._counts.values()),
            schema_count=len(found.schemas),
            channel_count=len(found.channels),
            attachment_count=0,
            metadata_count=len(found.metadata),
            chunk_count=len(found.chunks),
            message_start_time=first,
            message_end_time=last,
            channel_message_counts=dict(self._counts),
        )
        return found

    def _chunk(self, body: bytes, offset: int) -> None:
        chunk = Chunk.read(WholeFields(body))
        data = chunk_records(chunk)
        for opcode, start, end in packed_records(data):
            if opcode == Opcode.MESSAGE:
                self._message(data[start : start + _MESSAGE.size])
            else:
                self._declaration(opcode, data[start:end])
        self._found.chunks.append(
            ChunkPlace(
                chunk.message_start_time, chunk.message_end_time, offset, b"", _RECORD.size + len(body)
            )
        )

    def _declaration(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(WholeFields(body))
            self._found.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(WholeFields(body))
            self._found.channels[channel.id] = channel

    def _message(self, body: bytes) -> None:
        channel_id, _, log_ns = _MESSAGE.unpack_from(body)
        self._counts[channel_id] += 1
        first, last = self._span or (log_ns, log_ns)
        self._span = (min(first, log_ns), max(last, log_ns))
