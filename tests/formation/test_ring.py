from __future__ import annotations

from collections import deque
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from formation.kernel import entry, interpreted
from formation.records import Rows, load, rows_of, store
from formation.ring import EMPTY, Ring, place, without_oldest


class Item(NamedTuple):
    number: int


@entry
def pushed(rows: Rows[Item], first: int, length: int, number: int, dropped: int) -> Ring:
    ring = without_oldest(Ring(first, length), rows, dropped)
    store(rows, place(ring, rows, ring.length), Item(number))
    return Ring(ring.first, ring.length + 1)


def held(rows: Rows[Item], ring: Ring) -> list[int]:
    return [load(Item, rows, place(ring, rows, k)).number for k in range(ring.length)]


@pytest.mark.parametrize("push", [pushed, interpreted(pushed)], ids=["compiled", "plain"])
@pytest.mark.parametrize("room", [1, 2, 8])
@given(drops=st.lists(st.integers(0, 8), max_size=40))
def test_a_ring_is_a_queue_that_never_moves_what_it_holds(push: type, room: int, drops: list[int]) -> None:
    rows, ring, queue = rows_of(Item, room), EMPTY, deque[int]()
    for number, wanted in enumerate(drops):
        dropped = max(min(wanted, ring.length), ring.length + 1 - room)
        ring = push(rows, *ring, number, dropped)
        for _ in range(dropped):
            queue.popleft()
        queue.append(number)
        assert held(rows, ring) == list(queue)
        assert 0 <= ring.first < room


def test_lists_of_a_power_of_two_serve_as_rows_do() -> None:
    rows: list[Item] = [Item(k) for k in range(4)]
    assert [place(Ring(3, 3), rows, k) for k in range(4)] == [3, 0, 1, 2]  # type: ignore[arg-type]
