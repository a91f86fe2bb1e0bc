from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from hil.errors import UsageError
from hil.log.reader import Record, read_log
from hil.log.writer import LogWriter
from hil.wire.message_types import Message, Odometry, RangeBearing
from hil.wire.messages import MalformedPayloadError, definition, encode, header, typename_of

START_NS = 1_700_000_000_000_000_000
TYPENAME = RangeBearing.__msgtype__


def sight(number: int) -> bytes:
    return encode(RangeBearing(header(START_NS + number, "base_link"), float(number), 1.5))


def write_sights(path: Path, times_ns: list[int]) -> None:
    with LogWriter(path, {"abreast": {"seed": "7"}}) as log:
        for number, at in enumerate(times_ns):
            log.write("ab"[number % 2], TYPENAME, sight(number), START_NS + at, START_NS + at)


def test_a_log_tells_what_it_holds_and_decodes_to_our_classes(
    tmp_path: Path, sample_messages: dict[str, Message], plain: Callable[[object], object]
) -> None:
    path = tmp_path / "run.mcap"
    with LogWriter(path, {"abreast": {"seed": "7"}, "scenario": {"name": "turtlebot3"}}) as writer:
        for at, (topic, message) in enumerate(sample_messages.items()):
            writer.write(topic, typename_of(message), encode(message), START_NS + at, START_NS + at - 5)
    log = read_log(path)
    assert log.metadata == {"abreast": {"seed": "7"}, "scenario": {"name": "turtlebot3"}}
    assert log.topics == {topic: typename_of(message) for topic, message in sample_messages.items()}
    assert log.definitions[TYPENAME] == definition(TYPENAME)
    assert (log.messages, log.start_ns) == (len(sample_messages), START_NS)
    assert log.end_ns == START_NS + len(sample_messages) - 1
    for record, (topic, message) in zip(log.records(), sample_messages.items(), strict=True):
        assert (record.topic, record.payload) == (topic, encode(message))
        assert record.publish_ns == record.log_ns - 5
        decoded = log.decode(record)
        assert type(decoded) is type(message)
        assert repr(plain(decoded)) == repr(plain(message))


@settings(max_examples=30)
@given(times=st.lists(st.integers(0, 8).map(lambda tick: tick * 60_000_000), min_size=1, max_size=60))
def test_records_come_by_log_time_and_then_as_in_the_file(
    times: list[int], tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    write_sights(path, times)
    expected = sorted(range(len(times)), key=lambda number: times[number])
    assert [record.payload for record in read_log(path).records()] == [sight(number) for number in expected]


def test_records_are_filtered_by_topic_and_time(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    write_sights(path, [number * 10_000_000 for number in range(100)])
    log = read_log(path)
    start_ns, end_ns = START_NS + 200_000_000, START_NS + 400_000_000
    some = list(log.records(topics=["a"], start_ns=start_ns, end_ns=end_ns))
    assert [record.payload for record in some] == [sight(number) for number in range(20, 40, 2)]
    assert {record.topic for record in some} == {"a"}
    assert list(log.records(start_ns=end_ns, end_ns=start_ns)) == []
    assert list(log.records(topics=[])) == []
    assert len(list(log.records())) == 100


def test_a_log_without_messages_is_read(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    LogWriter(path, {"abreast": {"seed": "1"}}).close()
    log = read_log(path)
    assert (log.messages, log.start_ns, log.end_ns) == (0, None, None)
    assert log.metadata == {"abreast": {"seed": "1"}}
    assert list(log.records()) == []


def test_a_rosbag2_recording_is_read(tmp_path: Path, sample_messages: dict[str, Message]) -> None:
    typestore = get_typestore(Stores.ROS2_JAZZY)
    foreign_name = "lab_msgs/msg/Wheel"
    typestore.register(get_types_from_msg("float32 speed\nint32[2] ticks\n", foreign_name))
    with BagWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        odometry = bag.add_connection("/robot/odom", Odometry.__msgtype__, typestore=typestore)
        wheel = bag.add_connection("/robot/wheel", foreign_name, typestore=typestore)
        bag.write(odometry, START_NS, encode(sample_messages["leader/odom"]))
        bag.write(wheel, START_NS + 1, b"\x00\x01\x00\x00\x00\x00\x00\x3f\x05\x00\x00\x00\xff\xff\xff\xff")
    log = read_log(tmp_path / "bag" / "bag.mcap")
    assert log.topics == {"/robot/odom": Odometry.__msgtype__, "/robot/wheel": foreign_name}
    first, second = log.records()
    assert isinstance(log.decode(first), Odometry)
    decoded: Any = log.decode(second)
    assert (decoded.speed, list(decoded.ticks)) == (0.5, [5, -1])
    with pytest.raises(UsageError, match="is a folder; expected an MCAP file"):
        read_log(tmp_path / "bag")


@pytest.mark.parametrize("chunks", [True, False])
@pytest.mark.parametrize("summary", [True, False])
def test_recordings_without_chunks_index_or_definitions_are_read(
    tmp_path: Path, chunks: bool, summary: bool
) -> None:
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as stream:
        writer: Any = Writer(
            stream,
            compression=CompressionType.LZ4,
            use_chunking=chunks,
            index_types=IndexType.ALL if summary else IndexType.NONE,
            repeat_channels=summary,
            repeat_schemas=summary,
            use_statistics=summary,
            use_summary_offsets=summary,
        )
        writer.start(profile="ros2", library="other")
        writer.add_metadata("lab", {"who": "someone"})
        schema = writer.register_schema("abreast_msgs/RangeBearing", "ros2msg", b"")
        channel = writer.register_channel("/sight", "cdr", schema)
        for number in (3, 1, 2):
            writer.add_message(channel, START_NS + number, sight(number), START_NS, 9)
        writer.finish()
    log = read_log(path)
    assert (log.messages, log.start_ns, log.end_ns) == (3, START_NS + 1, START_NS + 3)
    assert log.topics == {"/sight": TYPENAME}
    assert log.metadata == {"lab": {"who": "someone"}}
    records = list(log.records(topics=["/sight"]))
    assert [record.payload for record in records] == [sight(number) for number in (1, 2, 3)]
    assert isinstance(log.decode(records[0]), RangeBearing)


def test_a_topic_that_is_not_cdr_is_refused_and_leaves_the_others_readable(tmp_path: Path) -> None:
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as stream:
        writer: Any = Writer(stream)
        writer.start(profile="", library="other")
        json = writer.register_channel("/notes", "json", writer.register_schema("Note", "jsonschema", b"{}"))
        cdr = writer.register_channel("/sight", "cdr", writer.register_schema(TYPENAME, "ros2msg", b""))
        writer.add_message(json, START_NS, b"{}", START_NS)
        writer.add_message(cdr, START_NS, sight(1), START_NS)
        writer.finish()
    log = read_log(path)
    assert [record.payload for record in log.records(topics=["/sight"])] == [sight(1)]
    for topics in (["/notes"], None):
        with pytest.raises(UsageError, match=r"'/notes' is encoded as 'json', expected 'cdr'"):
            list(log.records(topics=topics))


def test_a_malformed_payload_is_told_when_it_is_decoded(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with LogWriter(path, {}) as writer:
        writer.write("a", TYPENAME, b"\x01\x02\x03", START_NS, START_NS)
    log = read_log(path)
    [record] = log.records()
    with pytest.raises(MalformedPayloadError):
        log.decode(record)
    with pytest.raises(UsageError, match="foo_msgs/msg/Bar"):
        log.decode(Record("a", "foo_msgs/msg/Bar", b"", 0, 0, 0))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "no such file"),
        (b"", "is empty"),
        (b"t,x,y\n0,1,2\n", "is not MCAP"),
        (b"\x89MCAP0\r\n", "is cut off; make it whole with: abreast recover"),
        (b"\x89MCAP0\r\n" * 2, "is cut off"),
        (b"\x89MCAP0\r\n" * 20, "is damaged"),
    ],
)
def test_a_file_that_is_no_log_is_one_clear_line(tmp_path: Path, content: bytes | None, says: str) -> None:
    path = tmp_path / "run.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(UsageError) as caught:
        read_log(path)
    assert says in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_folder_is_no_log(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is a folder"):
        read_log(tmp_path)


def test_a_cut_off_log_says_how_to_make_it_whole(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    write_sights(path, [number * 10_000_000 for number in range(100)])
    whole = path.read_bytes()
    for length in random.Random(1).sample(range(8, len(whole)), 40):
        path.write_bytes(whole[:length])
        with pytest.raises(UsageError, match="abreast recover"):
            read_log(path)


def test_damage_anywhere_is_a_usage_error_or_alters_no_message(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    write_sights(path, [number * 10_000_000 for number in range(100)])
    whole = path.read_bytes()
    written = {sight(number) for number in range(100)}
    draw = random.Random(2)
    refused = 0
    for _ in range(400):
        damaged = bytearray(whole)
        for _ in range(draw.choice([1, 4])):
            damaged[draw.randrange(len(whole))] ^= 1 << draw.randrange(8)
        path.write_bytes(damaged)
        try:
            payloads = {record.payload for record in read_log(path).records()}
        except UsageError:
            refused += 1
        else:
            assert payloads <= written
    assert refused > 100
