"""The messages of a log in bulk: whole chunks of MCAP records, as compiled code reads them."""

from __future__ import annotations

import struct
import threading
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from queue import Full, Queue
from typing import NamedTuple

from mcap.opcode import Opcode

from hil.log.events import logged_records
from hil.log.mcap_order import chunk_data
from hil.log.reader import Log, reading
from hil.wire import topics

_BATCH_BYTES = 1 << 19
_AHEAD = 3  # batches that are read while one is worked on
_END_OF_TIME = 2**63 - 1
_MESSAGE_HEAD = struct.Struct("<BQHIQQ")
_MESSAGE_BYTES = 22
_PATIENCE_S = 0.1


class Batch(NamedTuple):
    """MCAP records; what was logged before ``until_ns`` is in this batch or in one before."""

    records: bytes
    until_ns: int


@dataclass(frozen=True, slots=True)
class Bulk:
    """Batches of a log, and the topics of the channel ids in them."""

    topics: Mapping[int, str]
    batches: Iterator[Batch]


def in_bulk(log: Log, names: Collection[str]) -> Bulk:
    """The messages on these topics, and maybe others, in chunks as they were logged or put together.

    What was kept as malformed comes back on the topic that it came in on. Reading goes ahead in a thread.
    Raises :class:`UsageError` as :meth:`Log.records`, some of it once batches are taken.
    """
    log.check_encodings([name for name in names if name in log.topics])
    if log.chunks and topics.MALFORMED not in log.topics:
        known = {number: topic for number, (topic, _) in log.channels.items()}
        return Bulk(known, _ahead(_of_chunks(log)))
    numbered = dict(enumerate(sorted(names)))
    return Bulk(numbered, _ahead(_of_records(log, numbered)))


def _of_chunks(log: Log) -> Iterator[Batch]:
    """Chunks in the order of their first messages, several at a time."""
    ends = [*(chunk.first_ns for chunk in log.chunks[1:]), _END_OF_TIME]
    gathered: list[bytes] = []
    with reading(log.path) as stream:
        for chunk, until_ns in zip(log.chunks, ends, strict=True):
            gathered.append(chunk_data(stream, chunk.offset))
            if sum(map(len, gathered)) >= _BATCH_BYTES or until_ns == _END_OF_TIME:
                yield Batch(b"".join(gathered), until_ns)
                gathered.clear()


def _of_records(log: Log, numbered: Mapping[int, str]) -> Iterator[Batch]:
    """Records of messages that come one by one: of a log without an index, or with malformed messages."""
    channels = {topic: number for number, topic in numbered.items()}
    pieces: list[bytes] = []
    size = 0
    for topic, payload, log_ns in logged_records(log, channels):
        if size >= _BATCH_BYTES:
            yield Batch(b"".join(pieces), log_ns)
            pieces, size = [], 0
        length = _MESSAGE_BYTES + len(payload)
        pieces += (_MESSAGE_HEAD.pack(Opcode.MESSAGE, length, channels[topic], 0, log_ns, log_ns), payload)
        size += length
    yield Batch(b"".join(pieces), _END_OF_TIME)


def _ahead(batches: Iterable[Batch]) -> Iterator[Batch]:
    """The same, read in a thread while those before are worked on; decompression leaves others running."""
    waiting: Queue[Batch | BaseException | None] = Queue(_AHEAD)
    stopped = threading.Event()

    def put(item: Batch | BaseException | None) -> bool:
        while not stopped.is_set():
            try:
                waiting.put(item, timeout=_PATIENCE_S)
            except Full:
                continue
            return True
        return False

    def read() -> None:
        try:
            for batch in batches:
                if not put(batch):
                    return
        except BaseException as error:  # whatever it is, it is for who takes the batches
            put(error)
        else:
            put(None)

    reader = threading.Thread(target=read, name="log reader", daemon=True)
    reader.start()
    try:
        while (item := waiting.get()) is not None:
            if isinstance(item, BaseException):
                raise item
            yield item
    finally:
        stopped.set()
        reader.join()
