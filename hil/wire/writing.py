"""Writing what goes on the wire, for Python: bytes out of rows and numbers, by kernels.

A writer holds one message, in which names stand already, and fills it anew each time.
"""

from __future__ import annotations

from collections.abc import Sequence

from estimation.tracking.estimate import Estimate
from formation.pose import Motion
from formation.records import Rows, columns_of, row_of, rows_of
from hil.wire.assumed_errors import AssumedErrors
from hil.wire.cdr import packed_texts
from hil.wire.drive_message import drive_type
from hil.wire.records import Receipt
from hil.wire.templates import drive_template, estimate_template

MOST_RECEIPTS = 4096
"""Receipts that one message holds: odometry without any frame must not fill the memory."""


class ReceiptRows:
    """Receipts for kernels to read."""

    def __init__(self) -> None:
        self.rows = rows_of(Receipt, MOST_RECEIPTS)

    def fill(self, receipts: Sequence[Receipt]) -> int:
        """Hold these, at most :data:`MOST_RECEIPTS`, and tell how many there are."""
        columns_of(self.rows)[: len(receipts)] = list(receipts)
        return len(receipts)


class DriveWriter:
    """Writes drive commands, stamped or not, for the robot whose frame this is."""

    def __init__(self, frame_id: str, *, stamped: bool) -> None:
        from hil.wire import entries

        self._write = entries.write_drive
        self._template = drive_template(frame_id, stamped=stamped)
        self.typename = drive_type(stamped=stamped)

    def write(self, motion: Motion, stamp_ns: int) -> bytes:
        """Bytes of a command."""
        buffer, twist_at = self._template
        self._write(buffer, twist_at, stamp_ns, motion.v, motion.u)
        return buffer.tobytes()


class EstimateWriter:
    """Writes estimates in the frame of a follower, with the bounds that hold by what is assumed.

    ``reasons``: texts that estimates may go out with, by their number.
    """

    def __init__(self, frame_id: str, assumed: AssumedErrors, reasons: Sequence[str]) -> None:
        from hil.wire import entries

        self._write = entries.write_estimate
        self._template = estimate_template(frame_id, MOST_RECEIPTS)
        self._assumed = row_of(assumed)
        self._reasons = packed_texts(reasons)
        self._receipts = ReceiptRows()

    def write(
        self, estimates: Rows[Estimate], reason: int, now_ns: int, receipts: Sequence[Receipt]
    ) -> bytes:
        """Bytes of the estimate in a row, made at a time."""
        buffer, times_at = self._template
        consumed = self._receipts.fill(receipts)
        length = self._write(
            buffer,
            times_at,
            self._reasons,
            estimates,
            self._assumed,
            reason,
            now_ns,
            self._receipts.rows,
            consumed,
        )
        return self._template.payload(length)
