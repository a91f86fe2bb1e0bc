from __future__ import annotations

import errno
import resource
import signal
import subprocess
import sys
import textwrap
import tracemalloc
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from mcap.reader import McapReader, make_reader
from mcap.records import Footer, Statistics, SummaryOffset
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from hil.errors import AbreastError, UsageError
from hil.log import metadata_sums
from hil.log.index_spool import IndexSpool
from hil.log.reader import read_log
from hil.log.recovery import recover
from hil.log.writer import LogWriter
from hil.wire.message_types import Message, RangeBearing
from hil.wire.messages import encode, header, typename_of

START_NS = 1_700_000_000_000_000_000
TYPENAME = RangeBearing.__msgtype__
METADATA = {"abreast": {"seed": "7", "mode": "lockstep"}, "scenario": {"toml": 'name = "x"\n'}}


def sight(number: int) -> bytes:
    return encode(RangeBearing(header(START_NS + number, "base_link"), number / 7.0, 1.5))


def metadata_in(reader: McapReader) -> dict[str, dict[str, str]]:
    """Metadata records as the ``mcap`` package reads them, without their sums."""
    found = {record.name: dict(record.metadata) for record in reader.iter_metadata()}
    assert set(found.pop(metadata_sums.RECORD)) == found.keys()
    return found


def fill(log: LogWriter, count: int) -> None:
    for number in range(count):
        at = START_NS + number * 2_000_000
        log.write("a" if number % 3 else "b", TYPENAME, sight(number), at, at - 1)


def write_sights(path: Path, count: int) -> None:
    with LogWriter(path, METADATA) as log:
        fill(log, count)


def test_every_type_opens_in_rosbags_and_mcap_ros2(
    tmp_path: Path, sample_messages: dict[str, Message], plain: Callable[[object], object]
) -> None:
    path = tmp_path / "run.mcap"
    with LogWriter(path, METADATA) as log:
        for number in range(200):
            for topic, message in sample_messages.items():
                at = START_NS + number * 5_000_000
                log.write(topic, typename_of(message), encode(message), at, at - 1000)
    total = 200 * len(sample_messages)
    assert log.messages == total

    with AnyReader([path]) as bag:
        assert {link.topic: link.msgtype for link in bag.connections} == {
            topic: typename_of(message) for topic, message in sample_messages.items()
        }
        seen = 0
        for link, _, payload in bag.messages():
            expected = sample_messages[link.topic]
            assert repr(plain(bag.deserialize(payload, link.msgtype))) == repr(plain(expected))
            seen += 1
        assert seen == total

    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()], validate_crcs=True)
        decoded = list(reader.iter_decoded_messages())
        assert metadata_in(reader) == METADATA
        recorded = reader.get_header()
    assert (recorded.profile, recorded.library.partition(" ")[0]) == ("ros2", "abreast")
    assert len(decoded) == total
    for entry in decoded:
        expected = sample_messages[entry.channel.topic]
        assert repr(plain(entry.decoded_message)) == repr(plain(expected))


def test_numbers_run_per_topic_and_times_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    write_sights(path, 300)
    with path.open("rb") as stream:
        entries = [(channel.topic, message) for _, channel, message in make_reader(stream).iter_messages()]
    for topic in ("a", "b"):
        numbers = [message.sequence for name, message in entries if name == topic]
        assert numbers == list(range(len(numbers)))
    assert all(message.publish_time == message.log_time - 1 for _, message in entries)


def test_the_same_messages_give_the_same_bytes(tmp_path: Path) -> None:
    first, second = tmp_path / "first.mcap", tmp_path / "elsewhere.mcap"
    write_sights(first, 500)
    write_sights(second, 500)
    assert first.read_bytes() == second.read_bytes()


def test_a_log_without_messages_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    LogWriter(path, METADATA).close()
    with path.open("rb") as stream:
        assert list(make_reader(stream).iter_messages()) == []
    with AnyReader([path]) as bag:
        assert bag.message_count == 0


def test_metadata_and_flushed_messages_are_on_disk_before_the_end(tmp_path: Path) -> None:
    path, rescued = tmp_path / "run.mcap", tmp_path / "rescued.mcap"
    log = LogWriter(path, METADATA)
    log.write("a", TYPENAME, sight(0), START_NS, START_NS)
    log.flush()
    log.write("a", TYPENAME, sight(1), START_NS + 1, START_NS + 1)
    found = recover(path, rescued)
    log.close()
    assert (found.messages, found.complete) == (1, False)
    with rescued.open("rb") as stream:
        assert metadata_in(make_reader(stream)) == METADATA


@pytest.mark.parametrize("direction", [1, -1])
def test_messages_are_flushed_as_log_time_moves_on(tmp_path: Path, direction: int) -> None:
    path = tmp_path / "run.mcap"
    log = LogWriter(path, {}, flush_every_s=0.1)
    for number in range(60):
        at = START_NS + direction * number * 10_000_000
        log.write("a", TYPENAME, sight(number), at, at)
        if number >= 10:
            found = recover(path, tmp_path / f"rescued{number}.mcap")
            assert number + 1 - found.messages <= 10
    log.close()


def test_a_large_amount_within_one_moment_is_flushed_too(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with LogWriter(path, {}) as log:
        for _ in range(3000):
            log.write("a", TYPENAME, b"\x00" * 1000, START_NS, START_NS)
        assert recover(path, tmp_path / "rescued.mcap").messages > 1000


def test_a_killed_writer_loses_less_than_half_a_second(tmp_path: Path) -> None:
    path, rescued = tmp_path / "run.mcap", tmp_path / "rescued.mcap"
    script = textwrap.dedent(
        f"""
        import sys, time
        from pathlib import Path
        from hil.log.writer import LogWriter
        log = LogWriter(Path({str(path)!r}), {{"abreast": {{"seed": "1"}}}})
        number = 0
        while True:
            now = time.time_ns()
            log.write("a", {TYPENAME!r}, {sight(0)!r}, now, now)
            print(now, flush=True)
            time.sleep(0.002)
        """
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        last_ns = 0
        for _ in range(400):
            last_ns = int(writer.stdout.readline())
        writer.send_signal(signal.SIGKILL)
        last_ns = max([last_ns, *(int(line) for line in writer.stdout.read().splitlines(keepends=True)[:-1])])
    found = recover(path, rescued)
    assert found.last_ns is not None
    assert last_ns - found.last_ns < 500_000_000
    with AnyReader([rescued]) as bag:
        assert bag.message_count == found.messages > 200
    with rescued.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        assert len(list(reader.iter_decoded_messages())) == found.messages


def test_an_existing_log_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(UsageError, match="exists"):
        LogWriter(path, {})
    assert path.read_bytes() == b"precious"


def test_a_place_that_cannot_be_written_is_a_usage_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be written"):
        LogWriter(tmp_path / "missing" / "run.mcap", {})


def test_a_full_disk_is_one_clear_error_and_keeps_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    log = LogWriter(path, METADATA)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
        with pytest.raises(AbreastError, match="writing failed") as caught:
            fill(log, 20_000)
        assert isinstance(caught.value.__cause__, OSError)
        assert caught.value.__cause__.errno == errno.EFBIG
        log.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
    found = read_log(path)
    assert found.messages > 100
    numbers = [(record.log_ns - START_NS) // 2_000_000 for record in found.records()]
    assert numbers == list(range(found.messages))
    assert found.metadata == METADATA
    assert "it is whole up to there" in str(caught.value)
    assert recover(path, tmp_path / "copy.mcap").complete
    with path.open("rb") as stream:
        assert len(list(make_reader(stream, validate_crcs=True).iter_messages())) == found.messages
    with AnyReader([path]) as bag:
        assert bag.message_count == found.messages


def summary_at(path: Path) -> int:
    """Where the summary of a whole log begins."""
    with path.open("rb") as stream:
        (footer,) = (each for each in StreamReader(stream).records if isinstance(each, Footer))
    return int(footer.summary_start)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.9, 0.999])
def test_a_disk_that_takes_no_summary_keeps_all_of_the_data(tmp_path: Path, share: float) -> None:
    whole, path = tmp_path / "whole.mcap", tmp_path / "run.mcap"
    with LogWriter(whole, METADATA) as log:
        fill(log, 3_000)
    begin, end = summary_at(whole), whole.stat().st_size
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    log = LogWriter(path, METADATA)
    try:
        fill(log, 3_000)
        # An end without a summary takes 50 bytes.
        resource.setrlimit(resource.RLIMIT_FSIZE, (begin + 50 + round(share * (end - begin - 51)), hard))
        with pytest.raises(AbreastError, match="it is whole up to there"):
            log.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
    assert read_log(path).messages == 3_000
    with path.open("rb") as stream:
        assert len(list(make_reader(stream, validate_crcs=True).iter_messages())) == 3_000


def test_an_index_that_cannot_be_read_back_keeps_all_of_the_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: IndexSpool) -> Iterator[bytes]:
        yield b"half of it"
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(IndexSpool, "blocks", broken)
    log = LogWriter(tmp_path / "run.mcap", METADATA)
    fill(log, 3_000)
    with pytest.raises(AbreastError, match=r"Input/output error.*it is whole up to there"):
        log.close()
    assert read_log(tmp_path / "run.mcap").messages == 3_000


def test_an_unknown_type_is_refused_when_it_is_written(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "run.mcap", {}) as log, pytest.raises(UsageError, match="foo_msgs/msg/Bar"):
        log.write("a", "foo_msgs/msg/Bar", b"", START_NS, START_NS)


def test_a_long_run_takes_little_memory_for_the_index_of_its_log(tmp_path: Path) -> None:
    payload = sight(1)
    with LogWriter(tmp_path / "long.mcap", {}) as log:
        held: list[int] = []
        tracemalloc.start()
        for chunk in range(600):
            for topic in "abcdefgh":
                log.write(topic, TYPENAME, payload, chunk, chunk)
            log.flush()
            held.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
    assert held[-1] - held[100] < 500 * 400
    assert read_log(tmp_path / "long.mcap").messages == 4800


def test_the_summary_counts_what_is_there_and_points_at_it(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with LogWriter(path, METADATA) as log:
        fill(log, 300)
        log.add_metadata({"verdict": {"ok": "yes"}})
    raw = path.read_bytes()
    with path.open("rb") as stream:
        records = list(StreamReader(stream, emit_chunks=True).records)
    kinds = Counter(type(record).__name__ for record in records)
    (said,) = (record for record in records if isinstance(record, Statistics))
    assert said.message_count == 300
    assert said.chunk_count == kinds["Chunk"] == kinds["ChunkIndex"] > 1
    assert said.attachment_count == kinds["Attachment"] == 0
    assert said.metadata_count == kinds["Metadata"] == kinds["MetadataIndex"] == 5
    assert (said.channel_count, said.schema_count) == (2, 1)
    assert sorted(said.channel_message_counts.values()) == [100, 200]
    assert said.message_start_time == START_NS
    assert said.message_end_time == START_NS + 299 * 2_000_000
    offsets = [record for record in records if isinstance(record, SummaryOffset)]
    assert {each.group_opcode for each in offsets} == {0x03, 0x04, 0x08, 0x0B, 0x0D}
    for each in offsets:
        at, end = each.group_start, each.group_start + each.group_length
        while at < end:
            assert raw[at] == each.group_opcode
            at += 9 + int.from_bytes(raw[at + 1 : at + 9], "little")
        assert at == end
        assert raw[end] != each.group_opcode
