"""When a leader that a hand drives sets off, by what the motion capture shows."""

from __future__ import annotations

import math

import pytest

from formation.pose import Pose
from hil.emulator.lab_messages import frame_message
from hil.nodes.leader_watch import FRAMES_OFF, SET_OFF_M, LeaderWatch, WatchState
from hil.nodes.node import Outgoing
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import TICK, Event
from hil.wire.messages import decode_as, encode
from tests.hil.nodes.test_leader_driver import BEGIN_NS, READY, STOP

FRAME_NS = 8_333_333
SCENARIO = load_scenario("turtlebot3", ["leader.body=7"])
NODE = LeaderWatch(SCENARIO, frozenset({"estimator", "controller"}))


def ready() -> WatchState:
    state = NODE.begin(BEGIN_NS)
    for _, event in READY:
        state, _ = NODE.step(state, event, BEGIN_NS)
    return state


def frame(k: int, x: float, body: str = "7", late_ns: int = 0) -> Event:
    bodies = [(body, Pose(x, 0.0, 0.0)), ("follower", Pose(1.0, 0.0, 0.0))]
    return Event(topics.RIGID_BODIES, encode(frame_message(BEGIN_NS + k * FRAME_NS - late_ns, k, bodies)))


def shown(state: WatchState, *xs: float, late_ns: int = 0) -> tuple[WatchState, list[Outgoing]]:
    sent: list[Outgoing] = []
    for k, x in enumerate(xs):
        state, out = NODE.step(state, frame(k, x, late_ns=late_ns), BEGIN_NS + k * FRAME_NS)
        sent.extend(out)
    return state, sent


def test_it_sets_off_at_the_first_frame_that_shows_it_elsewhere() -> None:
    far = SET_OFF_M + 0.001
    state, sent = shown(ready(), 0.0, 0.002, -0.002, far, far, far, late_ns=5_000_000)
    assert state.since_ns == BEGIN_NS + 3 * FRAME_NS - 5_000_000
    (report,) = sent
    values = {
        each.key: each.value for each in decode_as(report.payload, msg.DiagnosticArray).status[0].values
    }
    assert values["motion_since_ns"] == str(state.since_ns)


def test_two_frames_that_show_another_body_are_not_a_start() -> None:
    state, _ = shown(ready(), 0.0, *([0.5] * (FRAMES_OFF - 1)), 0.0, *([0.5] * (FRAMES_OFF - 1)), 0.0)
    assert state.since_ns is None


def test_what_moves_before_all_are_well_is_being_put_in_its_place() -> None:
    state, _ = shown(NODE.begin(BEGIN_NS), 0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
    assert state.since_ns is None
    assert "waiting for" in problem(state)
    for _, event in READY:
        state, _ = NODE.step(state, event, BEGIN_NS)
    assert "drive '7' off by hand" in problem(state)
    state, _ = shown(state, 0.5, 0.5, 0.5, 0.5)
    assert state.since_ns is None
    state, _ = shown(state, 0.6, 0.7, 0.8)
    assert state.since_ns is not None
    assert problem(state) == "ok"


def problem(state: WatchState) -> str:
    return decode_as(NODE.report(state, BEGIN_NS).payload, msg.DiagnosticArray).status[0].message


def test_a_clock_that_is_far_off_does_not_date_the_start() -> None:
    state, _ = shown(ready(), 0.0, 0.1, 0.1, 0.1, late_ns=300_000_000_000)
    assert state.since_ns == BEGIN_NS + FRAME_NS


def test_other_bodies_and_garbage_start_nobody() -> None:
    state = ready()
    for k in range(20):
        state, _ = NODE.step(state, frame(k, 0.1 * k, "8"), BEGIN_NS + k * FRAME_NS)
        state, _ = NODE.step(state, frame(k, math.nan), BEGIN_NS + k * FRAME_NS)
        state, _ = NODE.step(state, Event(topics.RIGID_BODIES, b"\x01"), BEGIN_NS + k * FRAME_NS)
    assert state.since_ns is None
    assert state.refused == {"malformed": 20}


@pytest.mark.parametrize("payload", [STOP.payload, b""])
def test_after_a_stop_nobody_sets_off(payload: bytes) -> None:
    assert topics.STOP in NODE.subscribes
    state, _ = NODE.step(ready(), Event(topics.STOP, payload), BEGIN_NS)
    state, _ = NODE.step(state, Event(topics.STOP, encode(msg.String(data="later"))), BEGIN_NS)
    state, _ = shown(state, 0.0, 0.1, 0.2, 0.3, 0.4)
    assert state.since_ns is None
    assert problem(state) == ("stopped: enough" if payload else "stopped: for a reason that cannot be read")


def test_it_drives_nobody() -> None:
    _, sent = NODE.step(ready(), TICK, BEGIN_NS)
    assert [each.topic for each in sent] == [topics.DIAGNOSTICS]


@pytest.mark.parametrize("sigma", [0.0003, 0.005])
def test_noise_is_no_motion(sigma: float) -> None:
    node = LeaderWatch(
        load_scenario("turtlebot3", ["leader.body=7", f"estimator.sigma_position={sigma}"]),
        frozenset({"estimator", "controller"}),
    )
    state = ready()
    for k in range(100):
        state, _ = node.step(state, frame(k, 2.9 * sigma * (-1) ** k), BEGIN_NS + k * FRAME_NS)
    assert state.since_ns is None
