from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pandas as pd
import polars as pl
import pytest
from mcap.writer import Writer

from hil.exports.table_file import Format
from hil.exports.topic_tables import comments_of, topic_paths, write_topics
from hil.log.reader import Log, read_log
from hil.log.writer import LogWriter
from hil.log.written_aside import write_text_aside
from hil.wire.message_types import Message, Odometry, RigidBodies
from hil.wire.messages import definition, encode, typename_of

LONG = "\u8def" * 400
FORMS: tuple[Format, ...] = ("csv", "parquet")


@pytest.fixture(scope="module")
def every_kind(sample_messages: dict[str, Message], tmp_path_factory: pytest.TempPathFactory) -> Log:
    path = tmp_path_factory.mktemp("kinds") / "run.mcap"
    with LogWriter(path, {}) as writer:
        for number in range(3):
            for topic, message in sample_messages.items():
                writer.write(topic, typename_of(message), encode(message), 10 + number, 5 + number)
        writer.write("truth", typename_of(sample_messages["truth"]), b"\0\1\0\0torn", 20, 20)
    return read_log(path)


def test_every_topic_has_a_table_that_pandas_and_polars_read(every_kind: Log, tmp_path: Path) -> None:
    done = write_topics(every_kind, tmp_path, "parquet")
    assert done.rows == {f"{topic}.parquet": 3 for topic in every_kind.topics}
    assert done.malformed == {"truth": 1}
    odometry = pd.read_parquet(tmp_path / "leader/odom.parquet")
    (first,) = every_kind.records(["leader/odom"], end_ns=11)
    message = every_kind.decode(first)
    assert isinstance(message, Odometry)
    assert odometry["twist.twist.angular.z"][0] == message.twist.twist.angular.z
    assert odometry["log_time.ns"].tolist() == [10, 11, 12]
    assert odometry["publish_time.ns"].tolist() == [5, 6, 7]
    assert odometry["header.stamp.ns"][0] * 1e-9 == odometry["header.stamp.s"][0]
    bodies = pl.read_parquet(tmp_path / "rigid_bodies.parquet")
    assert bodies["rigidbodies.rigid_body_name"].to_list()[0] == ["leader", "follower"]
    assert bodies["rigidbodies.markers.translation.z"].to_list()[0] == [[3.0, 3.0], []]
    long = bodies.explode("rigidbodies.rigid_body_name", "rigidbodies.pose.position.x")
    assert long.height == 6


def test_lists_are_json_in_csv_and_what_is_unknown_is_empty(every_kind: Log, tmp_path: Path) -> None:
    write_topics(every_kind, tmp_path, "csv")
    bodies = pd.read_csv(tmp_path / "rigid_bodies.csv")
    message = every_kind.decode(next(every_kind.records(["rigid_bodies"])))
    assert isinstance(message, RigidBodies)
    assert json.loads(bodies["rigidbodies.pose.position.x"][0]) == [0.1, 0.1]
    command = (tmp_path / "follower/command.csv").read_text().splitlines()
    assert dict(zip(command[0].split(","), command[1].split(","), strict=False))["v2_wanted"] == ""


def test_types_of_others_are_read_by_the_logs_own_definition(tmp_path: Path) -> None:
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as stream:
        writer: Any = Writer(stream)
        writer.start(profile="ros2")
        text = b"int16 level  # [%] of the battery\nstring[] names\n"
        schema = writer.register_schema("lab_msgs/msg/State", "ros2msg", text)
        unknown = writer.register_schema("lab_msgs/msg/Secret", "ros2msg", b"")
        told = writer.register_channel("/state", "cdr", schema)
        other = writer.register_channel("/secret", "cdr", unknown)
        worded = writer.register_channel("/words", "json", unknown)
        payload = b"\0\1\0\0\x2a\0\0\0\x02\0\0\0\x02\0\0\0a\0\0\0\x02\0\0\0b\0"
        for channel in (told, other, worded):
            writer.add_message(channel, 1, payload, 1)
        writer.finish()
    done = write_topics(read_log(path), tmp_path / "out", "parquet")
    assert done.rows == {"state.parquet": 1}
    assert done.left_out.keys() == {"/secret", "/words"}
    table = pl.read_parquet(tmp_path / "out/state.parquet")
    assert table.select("level", "names").rows() == [(42, ["a", "b"])]


def test_no_topic_leads_out_of_the_folder() -> None:
    topics = dict.fromkeys(["../../etc/x", "/", "/a", "a", "..", "a\\b", "a/../b", "x" * 300], "")
    paths = topic_paths(topics, "csv")
    assert len(set(paths.values())) == len(topics)
    for path in paths.values():
        assert not Path(path).is_absolute()
        assert not {"..", "."} & set(Path(path).parts)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "topics",
    [
        ["a", "a.FORM/b", "a.FORM/c", "a.FORM"],
        ["a.FORM/b", "a", "a-2"],
        ["a.FORM/b/c", "a.FORM/b", "a", "a-2.FORM/x"],
        [LONG, LONG + "x", LONG + "/x", "x" * 178 + LONG, "x" * 179 + LONG, "\ud800", "." * 300],
    ],
    ids=["a file first", "a folder first", "deep", "long"],
)
def test_every_topic_gets_a_file_that_can_be_made(tmp_path: Path, topics: list[str], form: Format) -> None:
    """By making them all."""
    paths = topic_paths(dict.fromkeys([each.replace("FORM", form) for each in topics], ""), form)
    for path in paths.values():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        write_text_aside(tmp_path / path, "")
        for part in Path(path).parts:
            assert len(part.encode()) <= 200
            assert not re.search("%(?![0-9A-F]{2})", part)
    assert len({*paths.values()}) == len(topics)


def test_comments_are_found_beside_their_fields() -> None:
    comments = comments_of("abreast_msgs/msg/Truth", definition("abreast_msgs/msg/Truth"))
    assert comments["abreast_msgs/msg/Truth", "v1"] == "[m/s] leader's speed that way, never negative"
    nested = comments_of("abreast_msgs/msg/Command", definition("abreast_msgs/msg/Command"))
    assert nested["abreast_msgs/msg/Consumed", "digest"] == "of the payload's bytes"
