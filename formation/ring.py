"""A ring over rows: the last few records of something, without moving any of them.

The rows' number is a power of two, so that a place wraps round by a mask.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from formation.kernel import kernel
from formation.records import Rows, size


class Ring(NamedTuple):
    """Where in its rows a ring begins, and how many records it holds."""

    first: int
    length: int


EMPTY = Ring(0, 0)


@kernel
def place(ring: Ring, rows: Rows[Any], k: int) -> int:
    """Row of the ring's k-th record, the oldest being the 0th; k may be ``length``, the next to be filled."""
    return (ring.first + k) & (size(rows) - 1)


@kernel
def without_oldest(ring: Ring, rows: Rows[Any], dropped: int) -> Ring:
    """Ring without its oldest records."""
    return Ring(place(ring, rows, dropped), ring.length - dropped)
