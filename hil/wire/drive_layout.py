"""Drive commands, ``geometry_msgs/TwistStamped`` and ``Twist``, read from and written into bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from formation.byte_access import read_float, write_float
from formation.kernel import kernel
from hil.wire.cdr import HEAD_BYTES, after_header, aligned, begin, ends, fits, read_stamp, write_stamp
from hil.wire.records import Drive, Stamp

if TYPE_CHECKING:
    from formation.records import Buffer

_TWIST_BYTES = 6 * 8
_TURN_AT = 5 * 8
_NO_DRIVE = Drive(False, Stamp(0, 0), 0.0, 0.0)


@kernel
def read_drive(payload: bytes, stamped: bool) -> Drive:
    """Read ``TwistStamped`` or, if not ``stamped``, ``Twist``."""
    at, stamp = begin(payload), Stamp(0, 0)
    if stamped:
        at = aligned(after_header(payload, at), 8)
    if not fits(payload, at, _TWIST_BYTES) or not ends(payload, at + _TWIST_BYTES):
        return _NO_DRIVE
    if stamped:
        stamp = read_stamp(payload, HEAD_BYTES)
    return Drive(True, stamp, read_float(payload, at), read_float(payload, at + _TURN_AT))


@kernel
def write_drive(buffer: Buffer, twist_at: int, stamp_ns: int, v: float, u: float) -> None:
    """Put stamp and motion into a drive command whose frame stands there already.

    ``twist_at``: as :func:`hil.wire.templates.drive_template` has it; of a ``Twist`` it is the begin, and
    ``stamp_ns`` is left out.
    """
    if twist_at != HEAD_BYTES:
        write_stamp(buffer, HEAD_BYTES, stamp_ns)
    write_float(buffer, twist_at, v)
    write_float(buffer, twist_at + _TURN_AT, u)
