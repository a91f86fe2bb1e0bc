"""The extended bounds of many moments as compiled code."""

from __future__ import annotations

from estimation.bounds.live_bounds import ErrorBounds, LawConstants, Moment, bounds_at
from formation.kernel import entry
from formation.records import Matrix, Rows, load


@entry
def bound_all(moments: Matrix, laws: Rows[LawConstants], bounds: Matrix) -> None:
    """Fill in the bounds (3, n) of v1, alpha1 and h.

    ``moments`` (14, n): fields of :class:`~.live_bounds.Moment`, of :class:`~.live_bounds.ErrorBounds`, and
    v_eps, which takes the place of that of the law in the first row.
    """
    m, law = moments, load(LawConstants, laws, 0)
    for k in range(bounds.shape[1]):
        seen = Moment(m[0, k], m[1, k], m[2, k], m[3, k], m[4, k], m[5, k], m[6, k])
        errors = ErrorBounds(m[7, k], m[8, k], m[9, k], m[10, k], m[11, k], m[12, k])
        found = bounds_at(seen, errors, law._replace(v_eps=m[13, k]))
        bounds[0, k], bounds[1, k], bounds[2, k] = found.v1, found.alpha1, found.h
