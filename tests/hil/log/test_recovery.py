from __future__ import annotations

import contextlib
import os
import random
import resource
import signal
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from hil.errors import AbreastError, UsageError
from hil.log.reader import Record, read_log
from hil.log.recovery import recover
from hil.log.writer import LogWriter
from hil.wire.message_types import RangeBearing
from hil.wire.messages import encode, header

START_NS = 1_700_000_000_000_000_000
TYPENAME = RangeBearing.__msgtype__
METADATA = {"abreast": {"seed": "7", "mode": "live"}}


def sight(number: int) -> bytes:
    return encode(RangeBearing(header(START_NS + number, "base_link"), float(number), 1.5))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "run.mcap"
    with LogWriter(path, METADATA, flush_every_s=0.1) as log:
        for number in range(300):
            at = START_NS + number * 4_000_000
            log.write("a" if number % 3 else "b", TYPENAME, sight(number), at, at - 1)
    return path


def chunk_ends(path: Path) -> list[tuple[int, int]]:
    """End of each chunk record in the file, and the number of messages up to there."""
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        ends: list[tuple[int, int]] = []
        messages = 0
        for index in summary.chunk_indexes:
            count = index.message_index_length
            stream.seek(index.chunk_start_offset + index.chunk_length)
            # Each index entry takes 16 bytes, each channel's index 15 more.
            messages += (count - 15 * len(index.message_index_offsets)) // 16
            ends.append((index.chunk_start_offset + index.chunk_length, messages))
    return ends


def same_messages(records: list[Record], path: Path) -> bool:
    return records == list(read_log(path).records())[: len(records)]


def test_a_cut_anywhere_loses_only_what_follows_the_last_whole_chunk(whole: Path, tmp_path: Path) -> None:
    content = whole.read_bytes()
    ends = chunk_ends(whole)
    assert ends[-1][1] == 300
    cuts = random.Random(3).sample(range(8, len(content)), 120)
    cuts += [end + shift for end, _ in ends for shift in (-1, 0, 1)]
    for number, length in enumerate(cuts):
        torn, rescued = tmp_path / f"torn{number}.mcap", tmp_path / f"rescued{number}.mcap"
        torn.write_bytes(content[:length])
        kept = max((count for end, count in ends if end <= length), default=0)
        if not kept:
            with pytest.raises(UsageError, match="nothing to recover"):
                recover(torn, rescued)
            assert not rescued.exists()
            continue
        found = recover(torn, rescued)
        assert found.messages == kept
        assert found.bytes == rescued.stat().st_size
        records = list(read_log(rescued).records())
        assert len(records) == found.messages
        assert same_messages(records, whole)
        assert found.last_ns == (records[-1].log_ns if records else None)


def test_a_recovered_log_opens_in_rosbags_and_mcap_ros2(whole: Path, tmp_path: Path) -> None:
    torn, rescued = tmp_path / "torn.mcap", tmp_path / "rescued.mcap"
    torn.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    found = recover(torn, rescued)
    assert found.messages > 50
    assert not found.complete
    assert read_log(rescued).metadata == METADATA
    with AnyReader([rescued]) as bag:
        decoded = [bag.deserialize(payload, link.msgtype) for link, _, payload in bag.messages()]
    with rescued.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()], validate_crcs=True)
        assert len(list(reader.iter_decoded_messages())) == len(decoded) == found.messages


def test_a_torn_chunk_still_tells_until_when_messages_were_lost(whole: Path, tmp_path: Path) -> None:
    torn, rescued = tmp_path / "torn.mcap", tmp_path / "rescued.mcap"
    ends = chunk_ends(whole)
    torn.write_bytes(whole.read_bytes()[: ends[5][0] - 1])
    found = recover(torn, rescued)
    assert found.messages == ends[4][1]
    assert found.lost_until_ns == START_NS + (ends[5][1] - 1) * 4_000_000
    assert found.lost_bytes > 0


def test_a_whole_log_gives_an_equivalent_copy(whole: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy.mcap"
    found = recover(whole, copy)
    assert (found.messages, found.complete, found.lost_bytes, found.lost_until_ns) == (300, True, 0, None)
    before, after = read_log(whole), read_log(copy)
    assert list(after.records()) == list(before.records())
    for name in ("metadata", "topics", "encodings", "definitions", "messages", "start_ns", "end_ns"):
        assert getattr(after, name) == getattr(before, name)


def test_a_foreign_log_keeps_profile_numbers_and_attachments(tmp_path: Path) -> None:
    source, copy = tmp_path / "foreign.mcap", tmp_path / "copy.mcap"
    with source.open("wb") as stream:
        writer: Any = Writer(stream, use_chunking=False, compression=CompressionType.NONE)
        writer.start(profile="ros2", library="other")
        writer.add_attachment(1, 2, "notes.txt", "text/plain", b"hello")
        topic = writer.register_channel("/sight", "cdr", writer.register_schema(TYPENAME, "ros2msg", b""))
        blank = writer.register_channel("/blank", "json", 0, {"key": "value"})
        for number in range(10):
            writer.add_message(topic, START_NS + number, sight(number), START_NS, 100 + number)
        writer.add_message(blank, START_NS, b"{}", START_NS, 5)
        writer.finish()
    # The end of the data section is record 0x0F with a body of 4 bytes.
    cut = source.read_bytes().index(b"\x0f\x04\x00\x00\x00\x00\x00\x00\x00") - 1
    os.truncate(source, cut)
    found = recover(source, copy)
    assert (found.messages, found.complete) == (10, False)
    with copy.open("rb") as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == "ros2"
        assert [(item.name, item.data) for item in reader.iter_attachments()] == [("notes.txt", b"hello")]
        assert [message.sequence for _, _, message in reader.iter_messages()] == list(range(100, 110))


def test_a_damaged_chunk_is_left_out_and_the_rest_is_kept(whole: Path, tmp_path: Path) -> None:
    damaged, rescued = tmp_path / "damaged.mcap", tmp_path / "rescued.mcap"
    content = bytearray(whole.read_bytes())
    ends = chunk_ends(whole)
    content[ends[5][0] - 40] ^= 0xFF
    damaged.write_bytes(content)
    found = recover(damaged, rescued)
    assert found.messages == 300 - (ends[5][1] - ends[4][1])
    assert not found.complete
    kept = {record.payload for record in read_log(rescued).records()}
    assert kept == {sight(number) for number in range(300) if not ends[4][1] <= number < ends[5][1]}


def test_random_damage_never_raises_and_never_invents_a_message(whole: Path, tmp_path: Path) -> None:
    content = whole.read_bytes()
    originals = {record.payload for record in read_log(whole).records()}
    draw = random.Random(4)
    for number in range(150):
        damaged = bytearray(content)
        for _ in range(draw.choice([1, 5])):
            damaged[draw.randrange(8, len(content))] ^= 1 << draw.randrange(8)
        source, rescued = tmp_path / f"damaged{number}.mcap", tmp_path / f"rescued{number}.mcap"
        source.write_bytes(damaged)
        with contextlib.suppress(UsageError):
            recover(source, rescued)
        if not rescued.exists():
            continue
        with rescued.open("rb") as stream:
            assert {message.data for _, _, message in make_reader(stream).iter_messages()} <= originals


def test_recovery_never_overwrites(whole: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.mcap"
    other.write_bytes(b"precious")
    content = whole.read_bytes()
    link = tmp_path / "link.mcap"
    link.symlink_to(whole)
    for target, says in (
        (other, "exists"),
        (whole, "is the log to recover"),
        (link, "is the log to recover"),
    ):
        with pytest.raises(UsageError, match=says):
            recover(whole, target)
    assert other.read_bytes() == b"precious"
    assert whole.read_bytes() == content


@pytest.mark.parametrize(
    ("content", "says"), [(None, "no such file"), (b"", "empty"), (b"hello", "not MCAP")]
)
def test_what_is_no_log_is_refused_and_leaves_no_target(
    tmp_path: Path, content: bytes | None, says: str
) -> None:
    source, target = tmp_path / "run.mcap", tmp_path / "rescued.mcap"
    if content is not None:
        source.write_bytes(content)
    with pytest.raises(UsageError, match=says):
        recover(source, target)
    assert not target.exists()


def test_a_target_that_cannot_be_created_is_a_usage_error(whole: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be written"):
        recover(whole, tmp_path / "missing" / "rescued.mcap")


def test_a_full_disk_leaves_no_half_recovered_log(whole: Path, tmp_path: Path) -> None:
    target = tmp_path / "rescued.mcap"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
        with pytest.raises(AbreastError, match="recovering"):
            recover(whole, target)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
    assert not target.exists()


def test_the_log_under_test_has_many_chunks(whole: Path) -> None:
    with whole.open("rb") as stream:
        chunks = [
            record for record in StreamReader(stream, emit_chunks=True).records if type(record) is Chunk
        ]
    assert len(chunks) == len(chunk_ends(whole)) >= 10
