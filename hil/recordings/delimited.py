"""Tables of text: what separates their cells, what their columns are called, and their cells as numbers."""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
from numpy.typing import NDArray

from formation.angles import FloatArray

EMPTY = frozenset({"", "nan", "na", "n/a", "null", "none", "nil", "-", "--", "-nan", "nan(ind)", "-nan(ind)"})
"""Cells that say that there is nothing, in lower case."""

_DELIMITERS = "\t;,|"
_SAMPLE = 40
_COMMENT = re.compile(r'[ "]*(?:#|%|//)')
_COMMA_NUMBER = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")


class Layout(NamedTuple):
    """What separates cells, a blank for runs of white space, and the sign before decimals."""

    delimiter: str
    decimal: str

    @property
    def words(self) -> str:
        """What to call it."""
        names = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", " ": "white space"}
        separated = names.get(self.delimiter, repr(self.delimiter))
        return f"{separated}, decimal comma" if self.decimal == "," else separated


class Cells(NamedTuple):
    """Cells of a table by column, and the numbers of the lines that its rows stand in.

    ``damaged``: numbers of lines that are no rows of it, each with what is wrong.
    """

    columns: dict[str, pa.ChunkedArray]
    lines: NDArray[np.int64]
    damaged: dict[int, str]


def split_line(line: str, delimiter: str) -> list[str]:
    """Cells of one line, without blanks around them; quotes that are not closed are part of a cell."""
    if delimiter == " ":
        return line.split()
    try:
        (cells,) = csv.reader([line], delimiter=delimiter, skipinitialspace=True)
    except (csv.Error, ValueError):
        cells = line.split(delimiter)
    return [cell.strip() for cell in cells]


def is_comment(line: str) -> bool:
    """Whether a line is a comment."""
    return _COMMENT.match(line) is not None


def find_layout(lines: Sequence[str], delimiter: str | None = None, decimal: str | None = None) -> Layout:
    """Find out what separates the cells of a table's first lines, comments left out, unless it is told."""
    sample = [line for line in lines if line.strip()][:_SAMPLE]
    if delimiter is None:
        delimiter = _delimiter(sample)
    if decimal is None:
        cells = [cell for line in sample[1:] for cell in split_line(line, delimiter)]
        # Between commas such a cell is one in quotes.
        decimal = "," if any(_COMMA_NUMBER.fullmatch(cell) for cell in cells) else "."
    return Layout(delimiter, decimal)


def _delimiter(sample: Sequence[str]) -> str:
    """The sign that most lines have as often as each other, and the first of them has too."""
    best, rank = " ", (0.0, 0)
    for sign in _DELIMITERS:
        counts = [len(split_line(line, sign)) - 1 for line in sample]
        if not counts or counts[0] == 0:
            continue
        common, times = Counter(counts).most_common(1)[0]
        if common and (times / len(counts), common) > rank:
            best, rank = sign, (times / len(counts), common)
    return best


def is_cut(rows: Sequence[tuple[int, str]], layout: Layout) -> bool:
    """Whether the last row ends within a number: all before it have more decimals in their last cell."""
    *before, last = (split_line(line, layout.delimiter) for _, line in rows[-_SAMPLE:])
    places = {_decimals(cells[-1], layout.decimal) for cells in before if cells}
    if len(places) != 1 or not last or not last[-1]:
        return False
    return _decimals(last[-1], layout.decimal) < places.pop()


def _decimals(cell: str, decimal: str) -> int:
    return len(cell.partition(decimal)[2])


def read_cells(
    numbered: Sequence[tuple[int, str]], names: Sequence[str], layout: Layout, wanted: Collection[str]
) -> Cells:
    """Read the rows of a table into columns of text.

    ``numbered``: its lines with their numbers, neither blank ones nor comments. ``names``: of all columns,
    no two alike. ``wanted``: those to read.
    """
    damaged: dict[int, str] = {}
    kept: list[tuple[int, str]] = []
    for number, line in numbered:
        fault = _fault(line)
        if fault is None:
            kept.append((number, line))
        else:
            damaged[number] = fault
    if layout.delimiter == " ":
        kept = [(number, "\t".join(line.split())) for number, line in kept]
    wrong: dict[int, str] = {}

    def skip(row: pacsv.InvalidRow) -> str:
        cells = f"{row.actual_columns} cell{'s' if row.actual_columns != 1 else ''}"
        wrong[row.number - 1] = f"has {cells}, expected {row.expected_columns}"
        return "skip"

    table = _parsed([line for _, line in kept], names, layout, wanted, skip)
    damaged |= {kept[k][0]: fault for k, fault in wrong.items()}
    lines = np.array([number for k, (number, _) in enumerate(kept) if k not in wrong], dtype=np.int64)
    return Cells({name: table.column(name) for name in wanted}, lines, damaged)


def _fault(line: str) -> str | None:
    if "\0" in line:
        return "holds zero bytes"
    return "has a quote that is not closed" if line.count('"') % 2 else None


def _parsed(
    lines: Sequence[str], names: Sequence[str], layout: Layout, wanted: Collection[str], skip: object
) -> pa.Table:
    text = pa.string()
    if not lines:
        return pa.table({name: pa.array([], text) for name in wanted})
    body = io.BytesIO("\n".join(lines).encode("utf-8", errors="replace"))
    longest = max(len(line) for line in lines)
    return pacsv.read_csv(
        body,
        # One thread, as the number of a line that does not fit is known to that alone.
        read_options=pacsv.ReadOptions(
            use_threads=False, column_names=list(names), block_size=max(1 << 22, 8 * longest)
        ),
        parse_options=pacsv.ParseOptions(
            delimiter="\t" if layout.delimiter == " " else layout.delimiter, invalid_row_handler=skip
        ),
        convert_options=pacsv.ConvertOptions(
            column_types=dict.fromkeys(wanted, text),
            include_columns=list(wanted),
            strings_can_be_null=False,
        ),
    )


def texts(column: pa.ChunkedArray) -> list[str]:
    """Cells without blanks around them."""
    stripped: list[str] = pc.utf8_trim_whitespace(column).to_pylist()
    return stripped


def numbers(column: pa.ChunkedArray, decimal: str) -> tuple[FloatArray, dict[int, str]]:
    """Cells as numbers, NaN where there is nothing, and those that are no finite numbers by their row."""
    cells = pc.utf8_trim_whitespace(column)
    empty = pc.is_in(pc.utf8_lower(cells), value_set=pa.array(sorted(EMPTY)))
    cells = pc.if_else(empty, pa.scalar(None, pa.string()), cells)
    if decimal != ".":
        cells = pc.replace_substring(cells, decimal, ".")
    try:
        values = pc.cast(cells, pa.float64())
    except pa.ArrowInvalid:
        plain = cells.to_pylist()
        values = pa.array([None if cell is None else _number(cell) for cell in plain], pa.float64())
    found: FloatArray = np.asarray(values).astype(np.float64)
    given = np.asarray(pc.is_valid(cells))
    wrong = np.flatnonzero(given & ~np.isfinite(found))
    found[wrong] = np.nan
    raw = column.combine_chunks() if len(wrong) else column
    return found, {int(row): raw[int(row)].as_py().strip() for row in wrong}


def _number(text: str) -> float:
    try:
        return float(pc.cast(pa.scalar(text), pa.float64()).as_py())
    except pa.ArrowInvalid:
        return float("nan")
