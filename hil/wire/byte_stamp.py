"""The stamp of a message by its bytes alone, for types that begin with a header."""

from __future__ import annotations

from hil.wire.cdr import HEAD_BYTES, STAMP_BYTES, begin, fits, read_stamp
from hil.wire.records import is_time, ns_of


def stamp_ns(payload: bytes) -> int:
    """Stamp [ns] of a little-endian message that begins with a ``std_msgs/Header``, 0 where there is none."""
    if not fits(payload, begin(payload), STAMP_BYTES):
        return 0
    stamp = read_stamp(payload, HEAD_BYTES)
    return ns_of(stamp) if is_time(stamp) else 0
