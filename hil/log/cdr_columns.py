"""Messages of one type as columns: thousands of CDR payloads at once, field by field.

What is nested gets names like ``pose.position.x``. A time or a duration is one field, in nanoseconds. Fixed
arrays are numbered, ``covariance.0``; what varies in length is a column of lists, one inside another where
sequences are. The columns follow from the type alone, whatever the messages hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc
from rosbags.typesys.store import Typestore

from hil.errors import UsageError

MOST_NUMBERED = 64
"""Longer arrays of fixed length are lists as well."""

_TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_NUMBERS = {
    "bool": "?", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
_HEAD_BYTES = 4
_ALIGNED = 8
_NS = 1_000_000_000
_MOST = 1 << 32

Array = NDArray[Any]
Places = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Lists:
    """A list for each of n messages: ``counts`` (n,), and their values or lists one after the other."""

    counts: Places
    values: Values

    def take(self, rows: Places) -> Lists:
        """The lists of some messages."""
        counts = self.counts[rows]
        starts = np.cumsum(self.counts) - self.counts
        return Lists(counts, taken(self.values, _spread(starts[rows], counts)))

    def tolist(self) -> list[object]:
        """Plain lists of Python."""
        flat = iter(self.values.tolist())
        return [[next(flat) for _ in range(count)] for count in self.counts.tolist()]


Values = Array | Lists
"""Numbers, texts as objects, or lists of either: one for each message."""


class Field(NamedTuple):
    """A column of a type: its name, and whether it is a time [ns]. ``of``: type and field it is in."""

    name: str
    is_time: bool
    of: tuple[str, str]


def fields_of(store: Typestore, typename: str) -> list[Field]:
    """The columns of a type, in their order. Raises :class:`UsageError` for one that is not known or read."""
    return list(_fields(store, typename, ""))


def _fields(store: Typestore, typename: str, prefix: str) -> Iterator[Field]:
    for name, desc in _members(store, typename):
        yield from _fields_of(store, desc, f"{prefix}{name}", (typename, name))


def _fields_of(store: Typestore, desc: FieldDesc, name: str, of: tuple[str, str]) -> Iterator[Field]:
    if desc[0] == Nodetype.NAME:
        if desc[1] in _TIMES:
            yield Field(name, True, of)
        else:
            yield from _fields(store, desc[1], f"{name}.")
    elif desc[0] == Nodetype.BASE:
        if desc[1][0] != "string":
            _kind(desc[1][0])
        yield Field(name, False, of)
    elif desc[0] == Nodetype.ARRAY and desc[1][1] <= MOST_NUMBERED:
        for number in range(desc[1][1]):
            yield from _fields_of(store, desc[1][0], f"{name}.{number}", of)
    else:
        yield from _fields_of(store, desc[1][0], name, of)


def _members(store: Typestore, typename: str) -> Sequence[tuple[str, FieldDesc]]:
    if typename not in store.fielddefs:
        raise UsageError(f"message type {typename!r} is not known; add its definition or leave it out")
    return store.fielddefs[typename][1]


class Columns(NamedTuple):
    """Values by field, of the messages that are sound; ``sound`` (n,): which of the payloads are."""

    values: list[Values]
    sound: NDArray[np.bool_]


def columns_of(store: Typestore, typename: str, payloads: Sequence[bytes]) -> Columns:
    """Columns of payloads that claim to be messages of a type, in the order of :func:`fields_of`.

    Sound is a payload that is one whole message, which padding up to the next multiple of four may follow.
    """
    sound = np.zeros(len(payloads), dtype=np.bool_)
    orders = np.array([each[1] if len(each) >= _HEAD_BYTES else 2 for each in payloads], dtype=np.uint8)
    parts: list[tuple[Places, list[Values]]] = []
    for order, number in (("<", 1), (">", 0)):
        rows = np.flatnonzero(orders == number)
        if len(rows) or (number == 1 and not np.any(orders == 0)):
            reader = _Reader([payloads[row] for row in rows.tolist()], order)
            values = reader.message(store, typename)
            whole = reader.is_whole()
            sound[rows] = whole
            kept = np.flatnonzero(whole)
            parts.append((rows[kept], [taken(each, kept) for each in values]))
    if len(parts) == 1:
        return Columns(parts[0][1], sound)
    order_of = np.argsort(np.concatenate([rows for rows, _ in parts]))
    joined = [_joined([part[1][number] for part in parts]) for number in range(len(parts[0][1]))]
    return Columns([taken(each, order_of) for each in joined], sound)


def taken(values: Values, rows: Places) -> Values:
    """The values of some messages."""
    return values.take(rows) if isinstance(values, Lists) else values[rows]


class _Reader:
    """Goes through the payloads side by side: ``at``, where each of them is read next.

    Each begins at a multiple of eight, so that what is aligned in it is aligned in memory.
    """

    def __init__(self, payloads: Sequence[bytes], order: str) -> None:
        sizes = np.array([len(each) - _HEAD_BYTES for each in payloads], dtype=np.int64)
        pads = [bytes(-(len(each) - _HEAD_BYTES) % _ALIGNED) for each in payloads]
        pieces = [
            part for each, pad in zip(payloads, pads, strict=True) for part in (each[_HEAD_BYTES:], pad)
        ]
        self._bytes = b"".join((*pieces, bytes(_ALIGNED)))
        memory = np.frombuffer(self._bytes, dtype=np.uint8)
        self._views = {kind: memory.view(f"{order}{kind}") for kind in set(_NUMBERS.values())}
        room = (sizes + _ALIGNED - 1) & -_ALIGNED
        self._starts = np.cumsum(room) - room
        self.at = self._starts.copy()
        self._ends = self.at + sizes
        self._sound = np.ones(len(payloads), dtype=np.bool_)
        self._lanes: Places | None = None

    def is_whole(self) -> NDArray[np.bool_]:
        """Which payloads held one message, and nothing after it but padding."""
        rest = self._ends - self.at
        whole: NDArray[np.bool_] = self._sound & (rest >= 0) & (rest < _HEAD_BYTES)
        return whole

    def message(self, store: Typestore, typename: str) -> list[Values]:
        """Values of a message's fields."""
        if typename in _TIMES:
            seconds, rest = self._number("i4"), self._number("u4")
            return [seconds.astype(np.int64) * _NS + rest.astype(np.int64)]
        return [values for _, desc in _members(store, typename) for values in self._field(store, desc)]

    def _field(self, store: Typestore, desc: FieldDesc) -> list[Values]:
        if desc[0] == Nodetype.NAME:
            return self.message(store, desc[1])
        if desc[0] == Nodetype.BASE:
            return [self._text() if desc[1][0] == "string" else self._number(_kind(desc[1][0]))]
        element, size = desc[1]
        if desc[0] == Nodetype.ARRAY:
            if size <= MOST_NUMBERED:
                return [values for _ in range(size) for values in self._field(store, element)]
            counts = np.full(len(self.at), size, dtype=np.int64)
        else:
            counts = self._number("u4").astype(np.int64)
            self._refuse(counts > (size or _MOST))
        # Every element has a byte at least.
        counts[~self._holds(self.at, counts)] = 0
        if element[0] == Nodetype.BASE and element[1][0] != "string":
            return [self._numbers(_kind(element[1][0]), counts)]
        return self._elements(store, element, counts)

    def _number(self, kind: str) -> Array:
        view = self._views[kind]
        size = view.itemsize
        self.at = (self.at + (size - 1)) & -size
        places = np.where(self._holds(self.at, size), self.at, 0)
        self.at = self.at + size
        values: Array = view[places // size]
        return values

    def _numbers(self, kind: str, counts: Places) -> Lists:
        view = self._views[kind]
        size = view.itemsize
        aligned = (self.at + (size - 1)) & -size
        self.at = np.where(counts > 0, aligned, self.at)
        counts = np.where(self._holds(self.at, counts * size), counts, 0)
        places = _spread(self.at // size, counts)
        self.at = self.at + counts * size
        return Lists(counts, view[places])

    def _text(self) -> Array:
        lengths = self._number("u4").astype(np.int64)
        held = self._holds(self.at, lengths) & (lengths > 0)
        lasts = np.where(held, self.at + lengths - 1, 0)
        self._refuse(~held | (self._views["u1"][lasts] != 0))
        starts = np.where(held, self.at, 0)
        self.at = np.where(held, self.at + lengths, self.at)
        found: dict[bytes, str | None] = {}
        texts: list[str | None] = []
        for start, last in zip(starts.tolist(), lasts.tolist(), strict=True):
            raw = self._bytes[start:last]
            if raw not in found:
                found[raw] = _decoded(raw)
            texts.append(found[raw])
        values = np.empty(len(texts), dtype=object)
        values[:] = texts
        self._refuse(np.array([text is None for text in texts], dtype=np.bool_))
        return values

    def _elements(self, store: Typestore, element: FieldDesc, counts: Places) -> list[Values]:
        """Lists of what has fields of its own: the first elements of all messages, then the second ones."""
        outer, at, lanes = self._lanes, self.at, np.arange(len(self.at))
        rows: list[Places] = []
        found: list[list[Values]] = []
        for number in range(int(counts.max(initial=0)) or 1):
            here = np.flatnonzero((counts > number) & self._sound[lanes if outer is None else outer])
            self.at, self._lanes = at[here], here if outer is None else outer[here]
            found.append(self._field(store, element))
            at[here] = self.at
            rows.append(here)
        self.at, self._lanes = at, outer
        of = np.concatenate(rows)
        order = np.argsort(of, kind="stable")
        held = np.bincount(of, minlength=len(at)).astype(np.int64)
        columns = [_joined([each[place] for each in found]) for place in range(len(found[0]))]
        return [Lists(held, taken(values, order)) for values in columns]

    def _holds(self, at: Places, sizes: Places | int) -> NDArray[np.bool_]:
        """Where so many bytes are still in the payload; the others are not sound."""
        ends = self._ends if self._lanes is None else self._ends[self._lanes]
        held: NDArray[np.bool_] = at + sizes <= ends
        self._refuse(~held)
        return held

    def _refuse(self, bad: NDArray[np.bool_]) -> None:
        if self._lanes is None:
            self._sound[bad] = False
        else:
            self._sound[self._lanes[bad]] = False


def _kind(base: str) -> str:
    if base not in _NUMBERS:
        raise UsageError(f"fields of type {base!r} are not supported; leave their topic out")
    return _NUMBERS[base]


def _decoded(raw: bytes) -> str | None:
    try:
        return raw.decode()
    except UnicodeDecodeError:
        return None


def _spread(starts: Places, counts: Places) -> Places:
    """Places from each start on, as many as each count."""
    before = np.cumsum(counts) - counts
    return np.repeat(starts - before, counts) + np.arange(int(counts.sum()), dtype=np.int64)


def _joined(parts: Sequence[Values]) -> Values:
    lists = [each for each in parts if isinstance(each, Lists)]
    if lists:
        counts = np.concatenate([each.counts for each in lists])
        return Lists(counts, _joined([each.values for each in lists]))
    return np.concatenate([each for each in parts if not isinstance(each, Lists)])
