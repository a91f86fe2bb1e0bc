"""Every topic of a log as a table of its own: a row for each message, what is nested by names with dots."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

import numpy as np
from rosbags.typesys.store import Typestore

from hil.errors import UsageError
from hil.exports.table_file import Format, Table, table_file
from hil.log.cdr_columns import Field, Lists, Values, columns_of, fields_of
from hil.log.reader import Log
from hil.log.table_column import TableColumn
from hil.wire.messages import definition, known_types, typestore_of

_MOST_ROWS, _MOST_BYTES = 1 << 14, 1 << 22
_S = 1e-9
_LONGEST = 180
"""Bytes of a part of a file's name: with what is put before and behind, 255 are the most."""

TIMES = (
    TableColumn("log_time.ns", "ns", "when the message was logged, since 1970"),
    TableColumn("log_time.s", "s", "the same in seconds"),
    TableColumn("publish_time.ns", "ns", "when it was published, as far as the log tells"),
    TableColumn("publish_time.s", "s", "the same in seconds"),
)
"""Columns that the tables of all topics begin with."""


@dataclass(slots=True)
class TopicTables:
    """What was written. ``rows``: by file; ``malformed``: payloads that are no messages, by topic.

    ``left_out``: topics whose type is not known or not CDR, with why.
    """

    rows: dict[str, int] = field(default_factory=dict)
    malformed: dict[str, int] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)


def write_topics(log: Log, folder: Path, form: Format) -> TopicTables:
    """Write the table of every topic that has messages, in one pass over the log.

    Raises :class:`UsageError` for a damaged log, and for a file that cannot be written.
    """
    done = TopicTables()
    with ExitStack() as files:
        open_ones: dict[str, _TopicTable] = {}
        paths = topic_paths(log.topics, form)
        for record in log.records(list(_readable(log, done))):
            table = open_ones.get(record.topic)
            if table is None:
                kind = _TopicType.of(log, record.topic)
                writer = files.enter_context(table_file(folder / paths[record.topic], kind.columns(), form))
                table = open_ones[record.topic] = _TopicTable(kind, writer)
            table.add(record.payload, record.log_ns, record.publish_ns)
        for topic, table in open_ones.items():
            table.flush()
            done.rows[paths[topic]] = table.rows
            if table.malformed:
                done.malformed[topic] = table.malformed
    return done


def topic_paths(topics: Mapping[str, str], form: Format) -> dict[str, str]:
    """Where the table of each topic lies: its name, as folders where it has slashes.

    >>> topic_paths({"/follower/odom": "", "a b": "", "../x": ""}, "csv")
    {'/follower/odom': 'follower/odom.csv', 'a b': 'a%20b.csv', '../x': '%2E%2E/x.csv'}
    """
    paths: dict[str, str] = {}
    files: set[str] = set()
    folders: set[str] = set()
    for topic in topics:
        *above, last = [_part(part) for part in topic.split("/") if part] or ["unnamed"]
        folder = ""
        for part in above:
            folder = _free(f"{folder}{part}", "", files) + "/"
            folders.add(folder[:-1])
        paths[topic] = _free(f"{folder}{last}", f".{form}", files | folders)
        files.add(paths[topic])
    return paths


def _free(name: str, ending: str, taken: AbstractSet[str]) -> str:
    """The name with its ending, numbered where that is taken."""
    numbered = itertools.chain([name], (f"{name}-{number}" for number in itertools.count(2)))
    return next(path for each in numbered if (path := f"{each}{ending}") not in taken)


def _part(part: str) -> str:
    """A part of a topic's name as that of a file."""
    dots = not part.strip(".")
    quoted = part.replace(".", "%2E") if dots else quote(part, safe="~", errors="replace")
    # No cut within one of %XX: it would be another name, or none.
    return quoted if len(quoted) <= _LONGEST else re.sub("%.?$", "", quoted[:_LONGEST])


def _readable(log: Log, done: TopicTables) -> Iterator[str]:
    for topic in log.topics:
        try:
            log.check_encodings([topic])
            _TopicType.of(log, topic)
        except UsageError as error:
            done.left_out[topic] = str(error).partition(": ")[2] or str(error)
            continue
        yield topic


@dataclass(frozen=True, slots=True)
class _TopicType:
    """The type of a topic, and where its fields are told of."""

    typename: str
    store: Typestore
    fields: list[Field]
    comments: Mapping[tuple[str, str], str]

    @staticmethod
    def of(log: Log, topic: str) -> _TopicType:
        typename = log.topics[topic]
        text = log.definitions.get(typename)
        store = typestore_of(typename, text) if text else known_types()
        fields = fields_of(store, typename)
        return _TopicType(typename, store, fields, comments_of(typename, text or definition(typename)))

    def columns(self) -> list[TableColumn]:
        """Columns of the table: times in nanoseconds and in seconds."""
        columns = list(TIMES)
        for each in self.fields:
            comment = self.comments.get(each.of, "")
            found = re.match(r"\[([^\]]+)\]\s*", comment)
            unit, said = (found[1], comment[found.end() :]) if found else ("", comment)
            if each.is_time:
                columns += [
                    TableColumn(f"{each.name}.ns", "ns", said),
                    TableColumn(f"{each.name}.s", "s", said),
                ]
            else:
                columns.append(TableColumn(each.name, unit, said))
        return columns


class _TopicTable:
    """Gathers messages of a topic, and writes them many at a time."""

    def __init__(self, kind: _TopicType, writer: Table) -> None:
        self._kind, self._writer = kind, writer
        self._payloads: list[bytes] = []
        self._times: list[tuple[int, int]] = []
        self._bytes = 0
        self.rows = self.malformed = 0

    def add(self, payload: bytes, log_ns: int, publish_ns: int) -> None:
        """Take in a message."""
        self._payloads.append(payload)
        self._times.append((log_ns, publish_ns))
        self._bytes += len(payload)
        if len(self._payloads) >= _MOST_ROWS or self._bytes >= _MOST_BYTES:
            self.flush()

    def flush(self) -> None:
        """Write what has been taken in."""
        kind = self._kind
        found = columns_of(kind.store, kind.typename, self._payloads)
        logged, published = np.array(self._times, dtype=np.uint64).reshape(-1, 2)[found.sound].T
        values: list[Values] = [*_both(logged.astype(np.int64)), *_both(published.astype(np.int64))]
        for each, column in zip(kind.fields, found.values, strict=True):
            values += _both(column) if each.is_time else [column]
        self._writer.write(values)
        self.rows += len(logged)
        self.malformed += len(self._payloads) - len(logged)
        self._payloads, self._times, self._bytes = [], [], 0


def _both(times_ns: Values) -> list[Values]:
    """Times in nanoseconds and in seconds."""
    if isinstance(times_ns, Lists):
        return [Lists(times_ns.counts, each) for each in _both(times_ns.values)]
    return [times_ns, times_ns * _S]


def comments_of(typename: str, text: str) -> dict[tuple[str, str], str]:
    """Comments beside the fields of a type and of those that it depends on, by type and field."""
    comments: dict[tuple[str, str], str] = {}
    of = typename
    for line in text.splitlines():
        if line.startswith("MSG: "):
            package, _, name = line.removeprefix("MSG: ").strip().partition("/")
            of = f"{package}/msg/{name.removeprefix('msg/')}"
            continue
        declared, mark, comment = line.partition("#")
        words = declared.split()
        if mark and len(words) > 1 and "=" not in declared:
            comments[of, words[1]] = comment.strip()
    return comments
