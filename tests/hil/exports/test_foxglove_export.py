from __future__ import annotations

import dataclasses
import itertools
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from foxglove import layouts
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from hil.exports.foxglove_export import export_foxglove
from hil.exports.foxglove_file import Made, write_foxglove
from hil.exports.layouts import LAYOUTS, write_layouts
from hil.judge.replayed import ReplayChoice
from hil.lockstep.run import run_lockstep
from hil.log.reader import Log, read_log
from hil.log.writer import LogWriter
from hil.nodes.node import Outgoing
from hil.scenario.files import load_scenario
from hil.scenario.links import links_of

RECORDED = ReplayChoice(in_messages=True)


@pytest.fixture(scope="module")
def folder(short_log: Log, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("viewers")
    export_foxglove(short_log, folder, RECORDED)
    return folder


def decoded(path: Path) -> Iterator[tuple[str, Any]]:
    """Messages by an independent decoder."""
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            yield channel.topic, message


def firsts(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for topic, message in decoded(path):
        found.setdefault(topic, message)
    return found


def field_of(topics: dict[str, Any], path: str, separator: str) -> Any:
    """Value that a viewer's path leads to; fails where there is none."""
    topic = max((each for each in topics if path.startswith(each + separator)), key=len, default=None)
    assert topic is not None, path
    value = topics[topic]
    for name in path.removeprefix(topic + separator).split(separator):
        value = getattr(value, name)
    return value


def test_all_that_was_logged_is_there_under_ros_names(folder: Path, short_log: Log) -> None:
    counts: dict[str, int] = {}
    for topic, _ in decoded(folder / "foxglove.mcap"):
        counts[topic] = counts.get(topic, 0) + 1
    assert counts.keys() == {f"/{topic}" for topic in short_log.topics} | {"/tf", "/scene"}
    for topic, count in short_log.counts.items():
        assert counts[f"/{topic}"] == count
    assert counts["/tf"] > 300
    assert counts["/scene"] > 100


def test_rosbags_reads_it_as_a_ros_2_bag(folder: Path) -> None:
    with AnyReader([folder / "foxglove.mcap"]) as reader:
        types = {each.topic: each.msgtype for each in reader.connections}
        assert types["/scene"] == "visualization_msgs/msg/MarkerArray"
        scenes = [each for each in reader.connections if each.topic in ("/scene", "/tf")]
        for connection, _, payload in reader.messages(connections=scenes):
            message: Any = reader.deserialize(payload, connection.msgtype)
        assert {each.child_frame_id for each in message.transforms} == {"leader", "follower"}


def foxglove_paths(node: Any) -> Iterator[str]:
    """Topics and message paths anywhere in a layout."""
    if isinstance(node, dict):
        for key, value in node.items():
            if key in ("value", "topicToRender", "xAxisPath") and isinstance(value, str):
                yield value
            elif key == "topics" and isinstance(value, dict):
                yield from value
            else:
                yield from foxglove_paths(value)
    elif isinstance(node, list):
        for each in node:
            yield from foxglove_paths(each)


def panels(node: Any) -> Iterator[str]:
    if isinstance(node, str):
        yield node
    else:
        yield from panels(node["first"])
        yield from panels(node["second"])


def test_every_path_of_the_foxglove_layout_leads_somewhere(folder: Path) -> None:
    layout = json.loads((folder / "foxglove.json").read_text())
    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])
    topics, paths = firsts(folder / "foxglove.mcap"), list(foxglove_paths(layout["configById"]))
    assert len(paths) > 12
    for path in paths:
        if path not in topics:
            assert isinstance(field_of(topics, path, "."), float | int | str | bool)
    assert layout["configById"]["3D!scene"]["followTf"] == "follower"


def test_the_foxglove_layout_has_no_setting_that_foxglove_does_not_know(folder: Path) -> None:
    """By the panels' settings in Foxglove's own SDK."""
    known: dict[str, Any] = {
        "Plot": layouts.PlotConfig(),
        "StateTransitions": layouts.StateTransitionsConfig(),
        "DiagnosticSummary": layouts.DiagnosticsSummaryConfig(),
        "3D": layouts.ThreeDeeConfig(),
    }
    series = {"Plot": layouts.PlotSeries(), "StateTransitions": layouts.StateTransitionsSeries()}
    layout = json.loads((folder / "foxglove.json").read_text())
    for name, config in layout["configById"].items():
        kind = name.partition("!")[0]
        assert config.keys() - {"title"} <= known[kind]._to_dict().keys()
        for path in config.get("paths", ()):
            assert path.keys() <= series[kind]._to_dict().keys()
    camera = layout["configById"]["3D!scene"]["cameraState"]
    assert camera.keys() <= layouts.ThreeDeeCameraState()._to_dict().keys()


def plotjuggler_curves(text: str) -> tuple[set[str], set[str]]:
    """Curves of the log and those that are calculated from them."""
    root = ElementTree.fromstring(text)
    made = {each.attrib["name"] for each in root.iter("snippet")}
    used = {each.text or "" for each in root.iter() if each.tag in ("linked_source", "v1")}
    for curve in root.iter("curve"):
        used |= {curve.get("curve_x", curve.attrib["name"]), curve.get("curve_y", curve.attrib["name"])}
    return used, made


def test_every_curve_of_the_plotjuggler_layout_leads_somewhere(folder: Path) -> None:
    used, made = plotjuggler_curves((folder / "plotjuggler.xml").read_text())
    topics = firsts(folder / "foxglove.mcap")
    assert made <= used
    assert len(used) > 15
    for curve in used - made:
        assert isinstance(field_of(topics, curve, "/"), float | int | bool)


def test_layouts_follow_the_topics_of_a_chain(tmp_path: Path) -> None:
    run_lockstep(load_scenario("chain5-turtlebot3", ["run.duration_s=1.0"]), tmp_path / "run.mcap")
    log = read_log(tmp_path / "run.mcap")
    export_foxglove(log, tmp_path, dataclasses.replace(RECORDED, follower="agent4"))
    topics = firsts(tmp_path / "foxglove.mcap")
    paths = set(foxglove_paths(json.loads((tmp_path / "foxglove.json").read_text())["configById"]))
    used, made = plotjuggler_curves((tmp_path / "plotjuggler.xml").read_text())
    assert {path for path in paths if path.startswith("/agent4/")}
    for path in paths - topics.keys():
        field_of(topics, path, ".")
    for curve in used - made:
        field_of(topics, curve, "/")
    names = {each.child_frame_id for each in topics["/tf"].transforms}
    assert names == {"leader", "follower", "agent3", "agent4", "agent5"}


def test_shipped_layouts_are_written_as_they_are(tmp_path: Path) -> None:
    written = write_layouts(tmp_path / "new")
    assert [path.name for path in written] == list(LAYOUTS)
    data = Path(__file__).parents[3] / "data/layouts"
    assert all(path.read_bytes() == (data / path.name).read_bytes() for path in written)
    (link,) = links_of(load_scenario("turtlebot3", ['follower.namespace="lab/tb3_2"']))
    text = write_layouts(tmp_path, link)[0].read_text()
    assert "/lab/tb3_2/leader_estimate.v1" in text
    assert not re.search(r'"/follower/', text)


def test_a_foreign_log_gets_its_estimates_and_its_scene(short_log: Log, tmp_path: Path) -> None:
    with LogWriter(tmp_path / "bag.mcap", {}) as writer:
        for record in short_log.records(["rigid_bodies", "follower/odom"]):
            topic = record.topic.replace("rigid_bodies", "mocap/all")
            writer.write(topic, record.typename, record.payload, record.log_ns, record.publish_ns)
    (tmp_path / "map.toml").write_text('[topics]\nrigid_bodies = "mocap/all"\nodometry = "follower/odom"\n')
    choice = dataclasses.replace(RECORDED, chart=str(tmp_path / "map.toml"))
    done = export_foxglove(read_log(tmp_path / "bag.mcap"), tmp_path / "out", choice)
    assert done.messages["/follower/leader_estimate"] > 300
    scenes = [message for topic, message in decoded(tmp_path / "out/foxglove.mcap") if topic == "/scene"]
    assert any("tracking" in marker.text for marker in scenes[len(scenes) // 2].markers)


def test_estimates_made_anew_take_the_place_of_those_of_the_log(
    short_log: Log, folder: Path, tmp_path: Path
) -> None:
    export_foxglove(short_log, tmp_path, dataclasses.replace(RECORDED, estimator="difference"))
    topic = "/follower/leader_estimate"
    before, anew = (
        [message.v1 for name, message in decoded(each / "foxglove.mcap") if name == topic]
        for each in (folder, tmp_path)
    )
    assert len(before) == len(anew)
    assert before != anew


def test_what_was_made_after_the_logs_last_message_is_there_too(short_log: Log, tmp_path: Path) -> None:
    scenario, topic = load_scenario("turtlebot3"), "follower/leader_estimate"
    (first,) = itertools.islice(short_log.records([topic]), 1)
    after_ns = (short_log.end_ns or 0) + 1_000_000
    late = [Outgoing(topic, first.typename, first.payload, after_ns + number) for number in range(3)]
    done = write_foxglove(short_log, scenario, tmp_path / "seen.mcap", Made(late, frozenset({topic})))
    assert done.messages[f"/{topic}"] == len(late)
    assert sum(name == f"/{topic}" for name, _ in decoded(tmp_path / "seen.mcap")) == len(late)
