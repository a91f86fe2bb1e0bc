from __future__ import annotations

import pytest

from formation.kernel import entry, interpreted
from formation.records import Rows, load, rows_of
from hil.nodes.receipt_list import with_receipt
from hil.wire.records import Receipt


@entry
def received(receipts: Rows[Receipt], count: int, digest: int, now_ns: int) -> int:
    return with_receipt(receipts, count, digest, now_ns)


@pytest.mark.parametrize("put", [received, interpreted(received)], ids=["compiled", "plain"])
@pytest.mark.parametrize("room", [1, 2, 5])
def test_the_newest_receipts_are_kept_in_the_order_of_reception(put: type, room: int) -> None:
    receipts, made, count = rows_of(Receipt, room), list[Receipt](), 0
    for k in range(3 * room):
        made.append(Receipt(1000 - k, 7 * k))
        count = put(receipts, count, *made[-1])
        assert [load(Receipt, receipts, each) for each in range(count)] == made[-room:]
