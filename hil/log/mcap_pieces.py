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


def is_record(data: mmap, at: int, chain: int = _CHAIN) -> bool:
    """Whether records follow upon each other from a place, as many as a chain has or up to the end."""
    size = len(data)
    for _ in range(chain):
        if at == size:
            return True
        opcode, end = _record(data, at, size)
        if opcode is None:
            return False
        if opcode == Opcode.DATA_END:
            return True
        at = end
    return True


def _record(data: mmap, at: int, size: int) -> tuple[int | None, int]:
    """Kind and end of the record at a place; no kind where there is none."""
    if at + RECORD_HEAD.size > size:
        return None, size
    opcode, length = RECORD_HEAD.unpack_from(data, at)
    end = at + RECORD_HEAD.size + length
    if opcode not in _KINDS or end > size or _FIXED.get(opcode, length) != length:
        return None, size
    return opcode, end


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
        if is_record(data, found.start()) and not _runs_into(begins, found.start(), _end(data, found)):
            return found.start()
        found = _HEAD.search(data, found.start() + 1, limit)
    return limit


def _end(data: mmap, found: re.Match[bytes]) -> int:
    return _record(data, found.start(), len(data))[1]
