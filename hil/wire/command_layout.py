"""Decisions, ``abreast_msgs/Command``, and the true states, ``Truth``, read from and written into bytes."""

from __future__ import annotations

from formation.byte_access import read_byte, read_float, read_uint32, write_byte, write_float, write_int32
from formation.kernel import kernel
from formation.records import Buffer, Rows
from hil.wire.cdr import (
    HEAD_BYTES,
    STAMP_BYTES,
    after_header,
    after_text,
    aligned,
    begin,
    ends,
    fits,
    read_stamp,
    text_number,
    write_stamp,
    write_text,
)
from hil.wire.estimate_layout import RECEIPT_BYTES, write_receipts
from hil.wire.records import (
    CommandNumbers,
    ReadCommand,
    ReadTruth,
    Receipt,
    Stamp,
    TruthNumbers,
    is_time,
    ns_of,
)

_STOP_AT = 33
_NUMBERS_BYTES = 80
_NO_COMMAND = ReadCommand(False, 0, CommandNumbers(0, 0, 0, 0, 0, 0.0, 0.0, 0.0, 0.0, False, False))
_NO_TRUTH = ReadTruth(
    False, Stamp(0, 0), TruthNumbers(0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
)


@kernel(inline=False)
def read_command(payload: bytes, stops: bytes) -> ReadCommand:
    """Read ``abreast_msgs/Command``; ``sound`` also asks for stamps after 1970.

    ``stops``: packed texts of the reasons that its ``stop`` is counted by, -1 for another one.
    """
    times_at = aligned(after_header(payload, begin(payload)), 4)
    at = aligned(times_at + 2 * STAMP_BYTES, 8)
    if times_at < 0 or not fits(payload, at, _STOP_AT):
        return _NO_COMMAND
    fresh_at = after_text(payload, at + _STOP_AT)
    counted_at = aligned(fresh_at + 1, 4)
    if fresh_at < 0 or not fits(payload, counted_at, 4):
        return _NO_COMMAND
    consumed, end = read_uint32(payload, counted_at), counted_at + 4
    receipts_at = aligned(end, 8)
    if consumed > 0:
        end = receipts_at + consumed * RECEIPT_BYTES
    stamp, capture = read_stamp(payload, HEAD_BYTES), read_stamp(payload, times_at)
    measured = read_stamp(payload, times_at + STAMP_BYTES)
    if not (ends(payload, end) and is_time(stamp) and is_time(capture) and is_time(measured)):
        return _NO_COMMAND
    numbers = CommandNumbers(
        ns_of(stamp),
        ns_of(capture),
        ns_of(measured),
        text_number(stops, payload, aligned(at + _STOP_AT, 4)),
        consumed,
        read_float(payload, at),
        read_float(payload, at + 8),
        read_float(payload, at + 16),
        read_float(payload, at + 24),
        read_byte(payload, at + 32) != 0,
        read_byte(payload, fresh_at) != 0,
    )
    return ReadCommand(True, receipts_at, numbers)


@kernel(inline=False)
def read_truth(payload: bytes) -> ReadTruth:
    """Read ``abreast_msgs/Truth``."""
    number_at = aligned(after_header(payload, begin(payload)), 4)
    at = aligned(number_at + 4, 8)
    if number_at < 0 or not fits(payload, at, _NUMBERS_BYTES) or not ends(payload, at + _NUMBERS_BYTES):
        return _NO_TRUTH
    stamp = read_stamp(payload, HEAD_BYTES)
    numbers = TruthNumbers(
        ns_of(stamp),
        read_uint32(payload, number_at),
        read_float(payload, at),
        read_float(payload, at + 8),
        read_float(payload, at + 16),
        read_float(payload, at + 24),
        read_float(payload, at + 32),
        read_float(payload, at + 40),
        read_float(payload, at + 48),
        read_float(payload, at + 56),
        read_float(payload, at + 64),
        read_float(payload, at + 72),
    )
    return ReadTruth(True, stamp, numbers)


@kernel(inline=False)
def write_command(
    buffer: Buffer, times_at: int, stops: bytes, numbers: CommandNumbers, receipts: Rows[Receipt]
) -> int:
    """Put a decision into a message whose frame stands there already; returns its length.

    ``times_at``: as :func:`hil.wire.templates.command_template` has it. ``stops``: the table that
    ``numbers.stop`` counts in. ``receipts``: of which the first ``numbers.consumed`` are meant.
    """
    n = numbers
    write_stamp(buffer, HEAD_BYTES, n.stamp_ns)
    at = write_stamp(buffer, write_stamp(buffer, times_at, n.capture_ns), n.measured_ns)
    at = aligned(at, 8)
    write_float(buffer, at, n.v2)
    write_float(buffer, at + 8, n.u2)
    write_float(buffer, at + 16, n.v2_wanted)
    write_float(buffer, at + 24, n.u2_wanted)
    write_byte(buffer, at + 32, 1 if n.saturated else 0)
    at = write_text(buffer, at + 33, stops, n.stop)
    write_byte(buffer, at, 1 if n.fresh else 0)
    return write_receipts(buffer, at + 1, receipts, n.consumed)


@kernel
def write_truth(buffer: Buffer, number_at: int, numbers: TruthNumbers) -> None:
    """Put true states into a message whose frame stands there already.

    ``number_at``: as :func:`hil.wire.templates.truth_template` has it.
    """
    n = numbers
    write_stamp(buffer, HEAD_BYTES, n.stamp_ns)
    write_int32(buffer, number_at, n.frame_number)
    at = aligned(number_at + 4, 8)
    write_float(buffer, at, n.leader_x)
    write_float(buffer, at + 8, n.leader_y)
    write_float(buffer, at + 16, n.leader_theta)
    write_float(buffer, at + 24, n.v1)
    write_float(buffer, at + 32, n.u1)
    write_float(buffer, at + 40, n.follower_x)
    write_float(buffer, at + 48, n.follower_y)
    write_float(buffer, at + 56, n.follower_theta)
    write_float(buffer, at + 64, n.v2)
    write_float(buffer, at + 72, n.u2)
