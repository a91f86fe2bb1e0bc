"""Reading a CSV recording by its column map: every cell is checked before anything is made of it."""

from __future__ import annotations

import csv
import difflib
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import NamedTuple

from hil.errors import UsageError
from hil.recordings.column_map import ColumnMap, Source

_LAST_NS = 2**31 * 1_000_000_000


@dataclass(frozen=True, slots=True)
class Row:
    """One row: its time, and the values that the map gives it by quantity; empty cells have none."""

    t_ns: int
    columns: Mapping[str, float]
    truth: Mapping[str, float]


class Table(NamedTuple):
    """Rows of a file, and ``torn``: the last line, left out since the file was cut off in it; 0 for none."""

    rows: list[Row]
    torn: int


GROUPS = (
    ("rho", "alpha2"),
    ("leader_x", "leader_y"),
    ("follower_x", "follower_y", "follower_theta"),
    ("v2", "u2"),
)
"""Quantities that make sense together only: a row has all of a group, or none."""


def read_rows(path: Path, chart: ColumnMap) -> list[Row]:
    """Rows of :func:`read_table`."""
    return read_table(path, chart).rows


def read_table(path: Path, chart: ColumnMap) -> Table:
    """Read all rows of a CSV file; the first line names the columns.

    Sources of different rates may share one table: a row has what its cells hold, and where all cells of a
    group are empty there is nothing of that source at its time. A last line that ends before its time, in a
    file without a line's end, is left out.
    Raises :class:`UsageError` naming line and column for a column that isn't there (naming the nearest one),
    a cell that isn't a finite number, a group of which only some cells are filled, a row of the wrong
    length, and times that repeat or run backwards; and for a file that cannot be read, has no rows, or no
    measurement.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            text = stream.read()
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=chart.delimiter, strict=True)
        lines = [(reader.line_num, cells) for cells in reader]
    except FileNotFoundError:
        raise UsageError(f"recording {path}: no such file; check the path") from None
    except OSError as error:
        raise UsageError(f"recording {path}: cannot be read ({error.strerror})") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise UsageError(f"recording {path}: not readable as CSV ({error}); expected UTF-8 text") from None
    torn = 0
    if len(lines) > 2 and not text.endswith(("\n", "\r")) and len(lines[-1][1]) < len(lines[0][1]):
        torn = lines.pop()[0]
    return Table(_rows(iter(lines), path, chart), torn)


def _rows(lines: Iterator[tuple[int, Sequence[str]]], path: Path, chart: ColumnMap) -> list[Row]:
    _, first = next(lines, (1, []))
    names = [name.strip() for name in first]
    if not any(names):
        raise UsageError(f"recording {path}: is empty; expected a line of column names, then rows")
    table = _Table(path, names, chart)
    rows: list[Row] = []
    for line, cells in lines:
        if not any(cell.strip() for cell in cells):
            continue
        row = table.row(line, cells)
        if rows and row.t_ns <= rows[-1].t_ns:
            fault = "repeats that" if row.t_ns == rows[-1].t_ns else "runs backwards from the one"
            raise UsageError(
                f"{table.where(line, chart.columns['t'])}: time {row.t_ns * 1e-9:.9g} s {fault} of the row "
                f"before ({rows[-1].t_ns * 1e-9:.9g} s); sort the rows by time, one for each"
            )
        rows.append(row)
    if not rows:
        raise UsageError(f"recording {path}: has column names but no rows")
    wanted = "rho" if chart.sighted else "leader_x"
    if not any(wanted in row.columns for row in rows):
        source = chart.columns[wanted]
        raise UsageError(f"recording {path}: column {source.column!r} is empty in all rows; correct the map")
    return rows


class _Table:
    """The columns of one file, and how to read a row of it."""

    def __init__(self, path: Path, names: Sequence[str], chart: ColumnMap) -> None:
        self.path, self.names, self.chart = path, names, chart
        self._places: dict[str, int] = {}
        for source in (*chart.columns.values(), *chart.truth.values()):
            if source.column is not None:
                self._places[source.column] = self._place(source.column)

    def row(self, line: int, cells: Sequence[str]) -> Row:
        """Values of a row."""
        if len(cells) != len(self.names):
            raise UsageError(
                f"recording {self.path}: line {line} has {len(cells)} cells, expected {len(self.names)} "
                "as in the line of column names"
            )
        columns = self._values(line, cells, self.chart.columns)
        for group in GROUPS:
            if not self._has_group(line, cells, group):
                columns = {name: value for name, value in columns.items() if name not in group}
        return Row(self._time_ns(line, cells), columns, self._values(line, cells, self.chart.truth))

    def where(self, line: int, source: Source) -> str:
        """Place of a cell, for messages."""
        return f"recording {self.path}: line {line}, column {source.column!r}"

    def _values(self, line: int, cells: Sequence[str], sources: Mapping[str, Source]) -> dict[str, float]:
        return {
            name: self._value(line, cells, source)
            for name, source in sources.items()
            if name != "t" and (source.constant is not None or self._filled(cells, source))
        }

    def _filled(self, cells: Sequence[str], source: Source) -> bool:
        """Whether a source's cell holds something."""
        return source.column is None or bool(cells[self._places[source.column]].strip())

    def _has_group(self, line: int, cells: Sequence[str], group: Sequence[str]) -> bool:
        """Whether a row has a group; of constants alone it is always there."""
        given = self.chart.columns
        sources = [given[name] for name in group if name in given and given[name].column is not None]
        empty = [source for source in sources if not self._filled(cells, source)]
        if empty and len(empty) < len(sources):
            there = next(source.column for source in sources if source not in empty)
            raise UsageError(
                f"{self.where(line, empty[0])}: empty, expected a number as in column {there!r}, "
                "which belongs to it; fill or empty both"
            )
        return not empty

    def _place(self, column: str) -> int:
        found = [place for place, name in enumerate(self.names) if name == column]
        if len(found) == 1:
            return found[0]
        if found:
            raise UsageError(f"recording {self.path}: line 1: column {column!r} is there {len(found)} times")
        near = difflib.get_close_matches(column, self.names, n=1, cutoff=0.4)
        hint = f"did you mean {near[0]!r}?" if near else f"columns there: {', '.join(self.names)}"
        raise UsageError(
            f"recording {self.path}: line 1: column {column!r} of map {self.chart.path} is missing; {hint}"
        )

    def _value(self, line: int, cells: Sequence[str], source: Source) -> float:
        if source.constant is not None:
            return source.constant
        value = float(self._number(line, cells, source)) * source.scale + source.offset
        if not math.isfinite(value):
            raise UsageError(f"{self.where(line, source)}: {value} is not finite; correct scale and offset")
        return value

    def _time_ns(self, line: int, cells: Sequence[str]) -> int:
        source = self.chart.columns["t"]
        if source.column is None:
            raise UsageError(f"map {self.chart.path}: columns.t is a constant, expected a column of times")
        # Decimal, as a float of seconds since 1970 is off by a tenth of a microsecond.
        seconds = self._number(line, cells, source) * Decimal(str(source.scale)) + Decimal(str(source.offset))
        t_ns = round(seconds * 1_000_000_000)
        if not 0 <= t_ns < _LAST_NS:
            raise UsageError(
                f"{self.where(line, source)}: time {seconds} s, expected 0 or later and before 2038; "
                "set scale or offset of t in the map"
            )
        return t_ns

    def _number(self, line: int, cells: Sequence[str], source: Source) -> Decimal:
        text = cells[self._places[source.column or ""]].strip()
        try:
            number = Decimal(text.replace("_", "?"))
        except InvalidOperation:
            shown = repr(text) if text else "empty"
            raise UsageError(f"{self.where(line, source)}: {shown}, expected a number") from None
        if not number.is_finite():
            raise UsageError(f"{self.where(line, source)}: {text}, expected a finite number")
        return number
