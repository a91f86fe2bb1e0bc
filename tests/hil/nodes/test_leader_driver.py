"""A real leader sets off when all are well, drives its program in whole steps, and stands at every end."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from formation.pose import Motion
from hil.nodes.leader_driver import SILENCE_S, DriverState, LeaderDriver
from hil.nodes.node import Outgoing, diagnostics
from hil.scenario.files import load_scenario
from hil.scenario.parts import leader_program
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import TICK, Event
from hil.wire.messages import decode_as, encode, header

BEGIN_NS = 1_700_000_000_000_000_000
SCENARIO = load_scenario("turtlebot3", ["run.duration_s=8.0"])
NODE = LeaderDriver(SCENARIO, frozenset({"estimator", "controller"}), 1.0)
STEP = 0.01


def report(name: str, problem: str = "") -> Event:
    return Event(topics.DIAGNOSTICS, encode(diagnostics(name, BEGIN_NS, problem, {})))


NOTHING = msg.Vector3(x=0.0, y=0.0, z=0.0)
COMMAND = Event(
    "follower/cmd_vel",
    encode(msg.TwistStamped(header=header(1, ""), twist=msg.Twist(linear=NOTHING, angular=NOTHING))),
)
STOP = Event(topics.STOP, encode(msg.String(data="enough")))
READY = [(0.0, COMMAND), (0.0, report("estimator")), (0.0, report("controller"))]
WELL = [(0.5 * k, report(name)) for k in range(1, 40) for name in ("estimator", "controller")]


def driven(
    events: Iterable[tuple[float, Event]], until_s: float, node: LeaderDriver = NODE
) -> tuple[DriverState, list[tuple[float, Motion]]]:
    """State at a time, and what the leader was told until then, by when [s]."""
    state, sent = node.begin(BEGIN_NS), list[tuple[float, Motion]]()

    def step(event: Event, now_ns: int) -> None:
        nonlocal state
        state, out = node.step(state, event, now_ns)
        sent.extend(((now_ns - BEGIN_NS) * 1e-9, each) for each in map(motion_of, out) if each is not None)

    end_ns = BEGIN_NS + round(until_s * 1e9)
    for at_s, event in sorted(events, key=lambda item: item[0]):
        at_ns = BEGIN_NS + round(at_s * 1e9)
        while node.due_ns(state) <= min(at_ns, end_ns):
            step(TICK, node.due_ns(state))
        if at_ns <= end_ns:
            step(event, at_ns)
    while node.due_ns(state) <= end_ns:
        step(TICK, node.due_ns(state))
    return state, sent


def motion_of(message: Outgoing) -> Motion | None:
    if message.topic != "leader/cmd_vel":
        return None
    twist = decode_as(message.payload, msg.TwistStamped).twist
    return Motion(twist.linear.x, twist.angular.z)


def problem(state: DriverState) -> str:
    return decode_as(NODE.report(state, BEGIN_NS).payload, msg.DiagnosticArray).status[0].message


@pytest.mark.parametrize("missing", range(3))
def test_it_stands_until_all_are_well(missing: int) -> None:
    state, sent = driven([*(each for k, each in enumerate(READY) if k != missing)], 5.0)
    assert state.since_ns is None
    assert {motion for _, motion in sent} == {Motion(0.0, 0.0)}
    assert len(sent) > 200
    assert problem(state).startswith("waiting for")


def test_a_robot_that_does_not_listen_holds_the_start_up_until_it_does() -> None:
    found = {"finding.deaf_robot": "nobody listens to /follower/cmd_vel, expected its robot to"}
    deaf = Event(topics.DIAGNOSTICS, encode(diagnostics("bridge/ros2", BEGIN_NS, "", found)))
    tells = [(0.5 * k, deaf) for k in range(8)]
    state, sent = driven([*READY, *WELL, *tells], 4.0)
    assert state.since_ns is None
    assert {motion for _, motion in sent} == {Motion(0.0, 0.0)}
    state, _ = driven([*READY, *WELL, *tells, (4.0, report("bridge/ros2"))], 6.0)
    assert state.since_ns == pytest.approx(BEGIN_NS + 5.0e9, abs=2e7)


def test_it_sets_off_after_the_countdown_and_drives_its_program_on_average() -> None:
    state, sent = driven([*READY, *WELL], 8.9)
    assert state.since_ns is not None
    since_s = (state.since_ns - BEGIN_NS) * 1e-9
    assert since_s == pytest.approx(1.0, abs=0.03)
    told = [(at - since_s, motion) for at, motion in sent if at >= since_s]
    assert all(motion == Motion(0.0, 0.0) for at, motion in sent if at < since_s)
    program = leader_program(SCENARIO)
    # What a link that truncates makes of it is whole steps, and their sum is never further off than one.
    for which in (0, 1):
        got = np.array([int(motion[which] / STEP) * STEP for _, motion in told])
        wanted = np.array([program(t)[which] for t, _ in told])
        assert np.allclose(got, [motion[which] for _, motion in told], atol=1e-6)
        assert np.max(np.abs(np.cumsum(got - wanted))) < STEP


def test_a_problem_during_the_countdown_begins_it_anew() -> None:
    ill = [(0.5, report("estimator", "waiting for mocap")), (2.0, report("estimator"))]
    state, _ = driven([*READY, *ill], 6.0)
    assert state.since_ns is not None
    assert (state.since_ns - BEGIN_NS) * 1e-9 == pytest.approx(3.0, abs=0.03)


def test_a_stop_ends_it_at_once_and_for_good() -> None:
    state, sent = driven([*READY, *WELL, (3.001, STOP)], 6.0)
    assert any(motion.v > 0.05 for at, motion in sent if at < 3.001)
    assert [at for at, _ in sent if at == pytest.approx(3.001, abs=1e-9)]
    assert {motion for at, motion in sent if at > 3.0005} == {Motion(0.0, 0.0)}
    assert state.over == "stopped: enough"


def test_a_leader_that_was_stopped_before_it_set_off_says_so() -> None:
    state, sent = driven([*READY, *WELL, (0.5, STOP)], 6.0)
    assert state.since_ns is None
    assert {motion for _, motion in sent} == {Motion(0.0, 0.0)}
    assert problem(state) == "stopped: enough"


def test_it_ends_with_the_run() -> None:
    state, sent = driven([*READY, *WELL], 12.0)
    assert state.over == "the program is over"
    assert {motion for at, motion in sent if at > 9.05} == {Motion(0.0, 0.0)}
    assert any(motion.v > 0.05 for at, motion in sent if 8.5 < at < 8.95)


def test_a_leader_does_not_drive_on_alone() -> None:
    heard = [(at, event) for at, event in WELL if at <= 2.5]
    state, sent = driven([*READY, *heard, *((at, report("estimator")) for at, _ in WELL)], 8.0)
    assert state.over == f"the controller has said nothing for {SILENCE_S:g} s"
    assert {motion for at, motion in sent if at > 2.5 + SILENCE_S + 0.05} == {Motion(0.0, 0.0)}


def test_a_program_beyond_the_robot_is_cut_to_its_limits() -> None:
    fast = load_scenario("turtlebot3", ["leader.program={kind='constant', v=0.5, u=-9.0}"])
    node = LeaderDriver(fast, frozenset({"estimator", "controller"}), 0.0)
    _, sent = driven([*READY, *WELL], 3.0, node)
    assert sent[-1][1] == pytest.approx(Motion(0.22, -2.84), abs=1e-5)


def test_it_speaks_to_robots_without_stamps() -> None:
    node = LeaderDriver(
        load_scenario("turtlebot3", ["controller.command_type=Twist", "leader.namespace=''"]), frozenset()
    )
    _, (command, *_) = node.step(node.begin(BEGIN_NS), TICK, BEGIN_NS)
    assert (command.topic, command.typename) == ("cmd_vel", "geometry_msgs/msg/Twist")


def test_garbage_is_counted_and_changes_nothing() -> None:
    state, _ = driven([(0.1, Event(topics.DIAGNOSTICS, b"\x01")), (0.2, Event("follower/cmd_vel", b""))], 0.3)
    assert state.refused == {"malformed": 2}


@pytest.mark.parametrize("payload", [b"", STOP.payload])
def test_any_stop_is_one(payload: bytes) -> None:
    state, _ = driven([(0.1, Event(topics.STOP, payload))], 0.2)
    assert state.over
