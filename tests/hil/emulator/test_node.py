from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.emulator.node import EmulatorNode, EmulatorState
from hil.lockstep.lockstep import EPOCH_NS
from hil.nodes.node import Outgoing, diagnostics
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import TICK, Event
from hil.wire.messages import decode_as, encode, header, to_ns

MS = 1_000_000
SCENARIO = load_scenario("turtlebot3", ["mocap.jitter_s=0.01"])
NODE = EmulatorNode(SCENARIO)


def command(v: float, u: float) -> Event:
    twist = msg.Twist(linear=msg.Vector3(x=v, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=u))
    return Event(NODE.topics.cmd_vel, encode(msg.TwistStamped(header=header(EPOCH_NS, ""), twist=twist)))


def report(name: str, problem: str = "") -> Event:
    return Event(topics.DIAGNOSTICS, encode(diagnostics(name, EPOCH_NS, problem, {})))


STOP = Event(topics.STOP, encode(msg.String(data="enough")))
READY = [report("estimator"), report("controller"), command(0.0, 0.0)]


def told(
    events: Iterable[tuple[float, Event]], node: EmulatorNode = NODE, state: EmulatorState | None = None
) -> tuple[EmulatorState, list[Outgoing]]:
    """Let things happen at times in ms after the begin; ticks whenever the node wants them."""
    state = node.begin(EPOCH_NS) if state is None else state
    sent: list[Outgoing] = []
    for at_ms, event in events:
        now_ns = EPOCH_NS + round(at_ms * MS)
        while node.due_ns(state) < now_ns:
            state, out = node.step(state, TICK, node.due_ns(state))
            sent.extend(out)
        state, out = node.step(state, event, now_ns)
        sent.extend(out)
    return state, sent


def frames(sent: list[Outgoing]) -> list[msg.RigidBodies]:
    return [decode_as(m.payload, msg.RigidBodies) for m in sent if m.topic == topics.RIGID_BODIES]


def truths(sent: list[Outgoing]) -> list[msg.Truth]:
    return [decode_as(m.payload, msg.Truth) for m in sent if m.topic == topics.TRUTH]


@pytest.mark.parametrize("missing", range(len(READY)))
def test_nothing_moves_until_all_are_well_and_a_command_has_come(missing: int) -> None:
    present = [(10, event) for place, event in enumerate(READY) if place != missing]
    state, sent = told([*present, (2000, TICK)])
    assert state.motion_since_ns is None
    assert {(truth.v1, truth.u1) for truth in truths(sent)} == {(0.0, 0.0)}
    state, sent = told([(2000, READY[missing]), (3000, TICK)], state=state)
    assert state.motion_since_ns is not None
    assert 0 <= state.motion_since_ns - EPOCH_NS - 2000 * MS <= 1e9 / 120.0
    assert truths(sent)[-1].v1 == pytest.approx(0.08, abs=1e-3)


def test_a_daemon_that_reports_a_problem_does_not_open_the_barrier() -> None:
    ill = report("estimator", "waiting for mocap")
    state, _ = told([(10, ill), (10, READY[1]), (10, READY[2]), (1000, TICK)])
    assert state.motion_since_ns is None
    assert "waiting for estimator" in problem_of(NODE.report(state, EPOCH_NS))


def test_a_run_with_a_recorder_waits_for_it_too() -> None:
    node = EmulatorNode(SCENARIO, frozenset({"estimator", "controller", "recorder"}))
    state, _ = told([(10, event) for event in READY] + [(500, TICK)], node)
    assert state.motion_since_ns is None
    assert problem_of(node.report(state, EPOCH_NS)) == "waiting for recorder"
    state, _ = told([(500, report("recorder")), (600, TICK)], node, state)
    assert state.motion_since_ns is not None
    assert problem_of(node.report(state, EPOCH_NS)) == "ok"


def problem_of(message: Outgoing) -> str:
    return str(decode_as(message.payload, msg.DiagnosticArray).status[0].message)


def test_a_stop_stops_both_and_for_good() -> None:
    moving = [(10, event) for event in READY] + [(20, command(0.2, 1.0)), (1000, TICK)]
    state, sent = told(moving)
    assert truths(sent)[-1].v2 == pytest.approx(0.2, abs=1e-3)
    state, sent = told([(1000, STOP), (1500, command(0.2, 1.0)), (3000, TICK)], state=state)
    last = truths(sent)[-1]
    assert (last.v1, last.u1, last.v2, last.u2) == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-6)
    assert state.plant.stopped


def test_any_bytes_on_the_stop_topic_stop() -> None:
    state, _ = told([(10, event) for event in READY] + [(500, Event(topics.STOP, b"\x01\x02"))])
    assert state.plant.stopped


@given(st.lists(st.integers(0, 400_000), max_size=60))
@settings(deadline=None, max_examples=25)
def test_it_does_not_matter_how_often_it_is_called(extra_us: list[int]) -> None:
    happenings = [(10.0, event) for event in READY] + [
        (97.3, command(0.15, -0.8)),
        (250.1, command(0.1, 0.5)),
    ]
    _, plain = told([*happenings, (400.0, TICK)])
    ticks = [(at_us * 1e-3, TICK) for at_us in extra_us]
    bystanders = [(at_ms, report("recorder")) for at_ms, _ in ticks[::3]]
    crowded = sorted([*happenings, *ticks, *bystanders], key=lambda item: item[0])
    _, split = told([*crowded, (400.0, TICK)])
    assert split == plain


def test_frames_leave_after_their_latency_and_carry_their_capture_time() -> None:
    node = EmulatorNode(load_scenario("turtlebot3", ["mocap.latency_s=0.03", "mocap.jitter_s=0"]))
    state = node.begin(EPOCH_NS)
    left: list[tuple[int, int]] = []
    while node.due_ns(state) < EPOCH_NS + 500 * MS:
        now_ns = node.due_ns(state)
        state, out = node.step(state, TICK, now_ns)
        left.extend((now_ns, to_ns(frame.header.stamp)) for frame in frames(list(out)))
    assert len(left) == 57  # captures at 0, 8.33, ... up to 470 ms
    assert {now_ns - stamp_ns for now_ns, stamp_ns in left} == {30 * MS}
    spacing = [b - a for (_, a), (_, b) in pairwise(left)]
    assert all(abs(step - 1e9 / 120.0) <= 1 for step in spacing)


def test_lost_frames_are_counted_and_their_truth_is_not_lost() -> None:
    node = EmulatorNode(load_scenario("turtlebot3", ["mocap.loss=0.3", "mocap.latency_s=0"]))
    state, sent = told([(2000, TICK)], node)
    world = state.plant.world()
    assert len(truths(sent)) == world.frames
    assert len(frames(sent)) == world.frames - world.lost
    assert 0.2 < world.lost / world.frames < 0.4


def test_odometry_tells_what_the_wheels_do_and_nothing_while_they_stand() -> None:
    _, sent = told([(10, event) for event in READY] + [(20, command(0.2, 1.0)), (3000, TICK)])
    samples = [decode_as(m.payload, msg.Odometry) for m in sent if m.topic == NODE.topics.odom]
    assert len(samples) == 91
    speeds = [sample.twist.twist.linear.x for sample in samples]
    assert speeds[0] == 0.0
    settled = speeds[45:]
    assert sum(settled) / len(settled) == pytest.approx(0.2, abs=0.001)
    assert math.dist(settled, [0.2] * len(settled)) / math.sqrt(len(settled)) == pytest.approx(0.002, rel=0.4)


@pytest.mark.parametrize("topic", NODE.subscribes)
@given(payload=st.binary(max_size=200))
@settings(deadline=None, max_examples=40)
def test_garbage_is_counted_and_moves_nothing(topic: str, payload: bytes) -> None:
    before, _ = told([(10, READY[0])])
    goal = before.robots[1].goal
    after, _ = told([(20, Event(topic, payload))], state=before)
    assert after.robots[1].goal == goal
    if topic != topics.STOP:
        assert not after.plant.stopped


def test_garbage_on_the_command_topic_is_counted() -> None:
    state, _ = told([(10, Event(NODE.topics.cmd_vel, b"\x01\x02\x03"))] * 3)
    assert state.refused == {"malformed": 3}
    assert not state.present.commanded


def test_a_command_that_is_not_finite_stops_the_follower() -> None:
    state, _ = told([(10, command(0.2, 0.5)), (20, command(math.nan, 0.5))])
    assert (state.robots[1].goal.v, state.robots[1].goal.u) == (0.0, 0.0)


def test_twist_without_a_stamp_drives_too() -> None:
    node = EmulatorNode(load_scenario("turtlebot3", ["controller.command_type=Twist"]))
    twist = msg.Twist(linear=msg.Vector3(x=0.1, y=0.0, z=0.0), angular=msg.Vector3(x=0.0, y=0.0, z=0.3))
    state, _ = told([(10, Event(node.topics.cmd_vel, encode(twist)))], node)
    assert (state.robots[1].goal.v, state.robots[1].goal.u) == pytest.approx((0.1, 0.3))
