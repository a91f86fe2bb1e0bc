"""A controller's decisions, ``abreast_msgs/Command``, and the true states, ``Truth``, written into bytes."""

from __future__ import annotations

from formation.kernel import kernel
from formation.records import Buffer, Rows, write_byte, write_float, write_int32
from hil.wire.cdr import HEAD_BYTES, aligned, write_stamp, write_text
from hil.wire.estimate_layout import write_receipts
from hil.wire.records import CommandNumbers, Receipt, TruthNumbers


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
