"""What is in a chunk of an MCAP, unpacked no further than the chunk says and than any sound one goes.

The ``mcap`` package takes a chunk at its word: 60 kB of zeros that were compressed well are gigabytes then.
Reference: the MCAP format specification, version 0.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

import lz4.frame
import zstandard
from mcap.records import Chunk

LARGEST_CHUNK_BYTES = 256 << 20
"""Chunks of more are refused: recorders end them at about 1 MiB, or with the message that goes beyond it."""

_UNSUSPICIOUS_BYTES = 16 << 20
_HIGHEST_RATIO = 1000
"""Records that larger chunks may be of for each byte in the file; those of logs shrink to a third."""

_RECORD = struct.Struct("<BQ")


def chunk_records(chunk: Chunk) -> bytes:
    """The records of a chunk as bytes.

    Raises ValueError for a size that no sound chunk has, and if there is another size, another sum or another
    compression than it says; else what the decompressors do.
    """
    size, packed = chunk.uncompressed_size, chunk.data
    if size > LARGEST_CHUNK_BYTES or (
        size > _UNSUSPICIOUS_BYTES and size > _HIGHEST_RATIO * max(1, len(packed))
    ):
        raise ValueError(f"a chunk of {len(packed)} bytes claims to hold {size}")
    data = _unpacked(chunk.compression, packed, size)
    if len(data) != size:
        raise ValueError(f"a chunk holds {len(data)} bytes, not the {size} that it says")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("the sum of a chunk is wrong")
    return data


def packed_records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Kind, begin and end of the body of each record in a chunk's bytes.

    Raises ValueError where there is none.
    """
    at, size = 0, len(data)
    while at < size:
        if at + _RECORD.size > size:
            raise ValueError("a chunk ends in the midst of a record")
        opcode, length = _RECORD.unpack_from(data, at)
        at += _RECORD.size
        if not opcode or at + length > size:
            raise ValueError("a record is longer than the chunk that it is in, or of no kind")
        yield opcode, at, at + length
        at += length


def _unpacked(compression: str, packed: bytes, size: int) -> bytes:
    if compression == "":
        return packed
    if compression == "zstd":
        told = zstandard.get_frame_parameters(packed).content_size
        if told not in (size, zstandard.CONTENTSIZE_UNKNOWN):
            raise ValueError(f"a chunk holds {told} bytes, not the {size} that it says")
        return zstandard.ZstdDecompressor().decompress(packed, max_output_size=max(1, size))
    if compression == "lz4":
        data: bytes = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
        return data
    raise ValueError(f"a chunk is compressed as {compression!r}; expected zstd, lz4 or nothing")
