from __future__ import annotations

from collections.abc import Iterable
from typing import get_args

import pytest

from formation.pose import Pose
from hil.emulator.foreign_mocap import ForeignMocapNode
from hil.emulator.lab_messages import frame_message
from hil.nodes.findings import findings_in
from hil.nodes.node import Outgoing, outgoing
from hil.nodes.source import SourceNode, SourceState
from hil.scenario.files import load_scenario
from hil.scenario.lab import SourceType
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import TICK, Event
from hil.wire.messages import decode_as, encode, header
from hil.wire.pose_sources import message_of
from hil.wire.reading import read_frame
from hil.wire.records import Placement
from hil.wire.topics import RIGID_BODIES

NS, MS = 1_700_000_000_000_000_000, 1_000_000
NAMED = ["leader.body=1", "follower.body=2"]
PAIR = [("1", Pose(0.1, 0.25, 0.4)), ("2", Pose(0.3, -0.2, -2.5))]


def fed(node: SourceNode, state: SourceState, events: Iterable[tuple[Event, int]]) -> list[Outgoing]:
    return [said for event, now_ns in events for said in node.step(state, event, now_ns)[1]]


def poses(number: int, body: str, *, after_ns: int = 0, frame_id: str = "world") -> Event:
    place = Placement(float(number), 0.5, 0.0, 0.0, 0.0, 0.0, 1.0)
    told = message_of("PoseStamped", header(NS + number * 8 * MS + after_ns, frame_id), [(body, place)])
    return Event(f"source/vrpn_mocap/{body}/pose", encode(told))


def seen(frames: Iterable[Outgoing]) -> list[tuple[float, list[str]]]:
    read = [decode_as(each.payload, msg.RigidBodies) for each in frames if each.topic == RIGID_BODIES]
    return [
        (frame.rigidbodies[0].pose.position.x, [body.rigid_body_name for body in frame.rigidbodies])
        for frame in read
    ]


@pytest.mark.parametrize("kind", [*get_args(SourceType)])
@pytest.mark.parametrize("up", ["z", "y"])
@pytest.mark.parametrize("stamp", ["header", "receive"])
def test_a_frame_comes_through_any_source_as_it_was(kind: SourceType, up: str, stamp: str) -> None:
    changes = [f"source.type={kind}", f"source.up={up}", f"source.stamp={stamp}", "source.scale=0.01"]
    scenario = load_scenario("turtlebot3", [*NAMED, *changes])
    lab, node = ForeignMocapNode(scenario), SourceNode(scenario)
    _, told = lab.step(None, Event(RIGID_BODIES, encode(frame_message(NS, 7, PAIR))), NS + MS)
    state, now_ns = node.begin(NS), NS + 3 * MS
    assert {each.topic for each in told} == set(node.subscribes)
    made = fed(node, state, [(Event(each.topic, each.payload), now_ns) for each in told])
    assert [each.topic for each in made] == [RIGID_BODIES]
    frame = read_frame(made[0].payload, "1", "2")
    assert frame.capture_ns == (NS if stamp == "header" else now_ns)
    assert frame.leader == pytest.approx((0.1, 0.25))
    assert frame.follower == pytest.approx(Pose(0.3, -0.2, -2.5))
    assert (state.refused, state.taken["frame"]) == ({}, 1)


def test_transforms_of_several_bodies_may_share_a_topic() -> None:
    shared = ["source.type=TransformStamped", "source.topic=vicon"]
    scenario = load_scenario("turtlebot3", [*NAMED, *shared])
    lab, node = ForeignMocapNode(scenario), SourceNode(scenario)
    _, told = lab.step(None, Event(RIGID_BODIES, encode(frame_message(NS, 7, PAIR))), NS + MS)
    assert [each.topic for each in told] == ["source/vicon"] * 2
    events = [(Event(each.topic, each.payload), NS) for each in told]
    assert [names for _, names in seen(fed(node, node.begin(NS), events))] == [["1", "2"]]


SCENARIO = load_scenario("turtlebot3", [*NAMED, "source.type=PoseStamped"])


def test_poses_of_one_moment_are_a_frame_in_whatever_order_they_come() -> None:
    node = SourceNode(SCENARIO)
    state = node.begin(NS)
    came = [poses(1, "1"), poses(1, "2", after_ns=MS), poses(2, "2"), poses(2, "1"), poses(3, "1")]
    made = fed(node, state, [(event, NS) for event in came])
    assert seen(made) == [(1.0, ["1", "2"]), (2.0, ["2", "1"])]
    assert [each.stamp_ns for each in made] == [NS + 8 * MS, NS + 16 * MS]


def test_a_body_that_is_lost_leaves_incomplete_frames_that_are_counted_and_told() -> None:
    node = SourceNode(SCENARIO)
    state = node.begin(NS)
    made = fed(node, state, [(poses(number, "2"), NS) for number in range(1, 6)])
    assert seen(made) == [(float(number), ["2"]) for number in range(1, 5)]
    assert state.refused == {"incomplete": 4}
    report = decode_as(node.report(state, NS).payload, msg.DiagnosticArray).status[0]
    wanted = "waiting for bodies '1' on vrpn_mocap/1/pose, vrpn_mocap/2/pose (others seen: none)"
    assert (report.level, report.message) == (1, wanted)


def test_names_of_others_are_said_as_long_as_a_body_is_missed() -> None:
    scenario = load_scenario("turtlebot3", ["source.type=NamedPoseArray"])
    node = SourceNode(scenario)
    state = node.begin(NS)
    place = Placement(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    told = message_of("NamedPoseArray", header(0, "world"), [("burger_a", place), ("burger_b", place)])
    assert fed(node, state, [(Event("source/poses", encode(told)), NS)]) == []
    report = decode_as(node.report(state, NS).payload, msg.DiagnosticArray).status[0]
    assert "'follower', 'leader' on poses (others seen: 'burger_a', 'burger_b')" in report.message


def test_stamps_of_zero_are_taken_for_none() -> None:
    node = SourceNode(load_scenario("turtlebot3", [*NAMED, "source.type=NamedPoseArray"]))
    place = Placement(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    told = message_of("NamedPoseArray", header(0, "world"), [("1", place), ("2", place)])
    (frame,) = fed(node, node.begin(NS), [(Event("source/poses", encode(told)), NS + 5)])
    assert frame.stamp_ns == NS + 5


def test_bodies_in_two_frames_of_reference_make_no_frame_and_both_are_named() -> None:
    node = SourceNode(SCENARIO)
    state = node.begin(NS)
    apart = [poses(1, "1", frame_id="tb3_0/odom"), poses(1, "2", frame_id="tb3_1/odom")]
    assert fed(node, state, [(event, NS) for event in apart]) == []
    found = findings_in(decode_as(node.report(state, NS).payload, msg.DiagnosticArray))["source"]
    assert found["frames_of_reference"].count("tb3_") == 2
    assert len(fed(node, state, [(poses(2, "1"), NS), (poses(2, "2"), NS)])) == 1
    assert not findings_in(decode_as(node.report(state, NS).payload, msg.DiagnosticArray))["source"]


def test_what_cannot_be_read_is_counted_and_dropped() -> None:
    node = SourceNode(SCENARIO)
    state = node.begin(NS)
    topic = node.subscribes[0]
    assert fed(node, state, [(Event(topic, b"\x01"), NS), (Event("another", b""), NS)]) == []
    assert state.refused == {"malformed": 1}


def test_it_reports_twice_a_second() -> None:
    node = SourceNode(SCENARIO)
    state = node.begin(NS)
    said = fed(node, state, [(TICK, NS + k * 100 * MS) for k in range(20)])
    assert {each.topic for each in said} == {topics.DIAGNOSTICS}
    assert len(said) == 4


def test_what_is_no_frame_the_emulated_lab_does_not_tell() -> None:
    lab = ForeignMocapNode(SCENARIO)
    empty = outgoing(RIGID_BODIES, msg.RigidBodies(header(NS, "mocap"), 0, []), NS)
    for event in (Event(RIGID_BODIES, b"?"), Event("stop", b""), TICK):
        assert lab.step(None, event, NS) == (None, ())
    assert lab.due_ns(None) > NS
    assert lab.report(None, NS).topic == topics.DIAGNOSTICS
    assert lab.step(None, Event(RIGID_BODIES, empty.payload), NS) == (None, ())
    with_nobody = ForeignMocapNode(load_scenario("turtlebot3", ["source.type=TFMessage"]))
    (told,) = with_nobody.step(None, Event(RIGID_BODIES, empty.payload), NS)[1]
    assert told.stamp_ns == NS


@pytest.mark.parametrize("kind", ["RigidBodies", "NamedPoseArray"])
def test_a_message_that_has_a_body_twice_is_refused(kind: SourceType) -> None:
    scenario = load_scenario("turtlebot3", [*NAMED, f"source.type={kind}", "source.scale=0.01"])
    node, place = SourceNode(scenario), Placement(1.0, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0)
    state = node.begin(NS)
    told = message_of(kind, header(NS, "world"), [(body, place) for body in ("1", "2", "1")])
    (topic,) = node.subscribes
    assert fed(node, state, [(Event(topic, encode(told)), NS)]) == []
    assert state.refused == {"duplicate_body": 1}
