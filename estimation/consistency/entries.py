"""The Cramer-Rao bound along a path, compiled."""

from __future__ import annotations

from estimation.consistency.information import Least, Moment, Terms, carry
from formation.kernel import entry
from formation.records import Rows, borrowed, load


@entry
def carry_bounds(moments: Rows[Moment], terms: Rows[Terms], bounds: Rows[Least]) -> None:
    """See :func:`estimation.consistency.information.carry`."""
    carry(borrowed(moments), load(Terms, terms, 0), borrowed(bounds))
