"""Bags as labs have them, each made by ``rosbags`` or the mcap package, are read as the one log they are."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from hil.errors import UsageError
from hil.log.opened import opened_log
from hil.log.writer import LogWriter
from hil.wire import message_types as msg
from hil.wire.messages import encode, header, typename_of
from hil.wire.pose_sources import PoseStamped, places_of, pose_of
from hil.wire.records import Placement

POSE, TEXT = typename_of(PoseStamped), typename_of(msg.String)
BEGIN_NS = 1_700_000_000_000_000_000

Message = tuple[str, str, bytes, int]
"""Topic, type, payload and log time [ns]."""


def posed(k: int) -> msg.Message:
    place = Placement(float(k), -1.0, 0.5, 0.0, 0.0, 0.6, 0.8)
    return PoseStamped(header(BEGIN_NS + k * 1_000_000, "world"), pose_of(place))


def messages(count: int = 20) -> list[Message]:
    """Poses every millisecond on one topic, and a text at every third on another."""
    made: list[Message] = []
    for k in range(count):
        at_ns = BEGIN_NS + k * 1_000_000 + 300
        made.append(("/a/pose", POSE, encode(posed(k)), at_ns))
        if k % 3 == 0:
            made.append(("/text", TEXT, encode(msg.String(data=str(k))), at_ns + 100))
    return made


def written(path: Path, some: list[Message]) -> Path:
    with LogWriter(path, {}) as log:
        for topic, typename, payload, at_ns in some:
            log.write(topic, typename, payload, at_ns, at_ns)
    return path


def bag(path: Path, some: list[Message], **options: Any) -> Path:
    """A bag's folder as ``rosbags`` writes it."""
    mode = options.pop("mode", None)
    writer = Ros2Writer(path, version=9, **options)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    store = get_typestore(Stores.ROS2_HUMBLE)
    with writer:
        connections = {
            (topic, typename): writer.add_connection(topic, typename, typestore=store)
            for topic, typename in dict.fromkeys(each[:2] for each in some)
        }
        for topic, typename, payload, at_ns in some:
            writer.write(connections[topic, typename], at_ns, payload)
    return path


def read(path: Path) -> list[Message]:
    return [(r.topic, r.typename, r.payload, r.log_ns) for r in opened_log(path).records()]


def split(path: Path, some: list[Message], parts: int) -> Path:
    """A folder of parts, with what a recorder writes beside them."""
    path.mkdir()
    size = -(-len(some) // parts)
    names = []
    for number in range(parts):
        names.append(f"{path.name}_{number}.mcap")
        written(path / names[-1], some[number * size : (number + 1) * size])
    listed = "".join(f"    - {name}\n" for name in names)
    (path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n"
        f"  relative_file_paths:\n{listed}"
    )
    return path


@pytest.mark.parametrize(
    "options",
    [
        {"storage_plugin": StoragePlugin.SQLITE3},
        {"storage_plugin": StoragePlugin.MCAP},
        {"storage_plugin": StoragePlugin.SQLITE3, "mode": CompressionMode.FILE},
        {"storage_plugin": StoragePlugin.MCAP, "mode": CompressionMode.FILE},
        {"storage_plugin": StoragePlugin.SQLITE3, "mode": CompressionMode.MESSAGE},
    ],
)
def test_a_bag_holds_what_was_written(tmp_path: Path, options: dict[str, Any]) -> None:
    some = messages()
    folder = bag(tmp_path / "bag", some, **options)

    log = opened_log(folder)
    assert read(folder) == some
    assert (log.messages, log.start_ns, log.end_ns) == (len(some), some[0][3], some[-1][3])
    assert dict(log.topics) == {"/a/pose": POSE, "/text": TEXT}
    assert [r.payload for r in log.records(["/text"])] == [m[2] for m in some if m[0] == "/text"]
    between = [m for m in some if some[4][3] <= m[3] < some[9][3]]
    assert [r.log_ns for r in log.records(None, some[4][3], some[9][3])] == [m[3] for m in between]
    assert log.decode(next(log.records(["/a/pose"]))) == posed(0)


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_a_file_of_a_bag_opens_by_itself(tmp_path: Path, plugin: StoragePlugin) -> None:
    some = messages()
    folder = bag(tmp_path / "bag", some, storage_plugin=plugin)
    (file,) = (each for each in folder.iterdir() if each.suffix != ".yaml")
    assert read(file) == some
    packed = tmp_path / (file.name + ".zstd")
    packed.write_bytes(zstandard.compress(file.read_bytes()))
    assert read(packed) == some


@settings(max_examples=15, deadline=None)
@given(count=st.integers(1, 40), parts=st.integers(1, 12))
def test_a_split_bag_is_one_log(tmp_path_factory: pytest.TempPathFactory, count: int, parts: int) -> None:
    some = messages(count)
    folder = split(tmp_path_factory.mktemp("split") / "run", some, parts)
    assert read(folder) == some
    (folder / "metadata.yaml").unlink()
    assert read(folder) == some, "a recorder that was killed leaves no metadata"


def test_parts_that_overlap_are_merged_by_log_time(tmp_path: Path) -> None:
    some = messages()
    folder = tmp_path / "run"
    folder.mkdir()
    written(folder / "a.mcap", some[::2])
    written(folder / "b.mcap", some[1::2])
    assert [m[3] for m in read(folder)] == [m[3] for m in some]


def test_a_log_of_ours_may_be_in_parts(tmp_path: Path) -> None:
    folder = split(tmp_path / "run", messages(), 3)
    (folder / "run_1.mcap").unlink()
    with LogWriter(folder / "run_1.mcap", {"abreast": {"version": "x"}}) as log:
        log.write("/text", TEXT, encode(msg.String(data="")), BEGIN_NS, BEGIN_NS)
    assert opened_log(folder).metadata == {"abreast": {"version": "x"}}


def test_a_bag_of_ros_1_is_read_in_ros_2s_messages(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(
        get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
    )
    types = store.types
    path = tmp_path / "old.bag"
    stamp = types["builtin_interfaces/msg/Time"](sec=1_700_000_000, nanosec=5)
    head = types["std_msgs/msg/Header"](seq=7, stamp=stamp, frame_id="world")
    place = Placement(1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8)
    quaternion = types["geometry_msgs/msg/Quaternion"](place.qx, place.qy, place.qz, place.qw)
    pose = types["geometry_msgs/msg/Pose"](
        types["geometry_msgs/msg/Point"](place.x, place.y, place.z), quaternion
    )
    transform = types["geometry_msgs/msg/TransformStamped"](
        head,
        "robot",
        types["geometry_msgs/msg/Transform"](
            types["geometry_msgs/msg/Vector3"](place.x, place.y, place.z), quaternion
        ),
    )
    sent = {
        "/pose": types["geometry_msgs/msg/PoseStamped"](head, pose),
        "/tf": types["tf2_msgs/msg/TFMessage"]([transform]),
    }
    with Ros1Writer(path) as writer:
        for topic, message in sent.items():
            kind = message.__msgtype__
            connection = writer.add_connection(topic, kind, typestore=store)
            writer.write(connection, BEGIN_NS, bytes(store.serialize_ros1(message, kind)))

    log = opened_log(path)
    found = {record.topic: log.decode(record) for record in log.records()}
    assert set(found) == set(sent)
    for message in found.values():
        ((body, stamp_ns, frame_id, there),) = places_of(message, "robot")
        assert (body, stamp_ns, frame_id, there) == ("robot", 1_700_000_000_000_000_005, "world", place)


def test_a_folder_without_a_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is a folder without a bag"):
        opened_log(tmp_path)


def test_a_part_that_is_gone_is_named(tmp_path: Path) -> None:
    folder = split(tmp_path / "run", messages(), 3)
    (folder / "run_1.mcap").unlink()
    with pytest.raises(UsageError, match=r"lacks run_1\.mcap, which its metadata\.yaml names"):
        opened_log(folder)


@pytest.mark.parametrize(
    ("name", "spoilt"),
    [
        ("x.db3", lambda data: b"SQLite format 3\0" + bytes(200)),
        ("x.bag", lambda data: b"#ROSBAG V2.0\n" + bytes(200)),
        ("x.mcap.zstd", lambda data: data[:40]),
    ],
)
def test_what_is_damaged_is_refused_in_one_line(
    tmp_path: Path, name: str, spoilt: Callable[[bytes], bytes]
) -> None:
    whole = zstandard.compress(written(tmp_path / "whole.mcap", messages()).read_bytes())
    path = tmp_path / name
    path.write_bytes(spoilt(whole))
    with pytest.raises(UsageError, match=name) as refused:
        read(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", ["x.db3", "x.bag", "x.mcap.zstd", "x.mcap", "x"])
def test_what_is_not_there_is_said(tmp_path: Path, name: str) -> None:
    with pytest.raises(UsageError, match="no such file"):
        opened_log(tmp_path / name)
