"""What was named as a log, read as one: an MCAP, a bag's folder, or a bag in another container."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from hil.log.reader import Log, Record, told_in_messages
from hil.log.unpacked import in_place_of, unpacked, whole_or_salvaged

_ZSTD = (".zstd", ".zst")


def opened_log(path: Path) -> Log:
    """The log at a path: ``.mcap``, ``.db3``, either of them with ``.zstd``, ROS 1's ``.bag``, or a folder.

    A folder is what ``ros2 bag record`` leaves: its files, in which ``metadata.yaml`` need not be, are one
    log. Of a damaged MCAP what is whole. Raises :class:`UsageError` as :func:`hil.log.reader.read_log`.
    """
    if not path.is_dir():
        return _opened(path, compressed=False)
    # What only some logs need is loaded for these.
    from hil.log.bag_folder import bag_folder

    folder = bag_folder(path)
    parts = [_opened(part, compressed=folder.in_messages) for part in folder.parts]
    return parts[0] if len(parts) == 1 else _joined(path, parts)


def _opened(path: Path, *, compressed: bool) -> Log:
    """The log in one file."""
    if path.suffix in _ZSTD:
        copy = unpacked(path)
        return in_place_of(path, _opened(copy.file, compressed=compressed), copy)
    if path.suffix == ".bag":
        from hil.log.ros_storage import read_bag

        return read_bag(path)
    if path.suffix == ".db3":
        from hil.log.ros_storage import read_db3

        log = read_db3(path, compressed=compressed)
        return replace(log, metadata=told_in_messages(log))
    return whole_or_salvaged(path)


def _joined(path: Path, parts: Sequence[Log]) -> Log:
    """Parts of a bag as one log."""
    counts: dict[str, int] = {}
    for part in parts:
        for topic, count in part.counts.items():
            counts[topic] = counts.get(topic, 0) + count
    return Log(
        path=path,
        metadata={name: entries for part in parts for name, entries in part.metadata.items()},
        topics={topic: typename for part in parts for topic, typename in part.topics.items()},
        encodings={topic: encoding for part in parts for topic, encoding in part.encodings.items()},
        definitions={name: text for part in parts for name, text in part.definitions.items()},
        messages=sum(part.messages for part in parts),
        start_ns=min((part.start_ns for part in parts if part.start_ns is not None), default=None),
        end_ns=max((part.end_ns for part in parts if part.end_ns is not None), default=None),
        channels={},
        chunks=(),
        counts=counts,
        source=partial(_merged, parts),
        damage="; ".join(f"{part.path.name}: {part.damage}" for part in parts if part.damage),
    )


def _merged(
    parts: Sequence[Log], topics: Collection[str] | None, start_ns: int | None, end_ns: int | None
) -> Iterator[Record]:
    """Messages of parts in the order of log time."""

    def of(part: Log) -> Iterator[Record]:
        # A topic that is in other parts only is nothing that this one could be asked for.
        return part.records(topics, start_ns, end_ns)

    yield from heapq.merge(*map(of, parts), key=lambda record: record.log_ns)
