"""Named tuples in rows of memory: what outlives a step, or is there a thousand times.

Inside a kernel everything is a named tuple, handed on by value. What is kept between steps lies in rows,
numpy arrays with a field for each of the tuple's, which their owner makes by :func:`rows_of` and lends to an
entry. :func:`load` and :func:`store` are all that kernels do with them. In plain Python a list of tuples
does as well as rows do.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Generic,
    NamedTuple,
    TypeVar,
    cast,
    get_origin,
    get_type_hints,
)

import numpy as np
from numpy.typing import NDArray

R = TypeVar("R")

Vector = Annotated[NDArray[np.float64], np.float64, 1]
Matrix = Annotated[NDArray[np.float64], np.float64, 2]
Tensor = Annotated[NDArray[np.float64], np.float64, 3]
Indices = Annotated[NDArray[np.int64], np.int64, 1]
IndexMatrix = Annotated[NDArray[np.int64], np.int64, 2]
IndexTensor = Annotated[NDArray[np.int64], np.int64, 3]
Flags = Annotated[NDArray[np.bool_], np.bool_, 1]
FlagMatrix = Annotated[NDArray[np.bool_], np.bool_, 2]
Buffer = Annotated[NDArray[np.uint8], np.uint8, 1]
"""Arrays, contiguous in memory, as entries take them; beside the type: element and number of dimensions."""

_SCALARS: dict[Any, Any] = {float: np.float64, int: np.int64, bool: np.bool_}


class Rows(Generic[R]):
    """Type of rows that hold named tuples of one class. There are no instances: the rows are numpy arrays."""

    if TYPE_CHECKING:

        def __len__(self) -> int: ...


class Span(NamedTuple):
    """Rows as compiled code hands them on: address and number. Who called in keeps the array alive."""

    address: int
    length: int


def is_record(kind: Any) -> bool:
    """Whether a class is a named tuple."""
    return isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")


def is_lent(hint: Any) -> bool:
    """Whether the type of a field is that of rows or of an array."""
    return get_origin(hint) is Rows or bool(getattr(hint, "__metadata__", ()))


@functools.cache
def dtype_of(kind: Any) -> np.dtype[np.void]:
    """Aligned structured dtype of a named tuple of ``float``, ``int``, ``bool`` and named tuples of these.

    Rows and arrays that it lends stand there as :class:`Span`. Raises :class:`TypeError` for a field of
    another type.
    """
    hints = get_type_hints(kind, include_extras=True)
    fields: list[tuple[str, Any]] = []
    for name in fields_of(kind):
        hint = hints[name]
        if is_lent(hint):
            fields.append((name, dtype_of(Span)))
        elif is_record(hint):
            fields.append((name, dtype_of(hint)))
        elif hint in _SCALARS:
            fields.append((name, _SCALARS[hint]))
        else:
            raise TypeError(f"{kind.__name__}.{name} is {hint}, expected float, int, bool or a named tuple")
    return np.dtype(fields, align=True)


def fields_of(kind: type) -> tuple[str, ...]:
    """Names of a named tuple's fields."""
    names: tuple[str, ...] = kind._fields  # type: ignore[attr-defined]
    return names


def rows_of(kind: type[R], count: int) -> Rows[R]:
    """New rows, all zero.

    >>> class Point(NamedTuple):
    ...     x: float
    ...     number: int
    >>> points = rows_of(Point, 2)
    >>> store(points, 1, Point(0.5, 7))
    >>> load(Point, points, 1)
    Point(x=0.5, number=7)
    """
    return cast("Rows[R]", np.zeros(count, dtype_of(cast("Any", kind))))


def plain_rows_of(kind: type[R], count: int) -> Rows[R]:
    """New rows for plain Python alone, faster there than an array; none may be loaded before it is stored."""
    return cast("Rows[R]", [None] * count)


def row_of(record: R) -> Rows[R]:
    """One new row that holds a named tuple."""
    rows = rows_of(type(record), 1)
    store(rows, 0, record)
    return rows


def copy_of(rows: Rows[R]) -> Rows[R]:
    """New rows that hold the same."""
    held = columns_of(rows)
    # As bytes: numpy would copy padded rows field by field.
    return cast("Rows[R]", np.frombuffer(bytearray(held.tobytes()), held.dtype))


def columns_of(rows: Rows[R]) -> NDArray[np.void]:
    """The rows as the numpy array that they are, for whole columns at once."""
    return cast("NDArray[np.void]", rows)


def load(kind: type[R], rows: Rows[R], k: int) -> R:
    """The k-th row as a named tuple."""
    if isinstance(rows, np.ndarray):
        made: R = _maker(cast("Any", kind))(rows[k].item())
        return made
    kept: R = cast("Any", rows)[k]
    return kept


def store(rows: Rows[R], k: int, record: R) -> None:
    """Put a named tuple into the k-th row."""
    # An array, or in plain Python a list.
    cast("Any", rows)[k] = record


def borrowed(rows: Rows[R]) -> Rows[R]:
    """Rows to hand on within compiled code, where counting references would take longer than arithmetic."""
    return rows


def size(rows: Rows[R]) -> int:
    """Number of rows."""
    return len(rows)


def part(kind: type[R], rows: Rows[R], first: int, count: int) -> Rows[R]:
    """Some of the rows, of what they hold; changing them changes these."""
    if isinstance(rows, list):
        return cast("Rows[R]", _ListPart(rows, first, count))
    return cast("Rows[R]", columns_of(rows)[first : first + count])


def within(kind: type[R], rows: Rows[R], k: int, name: str) -> Rows[Any]:
    """One row of what a field of the k-th row holds, a named tuple; changing it changes that.

    What a step changes of a large record is stored so, and the rest of it stays where it is.

    >>> class Pair(NamedTuple):
    ...     first: Span
    ...     second: Span
    >>> pairs = rows_of(Pair, 1)
    >>> store(within(Pair, pairs, 0, "second"), 0, Span(3, 4))
    >>> load(Pair, pairs, 0)
    Pair(first=Span(address=0, length=0), second=Span(address=3, length=4))
    """
    return cast("Rows[Any]", columns_of(rows)[k : k + 1][name])


def load_across(kind: type[R], rows: Rows[R], count: int, k: int) -> R:
    """The k-th of ``count`` records, a constant, that fill as many rows, the first ones, field by field.

    Each field of all of them lies side by side, so that compiled code works on several at once. All fields
    are floats. These rows are not for :func:`load` and :func:`store`.

    >>> class Point(NamedTuple):
    ...     x: float
    ...     y: float
    >>> points = rows_of(Point, 2)
    >>> store_across(points, 2, 1, Point(1.0, 2.0))
    >>> load_across(Point, points, 2, 1), load(Point, points, 1)
    (Point(x=1.0, y=2.0), Point(x=0.0, y=2.0))
    """
    held = np.ascontiguousarray(_fields_of_all(rows, count)[:, k])
    made: R = _maker(cast("Any", kind))(held.view(columns_of(rows).dtype)[0].item())
    return made


def store_across(rows: Rows[R], count: int, k: int, record: R) -> None:
    """Put a record in the place of the k-th of ``count`` that fill the rows field by field."""
    row = np.zeros(1, columns_of(rows).dtype)
    row[0] = record
    _fields_of_all(rows, count)[:, k] = row.view(np.float64)


def _fields_of_all(rows: Rows[Any], count: int) -> NDArray[np.float64]:
    """Fields (n, count) of records that lie field by field in the first rows."""
    return columns_of(rows)[:count].view(np.float64).reshape(-1, count)


class _ListPart:
    """Part of a list that stands for rows."""

    def __init__(self, kept: list[Any], first: int, count: int) -> None:
        self._kept, self._first, self._count = kept, first, count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, k: int) -> Any:
        return self._kept[self._first + k]

    def __setitem__(self, k: int, record: Any) -> None:
        self._kept[self._first + k] = record


@functools.cache
def _maker(kind: Any) -> Callable[[Any], Any]:
    """Function that makes a named tuple out of nested plain tuples."""
    hints = get_type_hints(kind)
    makers = [_maker(hints[name]) if is_record(hints[name]) else None for name in fields_of(kind)]
    plain: Callable[[Any], Any] = kind._make
    if not any(makers):
        return plain

    def made(values: Any) -> Any:
        return plain([make(value) if make else value for make, value in zip(makers, values, strict=True)])

    return made
