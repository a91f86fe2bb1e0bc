"""Reading a CSV recording by its column map: every cell is checked before anything is made of it."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from typing import NamedTuple

import numpy as np

from formation.angles import FloatArray
from hil.errors import UsageError
from hil.recordings.column_map import ColumnMap, Source
from hil.recordings.delimited import (
    Cells,
    Layout,
    find_layout,
    is_comment,
    is_cut,
    numbers,
    read_cells,
    split_line,
    texts,
)
from hil.recordings.known_columns import bracketed
from hil.recordings.pair_log import Times
from hil.recordings.text_file import Text
from hil.recordings.time_column import later, read_times
from hil.recordings.units import factor_of, is_unit

_DAMAGED_SHARE = 0.1
"""Where more lines than this are no rows, the file is another one than it is taken for."""

GROUPS = (
    ("rho", "alpha2"),
    ("leader_x", "leader_y", "leader_z"),
    ("follower_x", "follower_y", "follower_z", "follower_theta"),
    ("follower_qx", "follower_qy", "follower_qz", "follower_qw"),
    ("v2", "u2"),
)
"""Quantities that make sense together only: a row has all of a group, or none."""


class Heading(NamedTuple):
    """Names of a table's columns, the units of some, and its rows' lines with their numbers."""

    names: list[str]
    units: dict[str, str]
    layout: Layout
    rows: list[tuple[int, str]]


class Table(NamedTuple):
    """Columns of a file by quantity, (n,) each in SI units, NaN where a row has none.

    ``times``: what the times were. ``damaged``: what was left out, by line.
    """

    t_ns: Times
    columns: dict[str, FloatArray]
    truth: dict[str, FloatArray]
    times: str
    damaged: dict[int, str]


def read_heading(path: Path, text: Text, delimiter: str | None, decimal: str | None) -> Heading:
    """Find the line of column names, and the layout of the table below it.

    Columns of a table without names are called 1, 2, 3. Raises :class:`UsageError` for a file without rows.
    """
    numbered = [(number, line) for number, line in enumerate(text.lines, 1) if line.strip()]
    rows = [(number, line) for number, line in numbered if not is_comment(line)]
    if not rows:
        raise UsageError(f"recording {path}: is empty; expected a line of column names, then rows")
    layout = find_layout([line for _, line in rows], delimiter, decimal)
    names = split_line(rows[0][1], layout.delimiter)
    if not any(_is_number(cell, layout) for cell in names):
        rows = rows[1:]
    else:
        above = [line.lstrip(' "#%/') for number, line in numbered if number < rows[0][0]]
        told = split_line(above[-1], layout.delimiter) if above else []
        names = told if len(told) == len(names) else [str(k + 1) for k in range(len(names))]
    if not rows:
        raise UsageError(f"recording {path}: has column names but no rows")
    units: dict[str, str] = {}
    cells = split_line(rows[0][1], layout.delimiter)
    if len(cells) <= len(names) and any(map(is_unit, filter(None, cells))) and all(map(is_unit, cells)):
        units = {name: cell for name, cell in zip(names, cells, strict=False) if cell}
        rows = rows[1:]
    return Heading(_fitting(names, rows, layout), units, layout, rows)


def read_table(path: Path, text: Text, heading: Heading, chart: ColumnMap) -> Table:
    """Read all rows of a table.

    Sources of different rates may share one table: a row has what its cells hold, and where all cells of a
    group are empty there is nothing of that source at its time. Lines that are no rows are left out.
    Raises :class:`UsageError` naming line and column for a column that isn't there (naming the nearest one);
    if more than one line in ten is no row: has the wrong length, a cell that isn't a finite number, a group
    of which only some cells are filled, or a time that repeats or runs backwards; and for a file that has
    no rows, or no measurement.
    """
    used = _used(path, heading, chart)
    cells = read_cells(heading.rows, heading.names, heading.layout, sorted(used))
    reader = _Reader(path, text, heading, chart, cells)
    t_ns, times = reader.times()
    columns, truth = reader.values(chart.columns), reader.values(chart.truth)
    for group in GROUPS:
        reader.whole_group(group, columns)
    kept = reader.kept(t_ns)
    reader.refuse_another_file()
    if not len(kept):
        raise UsageError(f"recording {path}: has column names but no rows")
    columns, truth = ({name: all_[kept] for name, all_ in some.items()} for some in (columns, truth))
    _check_measured(path, chart, columns)
    return Table(t_ns[kept], columns, truth, times, dict(sorted(reader.damaged.items())))


class _Reader:
    """The cells of one file, and which of its lines are no rows."""

    def __init__(self, path: Path, text: Text, heading: Heading, chart: ColumnMap, cells: Cells) -> None:
        self.path, self.heading, self.chart, self.cells = path, heading, chart, cells
        self.damaged = dict(cells.damaged)
        self._last = heading.rows[-1][0] if heading.rows else 0
        self._cut = not text.whole
        if self._cut and (self._last in self.damaged or is_cut(heading.rows, heading.layout)):
            self.damaged[self._last] = "is cut off"

    def times(self) -> tuple[Times, str]:
        source = self.chart.columns["t"]
        if source.column is None:
            raise UsageError(f"{self.chart.name}: columns.t is a constant, expected a column of times")
        scale = Decimal(str(source.factor("t", told_unit(self.heading, "t", source))))
        cells = texts(self.cells.columns[source.column])
        found = read_times(cells, scale, Decimal(str(source.offset)), self.heading.layout.decimal)
        for row in np.flatnonzero(found.t_ns < 0).tolist():
            shown = repr(cells[row]) if cells[row] else "empty"
            self._fault(row, source, f"{shown}, expected a time from 0 to 2038")
        return found.t_ns, found.kind

    def values(self, sources: Mapping[str, Source]) -> dict[str, FloatArray]:
        found: dict[str, FloatArray] = {}
        for name, source in sources.items():
            if name == "t":
                continue
            if source.constant is not None:
                found[name] = np.full(len(self.cells.lines), source.constant)
                continue
            column = self.cells.columns[source.column or ""]
            values, wrong = numbers(column, self.heading.layout.decimal)
            for row, cell in wrong.items():
                self._fault(row, source, f"{cell!r}, expected a finite number")
            with np.errstate(over="ignore"):
                found[name] = (
                    values * source.factor(name, told_unit(self.heading, name, source)) + source.offset
                )
            for row in np.flatnonzero(np.isinf(found[name])).tolist():
                self._fault(row, source, "is not finite; correct scale and offset")
                found[name][row] = np.nan
        return found

    def whole_group(self, group: Sequence[str], columns: dict[str, FloatArray]) -> None:
        """Take rows that have only a part of a group for damaged; constants are there if the rest is."""
        given = [name for name in group if name in columns and self.chart.columns[name].column is not None]
        if not given:
            return
        there = np.column_stack([np.isfinite(columns[name]) for name in given])
        for row in np.flatnonzero(there.any(axis=1) & ~there.all(axis=1)).tolist():
            missing = self.chart.columns[given[int(np.argmin(there[row]))]]
            beside = self.chart.columns[given[int(np.argmax(there[row]))]].column
            self._fault(
                row, missing, f"empty, expected a number as in column {beside!r}, which belongs to it"
            )
        for name in group:
            if name in columns:
                columns[name] = np.where(there.all(axis=1), columns[name], np.nan)

    def kept(self, t_ns: Times) -> Times:
        """Rows that are some: undamaged, each later than all before it."""
        rows = np.flatnonzero(~np.isin(self.cells.lines, list(self.damaged)))
        times = t_ns[rows]
        good = later(times)
        for k in np.flatnonzero(~good).tolist():
            newest = int(times[:k].max())
            fault = "repeats that" if times[k] == newest else "runs backwards from the one"
            self._fault(
                int(rows[k]),
                self.chart.columns["t"],
                f"time {times[k] * 1e-9:.9g} s {fault} of the row before ({newest * 1e-9:.9g} s)",
            )
        return rows[good]

    def refuse_another_file(self) -> None:
        """Raise :class:`UsageError` if too much of the file is no table as the map says."""
        faults = {line: what for line, what in self.damaged.items() if what != "is cut off"}
        if len(faults) > _DAMAGED_SHARE * len(self.heading.rows):
            line = min(faults)
            several = (
                f" ({len(faults)} of {len(self.heading.rows)} lines are such)" if len(faults) > 1 else ""
            )
            raise UsageError(
                f"recording {self.path}: line {line}{_joined(faults[line])}; "
                f"correct the file or the map{several}"
            )

    def _fault(self, row: int, source: Source, what: str) -> None:
        line = int(self.cells.lines[row])
        cut = self._cut and line == self._last
        self.damaged.setdefault(line, "is cut off" if cut else f", column {source.column!r}: {what}")


def told_unit(heading: Heading, quantity: str, source: Source) -> str | None:
    """The unit of a column that a map or else the file tells, in a line below the names or in brackets."""
    if source.scale is not None:
        return None
    name = source.column or ""
    told = source.unit or heading.units.get(name) or bracketed(name)[1]
    return told if told is not None and factor_of(quantity, told) is not None else None


def _joined(fault: str) -> str:
    return fault if fault.startswith(",") else f" {fault}"


def _is_number(cell: str, layout: Layout) -> bool:
    try:
        float(cell.replace(layout.decimal, "."))
    except ValueError:
        return False
    return True


def _fitting(names: list[str], rows: Sequence[tuple[int, str]], layout: Layout) -> list[str]:
    """Names, with or without a nameless column at their end as most of the first rows have one."""
    some = [split_line(line, layout.delimiter) for _, line in rows[:20]]
    if names[-1] == "" and all(len(cells) == len(names) - 1 for cells in some):
        return names[:-1]
    if some and all(len(cells) == len(names) + 1 and cells[-1] == "" for cells in some):
        return [*names, ""]
    return names


def _used(path: Path, heading: Heading, chart: ColumnMap) -> set[str]:
    """Columns that a map asks for; :class:`UsageError` unless each is there once."""
    used: set[str] = set()
    for source in (*chart.columns.values(), *chart.truth.values()):
        column = source.column
        if column is None or column in used:
            continue
        count = heading.names.count(column)
        if count > 1:
            raise UsageError(f"recording {path}: line 1: column {column!r} is there {count} times")
        if count == 0:
            near = difflib.get_close_matches(column, heading.names, n=1, cutoff=0.4)
            hint = f"did you mean {near[0]!r}?" if near else f"columns there: {', '.join(heading.names)}"
            raise UsageError(
                f"recording {path}: line 1: column {column!r} of {chart.name} is missing; {hint}"
            )
        used.add(column)
    return used


def _check_measured(path: Path, chart: ColumnMap, columns: Mapping[str, FloatArray]) -> None:
    for wanted in ("rho",) if chart.sighted else ("leader_x", "follower_x"):
        if not np.isfinite(columns[wanted]).any():
            source = chart.columns[wanted]
            raise UsageError(
                f"recording {path}: column {source.column!r} is empty in all rows; correct the map"
            )
