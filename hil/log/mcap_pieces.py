"""The records of an MCAP that may be damaged: whatever stands between what cannot be read.

Where a record makes no sense the next one that does is looked for: at the chunks that the summary tells of,
or, where there is none, at the next place from which several records follow upon each other.
Reference: the MCAP format specification, version 0.
"""

from __future__ import annotations

import re
import struct
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from mmap import mmap
from typing import NamedTuple

from mcap.opcode import Opcode

from hil.log.mcap_chunks import MAGIC

RECORD_HEAD = struct.Struct("<BQ")
_CHAIN = 3
"""Records that have to follow upon each other for a place to count as one where a record begins."""

# A kind of record and a length, of which no file fills the upper bytes.
_HEAD = re.compile(rb"[\x03-\x0f][\s\S]{5}\x00\x00\x00")
_KINDS = frozenset(range(int(Opcode.HEADER), int(Opcode.DATA_END) + 1))
_FIXED = {int(Opcode.DATA_END): 4, int(Opcode.FOOTER): 20}
_MESSAGE_BYTES = 22
_NO_LENGTH = 1 << 40

_SHORT, _LONG = struct.Struct("<I"), struct.Struct("<Q")
_LAYOUTS: dict[int, tuple[int | struct.Struct, ...]] = {
    int(Opcode.HEADER): (_SHORT, _SHORT),
    int(Opcode.SCHEMA): (2, _SHORT, _SHORT, _SHORT),
    int(Opcode.CHANNEL): (4, _SHORT, _SHORT, _SHORT),
    int(Opcode.CHUNK): (28, _SHORT, _LONG),
    int(Opcode.MESSAGE_INDEX): (2, _SHORT),
    int(Opcode.METADATA): (_SHORT, _SHORT),
    int(Opcode.ATTACHMENT): (16, _SHORT, _SHORT, _LONG, 4),
}
"""Bodies of records: so many bytes, or the length of a field, which that many bytes follow."""


class Piece(NamedTuple):
    """Bytes of a file from ``start`` to ``end``: the body of a record, or of no kind what is unreadable."""

    start: int
    end: int
    opcode: int | None


def pieces(data: mmap, begins: Sequence[int]) -> Iterator[Piece]:
    """Pieces of the data section, up to its end or that of the file.

    ``begins``: places, in order, at which chunks are known to begin.
    """
    at, size = len(MAGIC), len(data)
    while at < size:
        opcode, end = _record(data, at, size)
        if opcode is None or _runs_into(begins, at, end):
            following = _next_begin(data, at, begins, size)
            yield Piece(at, following, None)
            at = following
            continue
        yield Piece(at + RECORD_HEAD.size, end, opcode)
        at = end
        if opcode == Opcode.DATA_END:
            return


def _record(data: mmap, at: int, size: int) -> tuple[int | None, int]:
    """Kind and end of the record at a place; no kind where there is none.

    Where the record's length and the lengths in it disagree, that holds from which other records go on.
    """
    if at + RECORD_HEAD.size > size:
        return None, size
    opcode, length = RECORD_HEAD.unpack_from(data, at)
    body = at + RECORD_HEAD.size
    if opcode not in _KINDS or _FIXED.get(opcode, length) != length:
        return None, size
    end, told = body + length, _told_end(data, body, opcode)
    if told == end <= size:
        return opcode, end
    for candidate in (told, end):
        if candidate is not None and body < candidate <= size and _goes_on(data, candidate):
            return opcode, candidate
    return None, size


def _told_end(data: mmap, at: int, opcode: int) -> int | None:
    """Where a body ends by the lengths in it; None for a kind that has none."""
    if opcode in _FIXED:
        return at + _FIXED[opcode]
    layout = _LAYOUTS.get(opcode)
    for step in layout or ():
        if isinstance(step, int):
            at += step
        elif at + step.size > len(data):
            return None
        else:
            at += step.size + step.unpack_from(data, at)[0]
    return at if layout else None


def _goes_on(data: mmap, at: int) -> bool:
    """Whether records follow upon each other from a place, as many as a chain has or up to the end.

    The last of them may be cut off, also if it is the first.
    """
    size = len(data)
    for _ in range(_CHAIN):
        if size - at <= len(MAGIC) and data[at:size] == MAGIC[: size - at]:
            return True
        if at + RECORD_HEAD.size > size:
            return data[at] in _KINDS
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        body = at + RECORD_HEAD.size
        if opcode not in _KINDS or length >= _NO_LENGTH or _FIXED.get(opcode, length) != length:
            return False
        told, at = _told_end(data, body, opcode), body + length
        if (told is not None and told > at) or (opcode == Opcode.MESSAGE and length < _MESSAGE_BYTES):
            return False
        if at > size or opcode == Opcode.DATA_END:
            return True
    return True


def _runs_into(begins: Sequence[int], at: int, end: int) -> bool:
    """Whether a chunk is known to begin inside of what would be a record."""
    following = bisect_right(begins, at)
    return following < len(begins) and begins[following] < end


def _next_begin(data: mmap, at: int, begins: Sequence[int], size: int) -> int:
    """Where the next record begins behind a place where none does; the size of the file if nowhere."""
    following = bisect_right(begins, at)
    limit = begins[following] if following < len(begins) else size
    found = _HEAD.search(data, at + 1, limit)
    while found is not None:
        start = found.start()
        opcode, end = _record(data, start, size)
        if opcode is not None and _goes_on(data, start) and not _runs_into(begins, start, end):
            return start
        found = _HEAD.search(data, start + 1, limit)
    return limit
