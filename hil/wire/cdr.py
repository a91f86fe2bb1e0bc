"""CDR as kernels read and write it: alignment, strings, stamps, and tables of texts that are known.

A reader walks a payload by a position, from the end of one field to that of the next; a position of -1 tells
that the payload is not what it was taken for. What counts as sound is what ``rosbags`` takes: every string
ends with a zero and is UTF-8, every sequence fits, at most three bytes follow the message. Payloads are
little-endian; :func:`hil.wire.messages.in_little_endian` brings others there.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import TYPE_CHECKING

from formation.byte_access import (
    read_byte,
    read_float,
    read_int32,
    read_uint32,
    write_byte,
    write_float,
    write_int32,
    write_int64,
)
from formation.kernel import kernel
from hil.wire.records import Placement, Stamp, stamp_of

if TYPE_CHECKING:
    from formation.records import Buffer

HEAD_BYTES = 4
"""Length of the encapsulation header; alignment counts from its end."""

PLACEMENT_BYTES = 56
STAMP_BYTES = 8
_PADDING = 3


@kernel
def aligned(at: int, width: int) -> int:
    """Where a field of a width of 4 or 8 bytes lies that comes next; -1 stays what it is."""
    return at if at < 0 else HEAD_BYTES + ((at - HEAD_BYTES + width - 1) & -width)


@kernel
def begin(payload: bytes) -> int:
    """Position of the first field, -1 for a payload that is not little-endian CDR."""
    if len(payload) < HEAD_BYTES or read_byte(payload, 0) != 0 or read_byte(payload, 1) != 1:
        return -1
    return HEAD_BYTES


@kernel
def fits(payload: bytes, at: int, length: int) -> bool:
    """Whether so many bytes are there from a position on."""
    return at >= 0 and at + length <= len(payload)


@kernel
def ends(payload: bytes, at: int) -> bool:
    """Whether a message that reaches up to a position is all that there is, padding aside."""
    return at >= 0 and at <= len(payload) and len(payload) - at <= _PADDING


@kernel(inline=False)
def after_text(payload: bytes, at: int) -> int:
    """Position after the string that comes next, -1 if there is none."""
    begins = aligned(at, 4)
    if not fits(payload, begins, 4):
        return -1
    length, first = read_uint32(payload, begins), begins + 4
    if length < 1 or not fits(payload, first, length):
        return -1
    last = first + length - 1
    if read_byte(payload, last) != 0 or not is_utf8(payload, first, last):
        return -1
    return last + 1


@kernel
def after_header(payload: bytes, at: int) -> int:
    """Position after a ``std_msgs/Header``, -1 if there is none."""
    return after_text(payload, at + STAMP_BYTES) if fits(payload, at, STAMP_BYTES) else -1


@kernel
def is_utf8(payload: bytes, at: int, end: int) -> bool:
    """Whether bytes are UTF-8 as Unicode defines it: no overlong form, no surrogate, none past U+10FFFF."""
    while at < end:
        lead = read_byte(payload, at)
        at += 1
        if lead < 0x80:
            continue
        if lead < 0xC2 or lead > 0xF4:
            return False
        following = 1 if lead < 0xE0 else (2 if lead < 0xF0 else 3)
        if at + following > end:
            return False
        low = 0xA0 if lead == 0xE0 else (0x90 if lead == 0xF0 else 0x80)
        high = 0x9F if lead == 0xED else (0x8F if lead == 0xF4 else 0xBF)
        for k in range(following):
            byte = read_byte(payload, at + k)
            if byte < low or byte > high:
                return False
            low, high = 0x80, 0xBF
        at += following
    return True


@kernel
def read_stamp(payload: bytes, at: int) -> Stamp:
    """Stamp at a position."""
    return Stamp(read_int32(payload, at), read_uint32(payload, at + 4))


@kernel
def read_placement(payload: bytes, at: int) -> Placement:
    """``geometry_msgs/Pose`` at a position."""
    return Placement(
        read_float(payload, at),
        read_float(payload, at + 8),
        read_float(payload, at + 16),
        read_float(payload, at + 24),
        read_float(payload, at + 32),
        read_float(payload, at + 40),
        read_float(payload, at + 48),
    )


@kernel
def write_stamp(buffer: Buffer, at: int, ns: int) -> int:
    """Put the stamp of a moment from 1970 to 2038 at a position; returns the one after it."""
    stamp = stamp_of(ns)
    write_int32(buffer, at, stamp.sec)
    write_int32(buffer, at + 4, stamp.nanosec)
    return at + STAMP_BYTES


@kernel
def write_placement(buffer: Buffer, at: int, place: Placement) -> int:
    """Put a ``geometry_msgs/Pose`` at a position; returns the one after it."""
    write_float(buffer, at, place.x)
    write_float(buffer, at + 8, place.y)
    write_float(buffer, at + 16, place.z)
    write_float(buffer, at + 24, place.qx)
    write_float(buffer, at + 32, place.qy)
    write_float(buffer, at + 40, place.qz)
    write_float(buffer, at + 48, place.qw)
    return at + PLACEMENT_BYTES


@kernel
def padded(buffer: Buffer, at: int, width: int) -> int:
    """Fill up with zeros to where a field of a width comes next, and return its position."""
    until = aligned(at, width)
    for k in range(at, until):
        write_byte(buffer, k, 0)
    return until


# Texts that a node knows: names of bodies, reasons. As bytes: number of texts, then each with its length.


def packed_texts(texts: Sequence[str]) -> bytes:
    """Texts as kernels take them."""
    encoded = [text.encode() for text in texts]
    return struct.pack("<I", len(texts)) + b"".join(struct.pack("<I", len(text)) + text for text in encoded)


@kernel
def text_at(texts: bytes, k: int) -> int:
    """Where the k-th text's length stands."""
    at = 4
    for _ in range(k):
        at += 4 + read_uint32(texts, at)
    return at


@kernel
def text_number(texts: bytes, payload: bytes, at: int) -> int:
    """Number of the text that is the sound string at an aligned position of a payload; -1 for none."""
    length, first = read_uint32(payload, at) - 1, at + 4
    known = 4
    for number in range(read_uint32(texts, 0)):
        if read_uint32(texts, known) == length:
            same = True
            for k in range(length):
                if read_byte(texts, known + 4 + k) != read_byte(payload, first + k):
                    same = False
                    break
            if same:
                return number
        known += 4 + read_uint32(texts, known)
    return -1


@kernel
def write_text(buffer: Buffer, at: int, texts: bytes, k: int) -> int:
    """Put the k-th text as a string where it comes next; returns the position after it."""
    known, begins = text_at(texts, k), padded(buffer, at, 4)
    length = read_uint32(texts, known)
    write_int32(buffer, begins, length + 1)
    for place in range(length):
        write_byte(buffer, begins + 4 + place, read_byte(texts, known + 4 + place))
    write_byte(buffer, begins + 4 + length, 0)
    return begins + 5 + length


@kernel
def write_receipt(buffer: Buffer, at: int, digest: int, received_ns: int) -> int:
    """Put an ``abreast_msgs/Consumed`` where it comes next; returns the position after it."""
    begins = padded(buffer, at, 8)
    write_int64(buffer, begins, digest)
    return write_stamp(buffer, begins + 8, received_ns)
