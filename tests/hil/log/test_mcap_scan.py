from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from mcap.writer import CompressionType, Writer

from hil.log.mcap_chunks import MAGIC, ChunkedMcap
from hil.log.mcap_scan import scanned_summary
from hil.log.mcap_summary import read_summary
from hil.log.reader import read_log
from hil.log.writer import LogWriter
from hil.wire.message_types import RangeBearing
from hil.wire.messages import encode, header

START_NS = 1_700_000_000_000_000_000
TYPENAME = RangeBearing.__msgtype__


def write(path: Path, count: int) -> None:
    with LogWriter(path, {"first": {"k": "v"}}, flush_every_s=0.1) as log:
        for number in range(count):
            # Times of two topics that are not in order.
            at = START_NS + number * 10_000_000 - (number % 3) * 15_000_000
            payload = encode(RangeBearing(header(at, "x"), float(number), 1.0))
            log.write("ab"[number % 2], TYPENAME, payload, at, at)
        log.add_metadata({"last": {}})


@pytest.mark.parametrize("count", [0, 1, 250])
def test_a_scan_finds_what_the_summary_tells(tmp_path: Path, count: int) -> None:
    path = tmp_path / "run.mcap"
    write(path, count)
    with path.open("rb") as stream:
        told, found = read_summary(stream), scanned_summary(stream)
    assert told is not None
    assert (found.schemas, found.channels, found.metadata) == (told.schemas, told.channels, told.metadata)
    assert found.statistics == told.statistics
    without_maps = [place._replace(offsets=b"") for place in told.chunks]
    assert found.chunks == without_maps


def test_a_log_without_a_summary_reads_the_same(tmp_path: Path) -> None:
    whole, bare = tmp_path / "whole.mcap", tmp_path / "bare.mcap"
    write(whole, 250)
    content = whole.read_bytes()
    # The data section ends with record 0x0F, which has 4 bytes.
    end = content.index(b"\x0f\x04\x00\x00\x00\x00\x00\x00\x00")
    bare.write_bytes(content[:end] + ChunkedMcap.bare_end())
    one, other = read_log(whole), read_log(bare)
    assert list(other.records()) == list(one.records())
    assert list(other.records(["a"], START_NS + 10**9)) == list(one.records(["a"], START_NS + 10**9))
    same = {field.name for field in dataclasses.fields(one)} - {"path", "chunks"}
    assert {name: getattr(other, name) for name in same} == {name: getattr(one, name) for name in same}


def test_messages_outside_of_chunks_are_counted_and_read(tmp_path: Path) -> None:
    path = tmp_path / "plain.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, use_chunking=False, compression=CompressionType.NONE, use_statistics=False)
        writer.start(profile="ros2", library="other")
        topic = writer.register_channel("/a", "cdr", writer.register_schema(TYPENAME, "ros2msg", b""))
        for number in range(5):
            writer.add_message(topic, START_NS + number, b"payload", START_NS)
        writer.finish()  # type: ignore[no-untyped-call]
    log = read_log(path)
    assert (log.messages, log.start_ns, log.end_ns) == (5, START_NS, START_NS + 4)
    assert [record.payload for record in log.records()] == [b"payload"] * 5
    assert path.read_bytes().startswith(MAGIC)
