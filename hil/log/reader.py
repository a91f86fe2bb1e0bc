"""Reading logs: our own and the MCAP files of rosbag2."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import takewhile
from pathlib import Path
from typing import BinaryIO

from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from mcap.records import Channel, Schema
from zstandard import ZstdError

from hil.errors import UsageError
from hil.log import metadata_sums
from hil.log.description import SETTLED_NS, described
from hil.log.mcap_chunks import MAGIC
from hil.log.mcap_order import entries_in_order
from hil.log.mcap_scan import scanned_summary
from hil.log.mcap_summary import ChunkPlace, McapSummary, read_metadata, read_summary
from hil.wire.message_types import Message
from hil.wire.messages import decode, typestore_of
from hil.wire.topics import LOG

DAMAGE = (
    McapError,
    ZstdError,
    struct.error,
    ValueError,
    KeyError,
    OverflowError,
    RuntimeError,
    MemoryError,
)
"""What the ``mcap`` package and the decompressors raise on bytes that are not as they were written."""

_END_OF_TIME = 2**64
_SHORTEST_BYTES = 2 * len(MAGIC) + 17 + 29
"""Size of an MCAP with nothing but a header (without texts) and a footer."""


@dataclass(frozen=True, slots=True)
class Record:
    """One logged message: its CDR payload, when it was logged and published, its number on its topic."""

    topic: str
    typename: str
    payload: bytes
    log_ns: int
    publish_ns: int
    sequence: int


Source = Callable[[Collection[str] | None, int | None, int | None], Iterator[Record]]
"""Messages of topics (None: all) from one log time on, before another one, in the order of log time."""


@dataclass(frozen=True, slots=True)
class Log:
    """A whole log, by :func:`read_log`.

    ``metadata``: metadata records by name. ``topics``: type name by topic. ``encodings``: message encoding
    by topic. ``definitions``: ``ros2msg`` text by type name, where the log has one. ``messages``: how many
    there are, from ``start_ns`` to ``end_ns`` in log time (both None in a log without messages). ``counts``:
    how many by topic, where the log tells. ``channels``: topic and type name by channel id. ``chunks``: in
    the order of their first messages, none in a log without an index. ``source``: gives the messages of a log
    that isn't one MCAP, by topics and log times as :meth:`records` is asked for them. ``damage``: what is
    gone of a damaged log, in one line.

    >>> import abreast
    >>> scenario = abreast.load_scenario("turtlebot3", {"run.duration_s": 2.0})
    >>> run = abreast.run_lockstep(scenario, log="some.mcap")
    >>> log = abreast.read_log("some.mcap")
    >>> first = next(log.records(["rigid_bodies"]))
    >>> [body.rigid_body_name for body in log.decode(first).rigidbodies]
    ['leader', 'follower']
    """

    path: Path
    metadata: Mapping[str, Mapping[str, str]]
    topics: Mapping[str, str]
    encodings: Mapping[str, str]
    definitions: Mapping[str, str]
    messages: int
    start_ns: int | None
    end_ns: int | None
    channels: Mapping[int, tuple[str, str]]
    chunks: Sequence[ChunkPlace] = field(repr=False)
    counts: Mapping[str, int] = field(default_factory=dict)
    source: Source | None = field(default=None, repr=False)
    damage: str = ""

    def records(
        self, topics: Collection[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[Record]:
        """Yield the messages in the order of log time, those of equal time in the order of the file.

        Only those of the given topics (None: all) logged at ``start_ns`` or later and before ``end_ns``.
        Raises :class:`UsageError` if the log is damaged, or if a topic is not encoded as CDR.
        """
        self.check_encodings(self.topics if topics is None else topics)
        if start_ns is not None and end_ns is not None and end_ns <= start_ns:
            return
        if self.source is not None:
            yield from self.source(topics, start_ns, end_ns)
            return
        with reading(self.path) as stream:
            if self.chunks:
                yield from _indexed(stream, self, topics, start_ns, end_ns)
                return
            for schema, channel, message in NonSeekingReader(stream, validate_crcs=True).iter_messages(
                topics=topics, starting_at=start_ns, ending_before=end_ns
            ):
                yield Record(
                    channel.topic,
                    _typename(schema),
                    message.data,
                    message.log_time,
                    message.publish_time,
                    message.sequence,
                )

    def size_bytes(self) -> int:
        """Size of the log's file, or of all files in its folder."""
        parts = self.path.iterdir() if self.path.is_dir() else (self.path,)
        return sum(part.stat().st_size for part in parts)

    def check_encodings(self, topics: Collection[str]) -> None:
        """Raise :class:`UsageError` if one of the topics is not encoded as CDR."""
        for topic in topics:
            encoding = self.encodings.get(topic, "cdr")
            if encoding != "cdr":
                raise UsageError(
                    f"log {self.path}: topic {topic!r} is encoded as {encoding!r}, expected 'cdr'; "
                    "convert the log to ROS 2 or leave the topic out"
                )

    def decode(self, record: Record) -> Message:
        """Return the record's message, by the log's own definition of its type where it has one.

        Raises what `hil.wire.messages.decode` raises.
        """
        text = self.definitions.get(record.typename)
        return decode(record.payload, record.typename, typestore_of(record.typename, text) if text else None)


def _indexed(
    stream: BinaryIO, log: Log, topics: Collection[str] | None, start_ns: int | None, end_ns: int | None
) -> Iterator[Record]:
    first, last = 0 if start_ns is None else start_ns, _END_OF_TIME if end_ns is None else end_ns
    channels = {
        number: known for number, known in log.channels.items() if topics is None or known[0] in topics
    }
    others = log.channels.keys() - channels.keys()

    def wanted(channel_id: int, log_ns: int) -> bool:
        if channel_id not in channels and channel_id not in others:
            raise ValueError(f"a message is of channel {channel_id}, which nothing tells of")
        return channel_id in channels and first <= log_ns < last

    chunks = [
        chunk
        for chunk in log.chunks
        if chunk.last_ns >= first and chunk.first_ns < last and chunk.may_hold(channels)
    ]
    for entry in entries_in_order(stream, chunks, wanted):
        topic, typename = channels[entry.channel_id]
        yield Record(topic, typename, entry.payload, entry.log_ns, entry.publish_ns, entry.sequence)


def read_log(path: Path) -> Log:
    """Open a log: check that it is whole, and read all but its messages.

    Raises :class:`UsageError` if it is missing, a folder, not MCAP, cut off or damaged, and if its metadata,
    the scenario among them, are not what was written.
    """
    check_mcap(path)
    with reading(path) as stream:
        _refuse_cut_off(stream, path)
        summary = read_summary(stream)
        if summary is None or not (summary.statistics and summary.channels and summary.schemas):
            summary = scanned_summary(stream)
        if not all(chunk.is_there(stream) for chunk in summary.chunks):
            raise damaged(path, "chunks are not where its summary has them")
        metadata = _metadata_of(stream, path, summary)
        log = _log_of(path, summary, metadata)
    return replace(log, metadata={**told_in_messages(log), **metadata})


def _log_of(path: Path, summary: McapSummary, metadata: Mapping[str, Mapping[str, str]]) -> Log:
    schemas, statistics = summary.schemas, summary.statistics
    ordered = [summary.channels[number] for number in sorted(summary.channels)]
    messages = statistics.message_count if statistics else 0
    return Log(
        path=path,
        metadata=metadata,
        topics={channel.topic: _typename(schemas.get(channel.schema_id)) for channel in ordered},
        encodings={channel.topic: channel.message_encoding for channel in ordered},
        definitions={
            _typename(schema): schema.data.decode()
            for schema in schemas.values()
            if schema.encoding == "ros2msg" and schema.data
        },
        messages=messages,
        start_ns=statistics.message_start_time if statistics and messages else None,
        end_ns=statistics.message_end_time if statistics and messages else None,
        channels={
            channel.id: (channel.topic, _typename(schemas.get(channel.schema_id))) for channel in ordered
        },
        chunks=tuple(summary.chunks),
        counts=_by_topic(statistics.channel_message_counts if statistics else {}, summary.channels),
    )


def _metadata_of(stream: BinaryIO, path: Path, summary: McapSummary) -> dict[str, dict[str, str]]:
    """Metadata records by name, without their sums, which they are held to."""
    records: dict[str, dict[str, str]] = {}
    try:
        for index in summary.metadata:
            records[index.name] = dict(read_metadata(stream, index).metadata)
    except DAMAGE:
        raise _other_metadata(path, index.name) from None
    sums = records.pop(metadata_sums.RECORD, {})
    if changed := metadata_sums.changed(records, sums):
        raise _other_metadata(path, ", ".join(changed))
    return records


def _other_metadata(path: Path, names: str) -> UsageError:
    return UsageError(
        f"log {path}: its metadata {names} (scenario, seed, certificate) are not what was written, by their "
        f"SHA-256; have them put right, where the log tells them again, by: abreast recover {path} --out LOG"
    )


def told_in_messages(log: Log) -> dict[str, dict[str, str]]:
    """What the log says of itself on a topic; other tools that copy logs leave metadata behind."""
    said = log.records([LOG]) if LOG in log.topics else iter(())
    first = next(said, None)
    if first is None:
        return {}
    settled = takewhile(lambda record: record.log_ns < first.log_ns + SETTLED_NS, said)
    return described(record.payload for record in (first, *settled))


def _by_topic(counts: Mapping[int, int], channels: Mapping[int, Channel]) -> dict[str, int]:
    found: dict[str, int] = {}
    for number, count in counts.items():
        if number in channels:
            topic = channels[number].topic
            found[topic] = found.get(topic, 0) + count
    return found


def check_mcap(path: Path) -> None:
    """Raise :class:`UsageError` unless the path is a file that begins as MCAP does.

    It is a :class:`DamagedLogError` where the beginning alone speaks against it.
    """
    if path.is_dir():
        raise UsageError(f"log {path}: is a folder; expected an MCAP file")
    try:
        with path.open("rb") as stream:
            start = stream.read(len(MAGIC))
    except FileNotFoundError:
        raise UsageError(f"log {path}: no such file; check the path") from None
    except OSError as error:
        raise UsageError(f"log {path}: cannot be read ({error.strerror})") from None
    if not start:
        raise UsageError(f"log {path}: is empty; expected an MCAP file")
    if start != MAGIC:
        raise DamagedLogError(
            f"log {path}: is not MCAP (it begins with {start!r}); expected a log or a rosbag2 MCAP"
        )


@contextmanager
def reading(path: Path) -> Iterator[BinaryIO]:
    """The bytes of a log; raises :class:`UsageError` for what it cannot be read for, damage included."""
    try:
        with path.open("rb") as stream:
            yield stream
    except OSError as error:
        raise UsageError(f"log {path}: cannot be read ({error.strerror or error})") from None
    except DAMAGE as error:
        raise damaged(path, " ".join(str(error).split()) or type(error).__name__) from None


class DamagedLogError(UsageError):
    """A log whose bytes are not as they were written. What is whole of it can be read all the same."""


def damaged(path: Path, reason: str) -> DamagedLogError:
    """The error for a log whose bytes are not as they were written."""
    return DamagedLogError(f"log {path}: is damaged ({reason}); save what is whole with: abreast recover")


def _refuse_cut_off(stream: BinaryIO, path: Path) -> None:
    size = stream.seek(0, os.SEEK_END)
    stream.seek(max(0, size - len(MAGIC)))
    if size < _SHORTEST_BYTES or stream.read() != MAGIC:
        raise UsageError(f"log {path}: is cut off; make it whole with: abreast recover {path} --out LOG")
    stream.seek(0)


def _typename(schema: Schema | None) -> str:
    """Return the schema's type as ``package/msg/Name``; ROS 1 and early rosbag2 leave ``msg`` out."""
    if schema is None:
        return ""
    package, slash, name = schema.name.partition("/")
    return schema.name if "/" in name or not slash else f"{package}/msg/{name}"
