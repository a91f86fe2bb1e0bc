"""The summary at the end of an MCAP, read at once: an hour has twenty thousand chunks to tell of.

The ``mcap`` package reads a chunk's entry field by field, in Python; here its fixed part is unpacked, and the
map of channels behind it only looked at where somebody asks. All other records are that package's.
Reference: the MCAP format specification, version 0.
"""

from __future__ import annotations

import io
import os
import struct
import zlib
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import BinaryIO, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, MetadataIndex, Schema, Statistics

_RECORD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI")
_MAGIC_BYTES = 8
_CRC_BYTES = 4
_CHUNK = struct.Struct("<QQQQI")
_CHANNEL_OFFSET = np.dtype([("channel", "<u2"), ("offset", "<u8")])


class WholeFields(ReadDataStream):
    """The body of a record, each field of which has the length that it says; ValueError where one has not.

    The ``mcap`` package hands out what there is of a field.
    """

    def __init__(self, body: bytes) -> None:
        super().__init__(io.BytesIO(body))

    def read(self, length: int) -> bytes:
        """The next bytes of the body."""
        data: bytes = super().read(length)
        if len(data) < length:
            raise ValueError("a field is longer than the record that it is in")
        return data


class ChunkPlace(NamedTuple):
    """Where a chunk is, and the log times of its first and last message; ``offsets``: a map by channel.

    ``length``: of its record in bytes, head included.
    """

    first_ns: int
    last_ns: int
    offset: int
    offsets: bytes
    length: int

    def is_there(self, stream: BinaryIO) -> bool:
        """Whether a file has the head of such a chunk at its place."""
        stream.seek(self.offset)
        head = stream.read(_RECORD.size)
        return len(head) == _RECORD.size and _RECORD.unpack(head) == (
            Opcode.CHUNK,
            self.length - _RECORD.size,
        )

    def may_hold(self, channels: Collection[int]) -> bool:
        """Whether a message of one of the channels may be in it. Without a map there may be any."""
        if not self.offsets:
            return True
        held = np.frombuffer(self.offsets, dtype=_CHANNEL_OFFSET)["channel"].tolist()
        return any(number in channels for number in held)


@dataclass(slots=True)
class McapSummary:
    """What a summary tells; ``chunks`` in the order of their first messages.

    ``summed``: whether its sum was there, and right.
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    statistics: Statistics | None = None
    metadata: list[MetadataIndex] = field(default_factory=list)
    chunks: list[ChunkPlace] = field(default_factory=list)
    summed: bool = False


def read_summary(stream: BinaryIO) -> McapSummary | None:
    """Summary of a whole MCAP, None if it has none.

    Raises ValueError for one whose sum is wrong, and what the ``mcap`` package does on other bytes.
    """
    end = stream.seek(-_FOOTER.size - _MAGIC_BYTES, os.SEEK_END)
    footer = stream.read(_FOOTER.size)
    opcode, _, start, _, expected = _FOOTER.unpack(footer)
    if opcode != Opcode.FOOTER:
        raise ValueError("the last record is no footer")
    if not start:
        return None
    if start > end:
        raise ValueError("the summary begins behind its end")
    stream.seek(start)
    data = stream.read(end - start)
    if expected and zlib.crc32(footer[:-_CRC_BYTES], zlib.crc32(data)) != expected:
        raise ValueError("the sum of the summary is wrong")
    summary = _summary_of(data)
    summary.summed = bool(expected)
    return summary


def _summary_of(data: bytes) -> McapSummary:
    summary, at = McapSummary(), 0
    while at < len(data):
        opcode, length = _RECORD.unpack_from(data, at)
        at += _RECORD.size
        if at + length > len(data):
            raise ValueError("a record is longer than the summary that it is in")
        if opcode == Opcode.CHUNK_INDEX:
            first_ns, last_ns, offset, whole, size = _CHUNK.unpack_from(data, at)
            begin = at + _CHUNK.size
            offsets = data[begin : begin + size]
            summary.chunks.append(ChunkPlace(first_ns, last_ns, offset, offsets, whole))
        else:
            _add(summary, opcode, ReadDataStream(io.BytesIO(data[at : at + length])))
        at += length
    summary.chunks.sort(key=lambda chunk: (chunk.first_ns, chunk.offset))
    return summary


def _add(summary: McapSummary, opcode: int, body: ReadDataStream) -> None:
    if opcode == Opcode.SCHEMA:
        schema = Schema.read(body)
        summary.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel = Channel.read(body)
        summary.channels[channel.id] = channel
    elif opcode == Opcode.STATISTICS:
        summary.statistics = Statistics.read(body)
    elif opcode == Opcode.METADATA_INDEX:
        summary.metadata.append(MetadataIndex.read(body))


def read_metadata(stream: BinaryIO, index: MetadataIndex) -> Metadata:
    """The metadata record that an index leads to."""
    stream.seek(index.offset)
    opcode, length = _RECORD.unpack(stream.read(_RECORD.size))
    if opcode != Opcode.METADATA:
        raise ValueError(f"a record of kind {opcode} stands where metadata should")
    found: Metadata = Metadata.read(WholeFields(stream.read(length)))
    if found.name != index.name:
        raise ValueError(f"metadata {found.name!r} stand where {index.name!r} should")
    return found
