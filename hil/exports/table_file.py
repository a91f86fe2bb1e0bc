"""Tables written piece by piece, as Parquet or CSV."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np

from hil.errors import UsageError
from hil.extras import needs_extra
from hil.log.cdr_columns import Lists, Values
from hil.log.table_column import TableColumn
from hil.log.written_aside import written_aside

Format = Literal["csv", "parquet"]


class Table(Protocol):
    """A table that is being written."""

    def write(self, values: Sequence[Values]) -> None:
        """Append rows: for each column their values."""


@contextmanager
def table_file(path: Path, columns: Sequence[TableColumn], form: Format) -> Iterator[Table]:
    """A table to write to a file, which is there once the block ends. Folders above are made.

    Raises :class:`UsageError` if the file cannot be written, and for Parquet without ``pyarrow``.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with written_aside(path) as aside:
            if form == "csv":
                with aside.open("w", encoding="utf-8", newline="") as stream:
                    yield _CsvTable(stream, columns)
            else:
                table = _ParquetTable(aside, columns)
                try:
                    yield table
                finally:
                    table.close()
    except OSError as error:
        raise UsageError(
            f"{path}: cannot be written ({error.strerror or error}); give another place"
        ) from None


def has_parquet() -> bool:
    """Whether ``pyarrow`` is there, which writes Parquet."""
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError:
        return False
    return True


class _CsvTable:
    """What is not known is left empty; lists stand there as JSON."""

    def __init__(self, stream: Any, columns: Sequence[TableColumn]) -> None:
        self._writer = csv.writer(stream, lineterminator="\n")
        self._writer.writerow([each.name for each in columns])

    def write(self, values: Sequence[Values]) -> None:
        """Append rows."""
        self._writer.writerows(zip(*map(_cells, values), strict=True))


def _cells(values: Values) -> Sequence[object]:
    if isinstance(values, Lists):
        return [json.dumps(_known(each)) for each in values.tolist()]
    cells: list[object] = values.tolist()
    if values.dtype.kind == "f":
        return ["" if cell != cell else cell for cell in cells]
    if values.dtype.kind == "b":
        return ["true" if cell else "false" for cell in cells]
    return ["" if cell is None else cell for cell in cells]


def _known(value: Any) -> Any:
    """The same with null for numbers that JSON has none for."""
    if isinstance(value, list):
        return [_known(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


class _ParquetTable:
    """Names, units and descriptions of columns are in the schema's field metadata."""

    def __init__(self, path: Path, columns: Sequence[TableColumn]) -> None:
        try:
            import pyarrow
            from pyarrow import parquet
        except ModuleNotFoundError as error:
            raise needs_extra("export to Parquet", error) from None
        self._pa, self._parquet = pyarrow, parquet
        self._path, self._columns = path, columns
        self._writer: Any = None

    def write(self, values: Sequence[Values]) -> None:
        """Append rows as a row group."""
        arrays = [self._array(each) for each in values]
        if self._writer is None:
            fields = [
                self._pa.field(each.name, array.type, metadata=_metadata(each))
                for each, array in zip(self._columns, arrays, strict=True)
            ]
            self._schema = self._pa.schema(fields)
            self._writer = self._parquet.ParquetWriter(self._path, self._schema, compression="zstd")
        self._writer.write_table(self._pa.Table.from_arrays(arrays, schema=self._schema))

    def close(self) -> None:
        """Finish the file."""
        if self._writer is not None:
            self._writer.close()

    def _array(self, values: Values) -> Any:
        pa = self._pa
        if isinstance(values, Lists):
            offsets = np.concatenate([[0], np.cumsum(values.counts)]).astype(np.int32)
            return pa.ListArray.from_arrays(pa.array(offsets), self._array(values.values))
        return pa.array(values, pa.string()) if values.dtype.kind == "O" else pa.array(values)


def _metadata(column: TableColumn) -> dict[str, str]:
    unit = {"unit": column.unit} if column.unit else {}
    return {**unit, "description": column.description} if column.description else unit
