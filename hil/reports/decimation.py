"""Decimation: fewer points than a screen can show, with every peak still there."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray

MOST_POINTS = 2000
"""Of a line; a panel on a desk is some 600 pixels wide, and one can zoom in a little."""


def decimated_rows(values: FloatArray, most: int = MOST_POINTS) -> NDArray[np.intp]:
    """Rows, in order, that draw the same line: of every stretch its least and its largest value.

    ``values`` (n,). First and last row are kept, and so is the first NaN of every gap, that the line stays
    broken where it was; those come on top of ``most``. All rows if there are no more than ``most``.
    """
    n = len(values)
    if n <= most:
        return np.arange(n)
    width = math.ceil(n / max(1, (most - 2) // 2))
    stretches = math.ceil(n / width)
    padded = np.full(stretches * width, math.nan)
    padded[:n] = values
    table = padded.reshape(stretches, width)
    known = np.isfinite(table)
    starts = np.arange(stretches) * width
    least = starts + np.where(known, table, math.inf).argmin(axis=1)
    largest = starts + np.where(known, table, -math.inf).argmax(axis=1)
    gap = ~np.isfinite(values)
    gap_starts = np.flatnonzero(gap & ~np.concatenate([[False], gap[:-1]]))
    return np.unique(np.concatenate([[0, n - 1], least, largest, gap_starts]))


def spread_rows(n: int, most: int) -> NDArray[np.intp]:
    """At most ``most`` of n rows, evenly spread, the first and the last among them."""
    return np.arange(n) if n <= most else np.unique(np.linspace(0, n - 1, most).round().astype(np.intp))
