"""Writes what a controller decides: the drive command, and the record of why."""

from __future__ import annotations

from collections.abc import Sequence

from controllers.follower import Command
from controllers.guard import StopReason
from formation.records import Rows
from hil.nodes.controller_entries import tell_command
from hil.nodes.controller_step import ControlState
from hil.wire.cdr import packed_texts
from hil.wire.records import Receipt
from hil.wire.templates import command_template
from hil.wire.writing import MOST_RECEIPTS, ReceiptRows

_STOPS = packed_texts(["", *(reason.value for reason in sorted(StopReason, key=lambda reason: reason.code))])


class CommandWriter:
    """Writes the decisions of the controller of the follower whose frame this is."""

    def __init__(self, frame_id: str) -> None:
        self._template = command_template(frame_id, MOST_RECEIPTS)
        self._receipts = ReceiptRows()

    def write(
        self,
        control: Rows[ControlState],
        result: Rows[Command],
        receipts: Sequence[Receipt],
        now_ns: int,
        *,
        fresh: bool,
    ) -> bytes:
        """Bytes of the decision in ``result``, with the state after it."""
        buffer, times_at = self._template
        consumed, rows = self._receipts.fill(receipts), self._receipts.rows
        length = tell_command(buffer, times_at, _STOPS, control, result, rows, consumed, fresh, now_ns)
        return self._template.payload(length)
