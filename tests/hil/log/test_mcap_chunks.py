from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    ChunkIndex,
    Footer,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.stream_reader import StreamReader, breakup_chunk

from hil.log import metadata_sums
from hil.log.mcap_chunks import MAGIC, ChunkedMcap
from hil.log.writer import LogWriter
from hil.wire.message_types import String
from hil.wire.messages import encode

START_NS = 1_700_000_000_000_000_000
LIMIT_NS = 100_000_000
R = TypeVar("R", bound=McapRecord)

writings = st.lists(
    st.tuples(st.sampled_from("abc"), st.integers(-3 * LIMIT_NS, 3 * LIMIT_NS), st.binary(max_size=40)),
    max_size=60,
)


def written(path: Path, messages: list[tuple[str, int, bytes]]) -> bytes:
    """A log of messages of any payload, with metadata first, in between and last."""
    path.unlink(missing_ok=True)
    with LogWriter(path, {"first": {"k": "v"}}, flush_every_s=LIMIT_NS * 1e-9) as log:
        for number, (topic, offset_ns, payload) in enumerate(messages):
            if number == 20:
                log.add_metadata({"between": {"k": "w"}})
            log.write(topic, String.__msgtype__, payload, START_NS + offset_ns, START_NS + number)
        log.add_metadata({"last": {}})
    return path.read_bytes()


def spans(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Opcode, begin and end of each record of a file, its chunks unopened."""
    at = len(MAGIC)
    while at < len(content) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", content, at)
        yield opcode, at, at + 9 + length
        at += 9 + length


def of(kind: type[R], records: list[Any]) -> list[R]:
    return [record for record in records if isinstance(record, kind)]


def read(content: bytes) -> list[McapRecord]:
    """All records by the ``mcap`` package's reader, chunks unopened, checksums looked at."""
    return list(StreamReader(BytesIO(content), emit_chunks=True, validate_crcs=True).records)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("chunks")


@given(writings)
@settings(deadline=None, max_examples=40)
def test_statistics_count_what_is_there(folder: Path, messages: list[tuple[str, int, bytes]]) -> None:
    records = read(written(folder / "a.mcap", messages))
    opened = [record for chunk in of(Chunk, records) for record in breakup_chunk(chunk, validate_crc=True)]
    found = of(Message, opened)
    types, channels = first_of(of(Schema, opened)), first_of(of(Channel, opened))
    times = [message.log_time for message in found]
    (statistics,) = of(Statistics, records)
    assert statistics == Statistics(
        attachment_count=len(of(Attachment, records)),
        channel_count=len(channels),
        channel_message_counts=dict(Counter(message.channel_id for message in found)),
        chunk_count=len(of(Chunk, records)),
        message_count=len(messages),
        message_start_time=min(times, default=0),
        message_end_time=max(times, default=0),
        metadata_count=len(of(Metadata, records)),
        schema_count=len(types),
    )
    # What stands in chunks stands in the summary too, so that a reader need not open them.
    assert channels == of(Channel, records)
    assert types == of(Schema, records)


def first_of(told: list[R]) -> list[R]:
    """Each of what may be told several times once, in order of its first time."""
    return [record for number, record in enumerate(told) if record not in told[:number]]


@given(writings)
@settings(deadline=None, max_examples=40)
def test_indexes_lead_to_each_chunk_and_message(folder: Path, messages: list[tuple[str, int, bytes]]) -> None:
    content = written(folder / "b.mcap", messages)
    records = list(spans(content))
    chunks = [place for place, record in enumerate(records) if record[0] == Opcode.CHUNK]
    indexes = of(ChunkIndex, read(content))
    assert [index.chunk_start_offset for index in indexes] == [records[place][1] for place in chunks]
    for place, index in zip(chunks, indexes, strict=True):
        _, begin, end = records[place]
        chunk = Chunk.read(ReadDataStream(BytesIO(content[begin + 9 : end])))
        assert (index.chunk_length, index.compression) == (end - begin, chunk.compression)
        assert (index.compressed_size, index.uncompressed_size) == (len(chunk.data), chunk.uncompressed_size)
        inside = breakup_chunk(chunk, validate_crc=True)
        times = [message.log_time for message in of(Message, inside)]
        assert (index.message_start_time, index.message_end_time) == (min(times), max(times))
        assert (chunk.message_start_time, chunk.message_end_time) == (min(times), max(times))
        by_channel: dict[int, list[tuple[int, int]]] = {}
        at = 0
        for record in inside:
            if isinstance(record, Message):
                by_channel.setdefault(record.channel_id, []).append((record.log_time, at))
            at += _size(record)
        follows = records[place + 1 : place + 1 + len(by_channel)]
        assert sum(until - since for _, since, until in follows) == index.message_index_length
        assert sorted(index.message_index_offsets.values()) == [since for _, since, _ in follows]
        for channel, since in index.message_index_offsets.items():
            entry = MessageIndex.read(ReadDataStream(BytesIO(content[since + 9 :])))
            assert (entry.channel_id, list(entry.records)) == (channel, by_channel[channel])


def _size(record: McapRecord) -> int:
    """Size of a record that stands in a chunk."""
    if isinstance(record, Message):
        return 9 + 22 + len(record.data)
    if isinstance(record, Schema):
        return 9 + 2 + 4 + len(record.name) + 4 + len(record.encoding) + 4 + len(record.data)
    assert isinstance(record, Channel)
    texts = [record.topic, record.message_encoding, *record.metadata, *record.metadata.values()]
    return 9 + 2 + 2 + 4 + sum(4 + len(text) for text in texts)


@given(writings)
@settings(deadline=None, max_examples=40)
def test_the_summary_is_where_the_footer_and_its_offsets_say(
    folder: Path, messages: list[tuple[str, int, bytes]]
) -> None:
    content = written(folder / "c.mcap", messages)
    records = list(spans(content))
    parsed = read(content)
    (footer,) = of(Footer, parsed)
    (end,) = [until for opcode, _, until in records if opcode == Opcode.DATA_END]
    assert footer.summary_start == end
    crc_at = records[-1][2] - 4
    assert footer.summary_crc == zlib.crc32(content[footer.summary_start : crc_at])
    offsets = of(SummaryOffset, parsed)
    first_offset = next(begin for opcode, begin, _ in records if opcode == Opcode.SUMMARY_OFFSET)
    assert footer.summary_offset_start == first_offset
    at = footer.summary_start
    for group in offsets:
        inside = [
            record
            for record in records
            if group.group_start <= record[1] < group.group_start + group.group_length
        ]
        assert group.group_start == at == inside[0][1]
        at += group.group_length
        assert inside[-1][2] == at
        assert {opcode for opcode, _, _ in inside} == {group.group_opcode}
    assert at == first_offset
    assert len({group.group_opcode for group in offsets}) == len(offsets)


def test_metadata_is_found_by_its_index(folder: Path) -> None:
    content = written(folder / "d.mcap", [("a", number, b"") for number in range(30)])
    indexes = of(MetadataIndex, read(content))
    assert [index.name for index in indexes] == [
        each for name in ("first", "between", "last") for each in (name, metadata_sums.RECORD)
    ]
    for index in indexes:
        begin = index.offset
        assert (Opcode.METADATA, begin, begin + index.length) in list(spans(content))
        assert Metadata.read(ReadDataStream(BytesIO(content[begin + 9 :]))).name == index.name


@given(writings)
@settings(deadline=None, max_examples=60)
def test_no_chunk_spans_more_log_time_than_it_may(
    folder: Path, messages: list[tuple[str, int, bytes]]
) -> None:
    records = read(written(folder / "e.mcap", messages))
    for chunk in of(Chunk, records):
        assert chunk.message_end_time - chunk.message_start_time < LIMIT_NS
    # Nor does one end sooner than it must: the message after it would have made it too long.
    opened = [of(Message, breakup_chunk(chunk)) for chunk in of(Chunk, records)]
    for before, after in pairwise(opened):
        times = [message.log_time for message in (*before, after[0])]
        assert max(times) - min(times) >= LIMIT_NS


def test_sequence_numbers_begin_anew_after_the_last_that_fits() -> None:
    pieces: list[bytes] = []
    mcap = ChunkedMcap(pieces.append, "ros2", "test")
    channel = mcap.add_channel("a", mcap.add_schema("s", "ros2msg", b""), "cdr", {})
    mcap._message_counts[channel] = 2**32 - 1
    for number in range(3):
        mcap.add_message(channel, number, number, encode(String(data="x")))
    mcap.finish()
    (chunk,) = of(Chunk, read(b"".join(pieces)))
    numbers = [message.sequence for message in of(Message, breakup_chunk(chunk))]
    assert numbers == [2**32 - 1, 0, 1]
