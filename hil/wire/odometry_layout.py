"""What robots tell of themselves and see, ``nav_msgs/Odometry`` and ``RangeBearing``, from and into bytes."""

from __future__ import annotations

from formation.byte_access import read_float, write_float
from formation.kernel import kernel
from formation.records import Buffer
from hil.wire.cdr import (
    HEAD_BYTES,
    PLACEMENT_BYTES,
    after_header,
    after_text,
    aligned,
    begin,
    ends,
    fits,
    read_placement,
    read_stamp,
    write_placement,
    write_stamp,
)
from hil.wire.records import Odometry, Placement, RangeAndBearing, Stamp

_COVARIANCE_BYTES = 36 * 8
_TWIST_AT = PLACEMENT_BYTES + _COVARIANCE_BYTES
_TURN_AT = _TWIST_AT + 5 * 8
_NUMBERS_BYTES = _TWIST_AT + 6 * 8 + _COVARIANCE_BYTES
_NO_ODOMETRY = Odometry(False, Stamp(0, 0), Placement(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0)
_NO_SIGHTING = RangeAndBearing(False, Stamp(0, 0), 0.0, 0.0)


@kernel
def read_odometry(payload: bytes) -> Odometry:
    """Read ``nav_msgs/Odometry``."""
    at = aligned(after_text(payload, after_header(payload, begin(payload))), 8)
    if not fits(payload, at, _NUMBERS_BYTES) or not ends(payload, at + _NUMBERS_BYTES):
        return _NO_ODOMETRY
    return Odometry(
        True,
        read_stamp(payload, HEAD_BYTES),
        read_placement(payload, at),
        read_float(payload, at + _TWIST_AT),
        read_float(payload, at + _TURN_AT),
    )


@kernel
def write_odometry(buffer: Buffer, numbers_at: int, stamp_ns: int, odometry: Odometry) -> None:
    """Put stamp, pose and motion into an odometry message whose frames stand there already.

    ``numbers_at``: as :func:`hil.wire.templates.odometry_template` has it; ``odometry`` has the rest.
    """
    write_stamp(buffer, HEAD_BYTES, stamp_ns)
    write_placement(buffer, numbers_at, odometry.place)
    write_float(buffer, numbers_at + _TWIST_AT, odometry.v)
    write_float(buffer, numbers_at + _TURN_AT, odometry.u)


@kernel
def read_sighting(payload: bytes) -> RangeAndBearing:
    """Read ``abreast_msgs/RangeBearing``."""
    at = aligned(after_header(payload, begin(payload)), 8)
    if not fits(payload, at, 16) or not ends(payload, at + 16):
        return _NO_SIGHTING
    return RangeAndBearing(
        True, read_stamp(payload, HEAD_BYTES), read_float(payload, at), read_float(payload, at + 8)
    )
