"""One emulated robot beside a real one: the lab's frames show it where it was when they were taken."""

from __future__ import annotations

import math

import pytest

from formation.pose import Motion, Pose, advance
from hil.emulator.beside_real import LAB_FRAMES, BesideReal, BesideState
from hil.emulator.lab_messages import frame_message
from hil.nodes.node import Outgoing, diagnostics
from hil.nodes.source import SourceNode
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import drive_message
from hil.wire.events import TICK, Event
from hil.wire.key_layout import layout_of
from hil.wire.messages import decode_as, encode, to_ns

BEGIN_NS = 1_700_000_000_000_000_000
MS = 1_000_000
QUIET = ["mocap.sigma_position=0.0", "mocap.sigma_heading=0.0"]
NEEDS = frozenset({"estimator", "controller"})


def node_of(robot: str, *overrides: str) -> BesideReal:
    return BesideReal(load_scenario("turtlebot3", [f"source.emulated={robot}", *QUIET, *overrides]), NEEDS)


def command(v: float, u: float) -> Event:
    return Event("follower/cmd_vel", encode(drive_message(Motion(v, u), BEGIN_NS, "follower", stamped=True)))


def lab_frame(at_ns: int, body: str, number: int = 7) -> Event:
    return Event(LAB_FRAMES, encode(frame_message(at_ns, number, [(body, Pose(0.5, -0.5, 1.0))])))


def run(
    node: BesideReal, until_ms: int, *events: tuple[int, Event], state: BesideState | None = None
) -> tuple[BesideState, list[Outgoing]]:
    state, sent = state or node.begin(BEGIN_NS), list[Outgoing]()
    for at_ms, event in [*events, (until_ms, TICK)]:
        now_ns = BEGIN_NS + at_ms * MS
        while node.due_ns(state) < now_ns:
            state, out = node.step(state, TICK, node.due_ns(state))
            sent.extend(out)
        state, out = node.step(state, event, now_ns)
        sent.extend(out)
    return state, sent


def test_a_frame_of_the_lab_is_completed_with_the_pose_of_its_capture() -> None:
    node = node_of("follower")
    state, _ = run(node, 2000, (10, command(0.1, 0.4)))
    at_ns = BEGIN_NS + 2003 * MS
    state, out = run(node, 2003 + 23, (2003 + 23, lab_frame(at_ns, "leader")), state=state)
    (message,) = [each for each in out if each.topic == topics.RIGID_BODIES]
    frame = decode_as(message.payload, msg.RigidBodies)
    assert (to_ns(frame.header.stamp), frame.frame_number) == (at_ns, 7)
    real, emulated = frame.rigidbodies
    assert (real.rigid_body_name, real.pose.position.x) == ("leader", 0.5)
    assert emulated.rigid_body_name == "follower"
    # By now it has driven steadily for long: where it was is where it is, driven back.
    robot = state.lab.robots[1]
    now = Pose(robot.at.x, robot.at.y, robot.heading)
    world_ns = state.lab.plant.world().time_ns
    then = advance(now, robot.motion.v, robot.motion.u, -(world_ns - at_ns) * 1e-9)
    assert (emulated.pose.position.x, emulated.pose.position.y) == pytest.approx((then.x, then.y), abs=2e-5)
    theta = 2.0 * math.atan2(emulated.pose.orientation.z, emulated.pose.orientation.w)
    assert math.cos(theta - then.theta) == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize(
    ("robot", "spoken"), [("leader", {"leader/odom", "leader/cmd_vel"}), ("follower", {"follower/odom"})]
)
def test_it_speaks_for_its_own_robot_alone(robot: str, spoken: set[str]) -> None:
    _, sent = run(node_of(robot), 1000, (10, command(0.1, 0.0)))
    assert {each.topic for each in sent} == spoken | {topics.DIAGNOSTICS}


def test_an_emulated_leader_sets_off_as_ever_and_an_emulated_follower_waits_for_nobody() -> None:
    ready = [
        (10, Event(topics.DIAGNOSTICS, encode(diagnostics(name, BEGIN_NS, "", {})))) for name in sorted(NEEDS)
    ]
    state, _ = run(node_of("leader"), 500, *ready, (20, command(0.0, 0.0)))
    assert state.lab.motion_since_ns is not None
    node = node_of("follower")
    state, _ = run(node, 500, *ready, (20, command(0.1, 0.0)))
    assert state.lab.motion_since_ns is None
    assert decode_as(node.report(state, BEGIN_NS).payload, msg.DiagnosticArray).status[0].level == 0
    assert state.lab.robots[1].motion.v > 0.05


def test_a_body_of_the_lab_under_the_emulated_name_is_not_the_emulated_robot() -> None:
    node = node_of("leader")
    frame = frame_message(
        BEGIN_NS + 90 * MS, 1, [("leader", Pose(9.0, 9.0, 0.0)), ("follower", Pose(1, 1, 0))]
    )
    _, sent = run(node, 100, (100, Event(LAB_FRAMES, encode(frame))))
    (message,) = [each for each in sent if each.topic == topics.RIGID_BODIES]
    places = {
        b.rigid_body_name: b.pose.position.x for b in decode_as(message.payload, msg.RigidBodies).rigidbodies
    }
    assert places == {"leader": pytest.approx(0.287), "follower": 1.0}


def test_garbage_is_counted() -> None:
    state, sent = run(node_of("follower"), 100, (100, Event(LAB_FRAMES, b"\x01")))
    assert state.refused == {"malformed": 1}
    assert not [each for each in sent if each.topic == topics.RIGID_BODIES]


def test_the_source_waits_for_the_real_body_alone_and_the_keys_part_the_frames() -> None:
    scenario = load_scenario("turtlebot3", ["source.emulated=leader", "source.up=y"])
    source = SourceNode(scenario, LAB_FRAMES)
    state = source.begin(BEGIN_NS)
    bodies = [("follower", Pose(0.5, 0.0, 0.0))]
    frame = Event(source.subscribes[0], encode(frame_message(BEGIN_NS, 3, bodies)))
    state, (made,) = source.step(state, frame, BEGIN_NS)
    assert made.topic == LAB_FRAMES
    report = decode_as(source.report(state, BEGIN_NS).payload, msg.DiagnosticArray).status[0]
    assert report.level == 0
    layout = layout_of(scenario)
    assert layout.key(source.subscribes[0]) == "rigid_bodies"
    assert layout.key(topics.RIGID_BODIES) == "abreast/rigid_bodies"
