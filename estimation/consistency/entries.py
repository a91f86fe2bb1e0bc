"""The Cramer-Rao bound along a path, compiled."""

from __future__ import annotations

from estimation.consistency.information import Least, Path, Terms, carry
from formation.kernel import entry
from formation.records import Flags, Indices, Matrix, Rows, borrowed, load


@entry
def carry_bounds(
    capture_ns: Indices,
    leader: Matrix,
    follower: Matrix,
    motion: Matrix,
    measured: Flags,
    wanted: Flags,
    terms: Rows[Terms],
    bounds: Rows[Least],
) -> None:
    """See :func:`estimation.consistency.information.carry`, whose path the first six are."""
    path = Path(capture_ns, leader, follower, motion, measured, wanted)
    carry(path, load(Terms, terms, 0), borrowed(bounds))
