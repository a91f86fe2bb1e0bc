"""Bytes as they come off the wire and go onto it: little-endian numbers at any offset.

Compiled code has these functions as single instructions. Nothing here needs numpy, so that what reads
messages runs where there is none.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from formation.records import Buffer


def read_float(payload: bytes, at: int) -> float:
    """IEEE double at an offset."""
    value: float = struct.unpack_from("<d", payload, at)[0]
    return value


def read_int32(payload: bytes, at: int) -> int:
    """Signed 32-bit integer at an offset."""
    value: int = struct.unpack_from("<i", payload, at)[0]
    return value


def read_uint32(payload: bytes, at: int) -> int:
    """Unsigned 32-bit integer at an offset."""
    value: int = struct.unpack_from("<I", payload, at)[0]
    return value


def read_int64(payload: bytes, at: int) -> int:
    """Signed 64-bit integer at an offset."""
    value: int = struct.unpack_from("<q", payload, at)[0]
    return value


def read_byte(payload: bytes, at: int) -> int:
    """Byte at an offset."""
    return payload[at]


def bytes_at(source: bytes | Buffer, at: int, length: int) -> bytes:
    """Some of the bytes; compiled code does not copy them, so that they change with a buffer."""
    return bytes(source[at : at + length])


def write_float(buffer: Buffer, at: int, value: float) -> None:
    """Put an IEEE double at an offset."""
    struct.pack_into("<d", buffer.data, at, value)


def write_int32(buffer: Buffer, at: int, value: int) -> None:
    """Put the low 32 bits of an integer at an offset."""
    struct.pack_into("<I", buffer.data, at, value & 0xFFFFFFFF)


def write_int64(buffer: Buffer, at: int, value: int) -> None:
    """Put a 64-bit integer at an offset; of an unsigned one the bits."""
    struct.pack_into("<Q", buffer.data, at, value & 0xFFFFFFFFFFFFFFFF)


def write_byte(buffer: Buffer, at: int, value: int) -> None:
    """Put a byte at an offset."""
    buffer[at] = value
