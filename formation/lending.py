"""All rows that an entry works in, lent to it at once."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from formation.kernel import compiles
from formation.records import R, Rows, columns_of, rows_of


def lent(record: R) -> Rows[R]:
    """One row that holds a named tuple of rows and arrays by where these lie, for an entry to work in all.

    The row keeps none of them alive: whoever made them holds on to ``record`` as long. Where entries are
    plain Python, they get the record itself, in a list.
    """
    if not compiles():
        return cast("Rows[R]", [record])
    rows = rows_of(type(record), 1)
    columns_of(rows)[0] = _spans(record)
    return rows


def _spans(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.__array_interface__["data"][0], len(value)
    return tuple(map(_spans, value)) if isinstance(value, tuple) else value
