from __future__ import annotations

from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from hil.log.described_log import PERIOD_NS, DescribedLog
from hil.log.description import ORIGIN
from hil.log.reader import Log, read_log
from hil.wire.message_types import String
from hil.wire.messages import encode
from hil.wire.topics import LOG

BEGUN_NS = 1_700_000_000_000_000_000
METADATA = {"abreast": {"seed": "7"}}
ORIGINAL = {ORIGIN: {"begun_ns": str(BEGUN_NS)}}


def write(log: DescribedLog, at_ns: int) -> None:
    log.write("stop", "std_msgs/msg/String", encode(String(data="now")), at_ns, at_ns)


def times(log: Log) -> list[int]:
    return [record.log_ns - BEGUN_NS for record in log.records([LOG])]


def copied(source: Path, target: Path, first_ns: int = 0) -> Log:
    """The messages from a time on, as the ``mcap`` package's own reader and writer copy them."""
    with source.open("rb") as stream, target.open("wb") as made:
        reader, writer = make_reader(stream), Writer(made)
        writer.start(profile="ros2", library="another")
        known: dict[int, int] = {}
        for schema, channel, message in reader.iter_messages(starting_at=first_ns):
            assert schema is not None
            if channel.id not in known:
                kept = writer.register_schema(schema.name, schema.encoding, schema.data)
                known[channel.id] = writer.register_channel(channel.topic, "cdr", kept)
            writer.add_message(known[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()  # type: ignore[no-untyped-call]  # the package leaves it unannotated
    return read_log(target)


def test_a_description_stands_in_front_and_every_few_seconds(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with DescribedLog(path, METADATA) as log:
        for number in range(13):
            write(log, BEGUN_NS + number * 1_000_000_000)
    read = read_log(path)
    assert next(read.records()).topic == LOG
    assert times(read) == [0, PERIOD_NS, 2 * PERIOD_NS]
    assert read.messages == 16


def test_what_is_known_later_is_said_with_the_next_message(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with DescribedLog(path, METADATA) as log:
        write(log, BEGUN_NS)
        log.add_metadata({})
        write(log, BEGUN_NS + 1)
        log.add_metadata({"abreast.certificate": {"json": "{}"}})
        write(log, BEGUN_NS + 2)
    assert times(read_log(path)) == [0, 2]
    copy = copied(path, tmp_path / "copy.mcap")
    assert copy.metadata == {**METADATA, "abreast.certificate": {"json": "{}"}, **ORIGINAL}


@pytest.mark.parametrize("first_s", [0, 3])
def test_a_copy_of_messages_alone_has_the_metadata(first_s: int, tmp_path: Path) -> None:
    """However much is cut off in front, the log says when it began."""
    path = tmp_path / "run.mcap"
    with DescribedLog(path, METADATA) as log:
        for number in range(10):
            write(log, BEGUN_NS + number * 1_000_000_000)
    copy = copied(path, tmp_path / "copy.mcap", BEGUN_NS + first_s * 1_000_000_000)
    assert copy.messages == 12 - first_s - bool(first_s)
    assert copy.metadata == {**METADATA, **ORIGINAL}


def test_metadata_records_take_precedence_over_messages(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with DescribedLog(path, METADATA) as log:
        write(log, BEGUN_NS)
    read = read_log(path)
    assert read.metadata == {**METADATA, **ORIGINAL}
    other = tmp_path / "other.mcap"
    with DescribedLog(other, {"abreast": {"seed": "8"}}) as log:
        for record in read.records():
            log.write(record.topic, record.typename, record.payload, record.log_ns, record.publish_ns)
    assert read_log(other).metadata["abreast"] == {"seed": "8"}


def test_a_log_without_messages_is_read_by_its_metadata(tmp_path: Path) -> None:
    DescribedLog(tmp_path / "run.mcap", METADATA).close()
    assert read_log(tmp_path / "run.mcap").metadata == METADATA
