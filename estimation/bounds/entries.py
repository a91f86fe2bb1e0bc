"""The extended bounds of many moments as compiled code."""

from __future__ import annotations

from estimation.bounds.live_bounds import ErrorBounds, LawConstants, Moment, bounds_at
from formation.kernel import entry
from formation.records import Matrix, Rows, load


@entry
def bound_all(moments: Matrix, laws: Rows[LawConstants], bounds: Matrix) -> None:
    """Fill in bounds (3 s, n): those of v1, alpha1 and h for each of s sets of errors.

    ``moments`` (8 + 6 s, n): fields of :class:`~.live_bounds.Moment`; v_eps, which takes the place of that of
    the law in the first row; fields of :class:`~.live_bounds.ErrorBounds`, set by set.
    """
    m, law = moments, load(LawConstants, laws, 0)
    for k in range(bounds.shape[1]):
        seen = Moment(m[0, k], m[1, k], m[2, k], m[3, k], m[4, k], m[5, k], m[6, k])
        here = law._replace(v_eps=m[7, k])
        for s in range(bounds.shape[0] // 3):
            e = 8 + 6 * s
            errors = ErrorBounds(m[e, k], m[e + 1, k], m[e + 2, k], m[e + 3, k], m[e + 4, k], m[e + 5, k])
            found = bounds_at(seen, errors, here)
            bounds[3 * s, k], bounds[3 * s + 1, k], bounds[3 * s + 2, k] = found.v1, found.alpha1, found.h
