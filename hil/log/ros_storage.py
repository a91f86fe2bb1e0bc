"""Bags in other containers than MCAP, by ``rosbags``: ``.db3`` of ROS 2 and ``.bag`` of ROS 1."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import zstandard
from rosbags.convert.converter import STATIC_MSGTYPE_RENAMES, is_same_wireformat, migrate_bytes
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag1 import ReaderError as Ros1Error
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.rosbag2 import ReaderError as Ros2Error
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from hil.errors import UsageError
from hil.log.chunk_unpacking import LARGEST_CHUNK_BYTES
from hil.log.reader import DAMAGE, Log, Record
from hil.wire.messages import known_types

_Convert = Callable[[bytes], bytes]


@dataclass(frozen=True, slots=True)
class _Topic:
    """A connection of a bag: its type as we name it, its text, and what makes CDR of a payload."""

    connection: Connection
    typename: str
    definition: str
    encoding: str
    convert: _Convert


def read_db3(path: Path, *, compressed: bool = False) -> Log:
    """A ``.db3`` as a log; ``compressed``: each message by itself, as its bag's ``metadata.yaml`` says.

    Raises :class:`UsageError` if it cannot be read.
    """
    opened = partial(Ros2Reader, path)
    convert = _unzipped if compressed else bytes
    with _reading(path, opened) as reader:
        topics = [
            _Topic(each, each.msgtype, _text(each), _encoding(each), convert) for each in reader.connections
        ]
        return _log(path, opened, topics, reader)


def read_bag(path: Path) -> Log:
    """A ROS 1 ``.bag`` as a log: its messages in CDR, of the ROS 2 types of the same names.

    Raises :class:`UsageError` if it cannot be read.
    """
    opened = partial(Ros1Reader, path)
    with _reading(path, opened) as reader:
        return _log(path, opened, _translated(reader.connections), reader)


def _log(path: Path, opened: Callable[[], Any], topics: Collection[_Topic], reader: Any) -> Log:
    count = reader.message_count
    by_id = {each.connection.id: each for each in topics}
    counts: dict[str, int] = {}
    for each in topics:
        name = each.connection.topic
        counts[name] = counts.get(name, 0) + each.connection.msgcount
    return Log(
        path=path,
        metadata={},
        topics={each.connection.topic: each.typename for each in topics},
        encodings={each.connection.topic: each.encoding for each in topics},
        definitions={each.typename: each.definition for each in topics if each.definition},
        messages=count,
        start_ns=reader.start_time if count else None,
        end_ns=reader.end_time - 1 if count else None,
        channels={},
        chunks=(),
        counts=counts,
        source=partial(_records, path, opened, by_id),
    )


def _records(
    path: Path,
    opened: Callable[[], Any],
    by_id: Mapping[int, _Topic],
    topics: Collection[str] | None,
    start_ns: int | None,
    end_ns: int | None,
) -> Iterator[Record]:
    with _reading(path, opened) as reader:
        wanted = [each for each in reader.connections if topics is None or each.topic in topics]
        if not wanted:
            return
        for number, (connection, log_ns, payload) in enumerate(
            reader.messages(connections=wanted, start=start_ns, stop=end_ns)
        ):
            topic = by_id[connection.id]
            try:
                converted = topic.convert(payload)
            except SerdeError:
                # As it stands it is no message of its type, and refused as malformed by who decodes it.
                converted = b""
            yield Record(connection.topic, topic.typename, converted, log_ns, log_ns, number)


@contextmanager
def _reading(path: Path, opened: Callable[[], Any]) -> Iterator[Any]:
    """A reader of ``rosbags``, its errors as ours."""
    try:
        with opened() as reader:
            yield reader
    except FileNotFoundError:
        raise UsageError(f"log {path}: no such file; check the path") from None
    except OSError as error:
        raise UsageError(f"log {path}: cannot be read ({error.strerror or error})") from None
    except TypesysError as error:
        reason = " ".join(str(error).split())
        raise UsageError(f"log {path}: its message definitions can't be used ({reason})") from None
    except (Ros1Error, Ros2Error, SerdeError, sqlite3.Error, AssertionError, IndexError, *DAMAGE) as error:
        # What the bytes make of it on the way is no matter: they are not those of a bag.
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UsageError(f"log {path}: is damaged, or no bag ({reason}); check the file") from None


def _translated(connections: Collection[Connection]) -> list[_Topic]:
    """Topics of ROS 1 in ROS 2's types: ours where there is one of that name, else the bag's own."""
    source, target = get_typestore(Stores.EMPTY), known_types()
    for each in connections:
        source.register(get_types_from_msg(each.msgdef.data, each.msgtype))
    cache: dict[str, object] = {}
    topics = []
    for each in connections:
        typename = STATIC_MSGTYPE_RENAMES.get(each.msgtype, each.msgtype)
        text, store = "", target
        if typename not in target.fielddefs:
            text = source.generate_msgdef(each.msgtype, ros_version=2)[0]
            store = _of_ros2(text, typename)
        topics.append(_Topic(each, typename, text, "cdr", _converter(source, store, each, typename, cache)))
    return topics


def _of_ros2(text: str, typename: str) -> Typestore:
    """The types of a text, headers as ROS 2 has them."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = get_types_from_msg(text, typename)
    store.register({name: fields for name, fields in types.items() if name not in store.fielddefs})
    return store


def _converter(
    source: Typestore, target: Typestore, connection: Connection, typename: str, cache: dict[str, object]
) -> _Convert:
    was = connection.msgtype
    if is_same_wireformat(source, target, was, typename):
        return lambda payload: bytes(target.ros1_to_cdr(payload, typename))
    return lambda payload: bytes(
        migrate_bytes(source, target, was, typename, cache, payload, src_is2=False, dst_is2=True)
    )


def _unzipped(payload: bytes) -> bytes:
    told = zstandard.get_frame_parameters(payload).content_size
    if LARGEST_CHUNK_BYTES < told != zstandard.CONTENTSIZE_UNKNOWN:
        raise zstandard.ZstdError(f"a message of {len(payload)} bytes claims to hold {told}")
    return zstandard.ZstdDecompressor().decompress(payload, max_output_size=LARGEST_CHUNK_BYTES)


def _text(connection: Connection) -> str:
    given = connection.msgdef
    return given.data if given.format == MessageDefinitionFormat.MSG else ""


def _encoding(connection: Connection) -> str:
    given = connection.ext
    return given.serialization_format if isinstance(given, ConnectionExtRosbag2) else "cdr"
