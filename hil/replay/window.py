"""Messages of a log on their way through a replay: those of the last seconds, and where each of them lies.

An output rests on inputs that were logged a little before it or after it; nothing else needs to be held. All
of it lies in rows that Python owns, and moves up or grows where there is no room.
"""

from __future__ import annotations

from typing import NamedTuple

from formation.byte_access import bytes_at, read_byte, read_int64, write_byte, write_int64
from formation.kernel import kernel
from formation.records import Buffer, Rows, load, size, store
from hil.wire.blake2b import BLOCK_BYTES, digest_of

NOT_WANTED, UNKNOWN_CHANNEL = -1, -2
"""What stands for a topic's number where there is none: of a channel that nobody listens to, and of one that
the log does not tell of."""

TORN, NO_CHANNEL = -1, -2
"""What is wrong with a chunk: a record is longer than it, or a message is of an unknown channel."""

NOT_THERE = -1

_RECORD_BYTES, _HEAD_BYTES = 9, 22
_MESSAGE = 5


class Topic(NamedTuple):
    """A topic: where its name stands among ``names``, whether receipts name its messages by their digests.

    ``aside``: whether Python wants to see each message itself.
    """

    name_at: int
    name_bytes: int
    hashed: bool
    aside: bool


class Number(NamedTuple):
    """A number in a row."""

    value: int


class Logged(NamedTuple):
    """A message in the window: when it was logged, where its payload lies, its topic and digest (or 0)."""

    log_ns: int
    at: int
    length: int
    topic: int
    digest: int


class Extent(NamedTuple):
    """How far a window is filled: of ``room`` bytes, and with how many messages.

    ``admitted``: how many of these are in their place and have a digest; ``asides``: how many of the latter
    Python has still to look at. ``odd``: whether one was found that only Python can read.
    """

    room: int
    filled: int
    messages: int
    admitted: int
    asides: int
    odd: bool


class Window(NamedTuple):
    """Rows of a window.

    ``slots``: numbers of messages by their digests, from 1 on, 0 for none; a power of two of them. ``names``:
    of topics, each with a zero behind it, as digests begin with. ``channels``: topics by channel id.
    """

    arena: Buffer
    logged: Rows[Logged]
    slots: Rows[Number]
    extent: Rows[Extent]
    topics: Rows[Topic]
    names: Buffer
    channels: Rows[Number]
    asides: Rows[Number]


@kernel
def _copied(source: bytes, at: int, length: int, target: Buffer, to: int) -> None:
    """Copy bytes."""
    words = length // 8
    for k in range(words):
        write_int64(target, to + 8 * k, read_int64(source, at + 8 * k))
    for k in range(8 * words, length):
        write_byte(target, to + k, read_byte(source, at + k))


@kernel
def padded_to(buffer: Buffer, at: int, until: int) -> None:
    """Fill up with zeros."""
    while at < until and at % 8 != 0:
        write_byte(buffer, at, 0)
        at += 1
    while at < until:
        write_int64(buffer, at, 0)
        at += 8


@kernel
def named(window: Window, topic: Topic, source: bytes, source_at: int, length: int, to: int) -> int:
    """Put a topic's name and a payload where digests can be made of both; the position after the zeros."""
    arena, begin = window.arena, to + topic.name_bytes
    _copied(bytes_at(window.names, topic.name_at, topic.name_bytes), 0, topic.name_bytes, arena, to)
    _copied(source, source_at, length, arena, begin)
    end = to + _whole_blocks(topic.name_bytes + length)
    padded_to(arena, begin + length, end)
    return end


@kernel
def _whole_blocks(length: int) -> int:
    return max(1, (length + BLOCK_BYTES - 1) // BLOCK_BYTES) * BLOCK_BYTES


@kernel
def named_in(window: Window, topic: Topic, payload: bytes, scratch: Buffer) -> int:
    """Put a topic's name and a payload into a buffer, to make a digest of; how much of it is filled."""
    length = len(payload)
    _copied(bytes_at(window.names, topic.name_at, topic.name_bytes), 0, topic.name_bytes, scratch, 0)
    _copied(payload, 0, length, scratch, topic.name_bytes)
    end = _whole_blocks(topic.name_bytes + length)
    padded_to(scratch, topic.name_bytes + length, end)
    return end


@kernel
def room_for(topic: Topic, length: int) -> int:
    """Bytes that a payload takes at most."""
    return topic.name_bytes + length + BLOCK_BYTES + 8


@kernel
def _put(window: Window, number: int, log_ns: int, chunk: bytes, at: int, length: int) -> bool:
    """Put a message where its log time is in order; whether there was room."""
    extent, topic = load(Extent, window.extent, 0), load(Topic, window.topics, number)
    count = extent.messages
    if count >= size(window.logged) or extent.filled + room_for(topic, length) > extent.room:
        return False
    end = named(window, topic, chunk, at, length, extent.filled)
    place = count
    while place > extent.admitted and load(Logged, window.logged, place - 1).log_ns > log_ns:
        store(window.logged, place, load(Logged, window.logged, place - 1))
        place -= 1
    store(window.logged, place, Logged(log_ns, extent.filled + topic.name_bytes, length, number, 0))
    store(window.extent, 0, extent._replace(filled=end, messages=count + 1))
    return True


@kernel(inline=False)
def taken_in(window: Window, chunk: bytes, at: int) -> int:
    """Take the wanted messages of a chunk's records in; how far: before its end there was no room for more.

    Negative is what is wrong with the chunk.
    """
    end = len(chunk)
    while at < end:
        if at + _RECORD_BYTES > end:
            return TORN
        opcode, length, body = read_byte(chunk, at), read_int64(chunk, at + 1), at + _RECORD_BYTES
        if length < 0 or length > end - body or (opcode == _MESSAGE and length < _HEAD_BYTES):
            return TORN
        if opcode == _MESSAGE:
            channel = read_byte(chunk, body) + 256 * read_byte(chunk, body + 1)
            number = load(Number, window.channels, channel).value
            if number == UNKNOWN_CHANNEL:
                return NO_CHANNEL
            if number != NOT_WANTED:
                log_ns = read_int64(chunk, body + 6)
                if not _put(window, number, log_ns, chunk, body + _HEAD_BYTES, length - _HEAD_BYTES):
                    return at
        at = body + length
    return at


@kernel
def _slot(window: Window, digest: int) -> int:
    """Slot of a digest, or the empty one where it would be."""
    mask = size(window.slots) - 1
    place = (digest ^ (digest >> 32)) & mask
    number = load(Number, window.slots, place).value
    while number > 0 and load(Logged, window.logged, number - 1).digest != digest:
        place = (place + 1) & mask
        number = load(Number, window.slots, place).value
    return place


@kernel
def _kept_by_digest(window: Window, digest: int, place: int) -> None:
    """Let a message be found by its digest, unless an earlier one has it too."""
    slot = _slot(window, digest)
    if load(Number, window.slots, slot).value == 0:
        store(window.slots, slot, Number(place + 1))


@kernel(inline=False)
def found(window: Window, digest: int) -> int:
    """Number of the first message with a digest, NOT_THERE for none."""
    return load(Number, window.slots, _slot(window, digest)).value - 1


@kernel(inline=False)
def admitted(window: Window, until_ns: int) -> None:
    """Admit all messages that were logged before a time: nothing will come in front of them any more."""
    extent = load(Extent, window.extent, 0)
    place, asides, odd = extent.admitted, extent.asides, extent.odd
    while place < extent.messages:
        logged = load(Logged, window.logged, place)
        if logged.log_ns >= until_ns:
            break
        topic = load(Topic, window.topics, logged.topic)
        if topic.hashed:
            begin = logged.at - topic.name_bytes
            padded = bytes_at(window.arena, begin, logged.length + topic.name_bytes + BLOCK_BYTES)
            digest = digest_of(padded, logged.length + topic.name_bytes)
            store(window.logged, place, logged._replace(digest=digest))
            _kept_by_digest(window, digest, place)
            odd = odd or logged.length < 2 or is_big_endian(window, logged)
        if topic.aside:
            store(window.asides, asides, Number(place))
            asides += 1
        place += 1
    store(window.extent, 0, extent._replace(admitted=place, asides=asides, odd=odd))


@kernel
def is_big_endian(window: Window, logged: Logged) -> bool:
    """Whether only the general codec can read a payload."""
    payload = bytes_at(window.arena, logged.at, logged.length)
    return read_byte(payload, 0) == 0 and read_byte(payload, 1) == 0


@kernel(inline=False)
def moved_up(window: Window, first: int) -> None:
    """Forget the messages before the first that is to be kept, and move that to the begin, found anew."""
    extent = load(Extent, window.extent, 0)
    begin = extent.filled
    for k in range(first, extent.messages):
        logged = load(Logged, window.logged, k)
        begin = min(begin, logged.at - load(Topic, window.topics, logged.topic).name_bytes)
    arena = bytes_at(window.arena, 0, extent.filled)
    _copied(arena, begin, extent.filled - begin, window.arena, 0)
    for k in range(size(window.slots)):
        store(window.slots, k, Number(0))
    for k in range(first, extent.messages):
        logged = load(Logged, window.logged, k)
        logged = logged._replace(at=logged.at - begin)
        store(window.logged, k - first, logged)
        if k < extent.admitted and load(Topic, window.topics, logged.topic).hashed:
            _kept_by_digest(window, logged.digest, k - first)
    count, filled = extent.messages - first, extent.filled - begin
    extent = extent._replace(filled=filled, messages=count, admitted=extent.admitted - first, asides=0)
    store(window.extent, 0, extent)
