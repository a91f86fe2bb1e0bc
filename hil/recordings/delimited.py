"""Tables of text: what separates their cells, what their columns are called, and their cells as numbers."""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
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

    columns: dict[str, list[str]]
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
    places = [names.index(name) for name in wanted]
    columns: dict[str, list[str]] = {name: [] for name in wanted}
    lines: list[int] = []
    for number, line in numbered:
        fault = _fault(line)
        cells = [] if fault else _split(line, layout.delimiter)
        if not fault and len(cells) != len(names):
            counted = f"{len(cells)} cell{'s' if len(cells) != 1 else ''}"
            fault = f"has {counted}, expected {len(names)}"
        if fault:
            damaged[number] = fault
        else:
            lines.append(number)
            for column, place in zip(columns.values(), places, strict=True):
                column.append(cells[place])
    return Cells(columns, np.array(lines, dtype=np.int64), damaged)


def _split(line: str, delimiter: str) -> list[str]:
    """Cells of one line; blanks around them may stay."""
    return split_line(line, delimiter) if '"' in line or delimiter == " " else line.split(delimiter)


def _fault(line: str) -> str | None:
    if "\0" in line:
        return "holds zero bytes"
    return "has a quote that is not closed" if line.count('"') % 2 else None


def texts(column: Sequence[str]) -> list[str]:
    """Cells without blanks around them."""
    return [cell.strip() for cell in column]


def numbers(column: Sequence[str], decimal: str) -> tuple[FloatArray, dict[int, str]]:
    """Cells as numbers, NaN where there is nothing, and those that are no finite numbers by their row."""
    values = np.full(len(column), np.nan)
    wrong: dict[int, str] = {}
    for row, cell in enumerate(column):
        value = _number(cell if decimal == "." else cell.replace(decimal, "."))
        if math.isfinite(value):
            values[row] = value
        elif (text := cell.strip()).lower() not in EMPTY:
            wrong[row] = text
    return values, wrong


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return math.nan
    # Python takes underscores, and digits of all scripts.
    return value if text.isascii() and "_" not in text else math.nan
