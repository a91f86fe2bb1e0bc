"""The rows below the heading of an export: numbers by column, at times that increase."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path
from typing import NamedTuple

import numpy as np

from formation.angles import FloatArray
from hil.errors import UsageError
from hil.recordings.delimited import Layout, find_layout, is_cut, numbers, read_cells, split_line, texts
from hil.recordings.pair_log import Times
from hil.recordings.text_file import Text
from hil.recordings.time_column import later, read_times

_NS = 1_000_000_000
_DAMAGED_SHARE = 0.1


class ExportCells(NamedTuple):
    """Columns (n,) by their place, NaN where a cell is empty, and the times of the rows.

    ``damage``: lines that are no rows, each with what is wrong.
    """

    t_ns: Times
    columns: dict[int, FloatArray]
    damage: tuple[str, ...]


class Place(NamedTuple):
    """Where rows are: from the line ``first`` on, counted from 0, each with ``width`` cells."""

    first: int
    width: int
    layout: Layout


def read_export(
    path: Path, text: Text, place: Place, wanted: Sequence[int], period_s: float = 0.0
) -> ExportCells:
    """Read the rows of a place in a text.

    ``wanted``: places of columns; the first of them holds times [s], or none does and rows are ``period_s``
    apart. Raises :class:`UsageError` if there are no rows, or if more than one in ten is none.
    """
    numbered = [(k + 1, line) for k, line in enumerate(text.lines) if k >= place.first and line.strip()]
    if not numbered:
        raise UsageError(f"recording {path}: has a heading but no rows")
    delimiter = place.layout.delimiter
    found = find_layout([line for _, line in numbered[:40]], delimiter)
    width = _width(place.width, [split_line(line, delimiter) for _, line in numbered[:20]])
    cells = read_cells(numbered, [str(k) for k in range(width)], found, [str(k) for k in wanted])
    damaged = dict(cells.damaged)
    lines = cells.lines.tolist()
    columns: dict[int, FloatArray] = {}
    measured = wanted if period_s else wanted[1:]
    for k in measured:
        columns[k], wrong = numbers(cells.columns[str(k)], found.decimal)
        for row, cell in wrong.items():
            damaged.setdefault(lines[row], f"has {cell!r} in column {k + 1}, expected a number")
    if period_s:
        t_ns = np.array([round(k * period_s * _NS) for k in range(len(lines))], dtype=np.int64)
    else:
        times = read_times(texts(cells.columns[str(wanted[0])]), Decimal(1), Decimal(0), found.decimal)
        t_ns = times.t_ns
    if not text.whole and (numbered[-1][0] in damaged or is_cut(numbered, found)):
        damaged[numbered[-1][0]] = "is cut off"
    kept = _increasing(t_ns, lines, damaged)
    _refuse_another_file(path, damaged, len(numbered))
    damage = (*text.damage, *(f"line {line} {fault}" for line, fault in sorted(damaged.items())))
    return ExportCells(t_ns[kept], {k: values[kept] for k, values in columns.items()}, damage)


def _width(width: int, some: Sequence[Sequence[str]]) -> int:
    """Cells of a row: as many as the heading's, or one less or more where that is an empty one at its end."""
    count = max(set(map(len, some)), key=list(map(len, some)).count)
    return count if abs(count - width) == 1 else width


def _increasing(t_ns: Times, lines: Sequence[int], damaged: dict[int, str]) -> Times:
    """Rows that are no damaged ones, each later than all before it."""
    rows = np.flatnonzero(~np.isin(lines, list(damaged))) if damaged else np.arange(len(lines))
    good = later(t_ns[rows])
    for row in rows[~good].tolist():
        wrong = "has no time" if t_ns[row] < 0 else "has a time not after that of the row before"
        damaged[lines[row]] = wrong
    return rows[good]


def _refuse_another_file(path: Path, damaged: dict[int, str], count: int) -> None:
    faults = {line: what for line, what in damaged.items() if what != "is cut off"}
    if len(faults) > _DAMAGED_SHARE * count:
        line = min(faults)
        raise UsageError(
            f"recording {path}: line {line} {faults[line]}; {len(faults)} of {count} lines are "
            "such; export it anew"
        )
    if len(damaged) == count:
        raise UsageError(f"recording {path}: has a heading but no rows")
