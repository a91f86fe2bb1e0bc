"""Estimates, ``abreast_msgs/LeaderEstimate``, read from and written into bytes."""

from __future__ import annotations

from formation.byte_access import read_byte, read_float, read_uint32, write_byte, write_float, write_int32
from formation.kernel import kernel
from formation.records import Buffer, Rows, load
from hil.wire.cdr import (
    HEAD_BYTES,
    STAMP_BYTES,
    after_header,
    after_text,
    aligned,
    begin,
    ends,
    fits,
    padded,
    read_stamp,
    write_receipt,
    write_stamp,
    write_text,
)
from hil.wire.records import EstimateNumbers, ReadEstimate, Receipt, is_time, ns_of

COVARIANCE_AT = 9 * 8
"""From rho to the covariance."""

_ELEMENTS = 25
_NIS_AT = COVARIANCE_AT + _ELEMENTS * 8
_STATUS_AT = _NIS_AT + 8
_BOUNDS_BYTES = 3 * 8
RECEIPT_BYTES = 16
"""Length of an ``abreast_msgs/Consumed``."""

_NO_NUMBERS = EstimateNumbers(
    0, 0, 0, 0, -1, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
)
_NO_ESTIMATE = ReadEstimate(False, 0, 0, _NO_NUMBERS)


@kernel(inline=False)
def read_estimate(payload: bytes) -> ReadEstimate:
    """Read ``abreast_msgs/LeaderEstimate``; ``sound`` also asks for capture and measurement after 1970."""
    times_at = aligned(after_header(payload, begin(payload)), 4)
    at = aligned(times_at + 2 * STAMP_BYTES, 8)
    if times_at < 0 or not fits(payload, at, _STATUS_AT + 1):
        return _NO_ESTIMATE
    bounds_at = aligned(after_text(payload, at + _STATUS_AT + 1), 8)
    if not fits(payload, bounds_at, _BOUNDS_BYTES + 4):
        return _NO_ESTIMATE
    consumed, end = read_uint32(payload, bounds_at + _BOUNDS_BYTES), bounds_at + _BOUNDS_BYTES + 4
    receipts_at = aligned(end, 8)
    if consumed > 0:
        end = receipts_at + consumed * RECEIPT_BYTES
    capture, measured = read_stamp(payload, HEAD_BYTES), read_stamp(payload, times_at)
    if not (ends(payload, end) and is_time(capture) and is_time(measured)):
        return _NO_ESTIMATE
    numbers = EstimateNumbers(
        ns_of(capture),
        ns_of(measured),
        ns_of(read_stamp(payload, times_at + STAMP_BYTES)),
        read_byte(payload, at + _STATUS_AT),
        -1,
        consumed,
        read_float(payload, at),
        read_float(payload, at + 8),
        read_float(payload, at + 16),
        read_float(payload, at + 24),
        read_float(payload, at + 32),
        read_float(payload, at + 40),
        read_float(payload, at + 48),
        read_float(payload, at + 56),
        read_float(payload, at + 64),
        read_float(payload, at + _NIS_AT),
        read_float(payload, bounds_at),
        read_float(payload, bounds_at + 8),
        read_float(payload, bounds_at + 16),
    )
    return ReadEstimate(True, at + COVARIANCE_AT, receipts_at, numbers)


@kernel(inline=False)
def write_estimate(
    buffer: Buffer, times_at: int, reasons: bytes, numbers: EstimateNumbers, receipts: Rows[Receipt]
) -> int:
    """Put all but the covariance into an estimate whose frame stands there already; returns its length.

    ``times_at``: as :func:`hil.wire.templates.estimate_template` has it. ``reasons``: the table that
    ``numbers.reason`` counts in. ``receipts``: of which the first ``numbers.consumed`` are meant.
    """
    n = numbers
    write_stamp(buffer, HEAD_BYTES, n.capture_ns)
    at = write_stamp(buffer, write_stamp(buffer, times_at, n.measured_ns), n.computed_ns)
    at = aligned(at, 8)
    write_float(buffer, at, n.rho)
    write_float(buffer, at + 8, n.alpha2)
    write_float(buffer, at + 16, n.rho_dot)
    write_float(buffer, at + 24, n.alpha2_dot)
    write_float(buffer, at + 32, n.v1)
    write_float(buffer, at + 40, n.alpha1)
    write_float(buffer, at + 48, n.u1)
    write_float(buffer, at + 56, n.v2)
    write_float(buffer, at + 64, n.u2)
    write_float(buffer, at + _NIS_AT, n.nis)
    write_byte(buffer, at + _STATUS_AT, n.status)
    at = padded(buffer, write_text(buffer, at + _STATUS_AT + 1, reasons, n.reason), 8)
    write_float(buffer, at, n.bound_v1)
    write_float(buffer, at + 8, n.bound_alpha1)
    write_float(buffer, at + 16, n.bound_h)
    return write_receipts(buffer, at + _BOUNDS_BYTES, receipts, n.consumed)


@kernel
def write_receipts(buffer: Buffer, at: int, receipts: Rows[Receipt], count: int) -> int:
    """Put the first ``count`` receipts, a sequence of ``Consumed``, where they come next; returns the end."""
    at = padded(buffer, at, 4)
    write_int32(buffer, at, count)
    at += 4
    for k in range(count):
        receipt = load(Receipt, receipts, k)
        at = write_receipt(buffer, at, receipt.digest, receipt.received_ns)
    return at
