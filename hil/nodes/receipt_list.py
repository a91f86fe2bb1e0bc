"""Receipts of what a node has taken in since its last message, oldest first, in rows."""

from __future__ import annotations

from formation.kernel import kernel
from formation.records import Rows, load, size, store
from hil.wire.records import Receipt


@kernel
def with_receipt(receipts: Rows[Receipt], count: int, digest: int, now_ns: int) -> int:
    """Put a receipt after ``count`` others; the oldest goes where there is no room. The new count."""
    if count == size(receipts):
        count -= 1
        for k in range(count):
            store(receipts, k, load(Receipt, receipts, k + 1))
    store(receipts, count, Receipt(digest, now_ns))
    return count + 1
