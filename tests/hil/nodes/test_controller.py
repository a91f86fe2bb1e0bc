from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.tracking.tracker import Status
from formation.pose import Motion
from hil.lockstep.lockstep import EPOCH_NS
from hil.nodes.controller import ControllerNode, ControllerState
from hil.nodes.findings import findings_in
from hil.nodes.node import Outgoing
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.drive_message import drive_message
from hil.wire.events import TICK, Event, digest
from hil.wire.messages import decode_as, encode, header, to_ns, to_time

MS = 1_000_000
NOW_NS = EPOCH_NS + 1000 * MS
NODE = ControllerNode(load_scenario("turtlebot3"))
V_MAX, U_MAX = 0.22, 2.84


def estimate(now_ns: int = NOW_NS, age_ms: float = 30.0, **changes: Any) -> Event:
    """A sound estimate of a frame that is ``age_ms`` old, and single fields changed."""
    capture = to_time(now_ns - round(age_ms * MS))
    sound = msg.LeaderEstimate(
        header=header(now_ns - round(age_ms * MS), "follower"),
        measured=capture,
        computed=to_time(now_ns),
        rho=0.25,
        alpha2=1.5,
        rho_dot=0.0,
        alpha2_dot=0.0,
        v1=0.08,
        alpha1=-1.5,
        u1=0.3,
        v2=0.1,
        u2=0.3,
        covariance=np.eye(5).reshape(25),
        nis=1.0,
        status=int(Status.TRACKING),
        reason="",
        bound_v1=0.01,
        bound_alpha1=0.1,
        bound_h=0.5,
        consumed=[],
    )
    return Event(NODE.topics.estimate, encode(replace(sound, **changes)))


STOP = Event(topics.STOP, encode(msg.String(data="enough")))


def fed(
    events: Sequence[tuple[int, Event]], node: ControllerNode = NODE, state: ControllerState | None = None
) -> tuple[ControllerState, list[msg.Command], list[msg.Twist]]:
    """State, decisions and what was sent to the robot after events at times."""
    state = node.begin(EPOCH_NS) if state is None else state
    sent: list[Outgoing] = []
    for now_ns, event in events:
        state, out = node.step(state, event, now_ns)
        sent.extend(out)
    commands = [decode_as(m.payload, msg.Command) for m in sent if m.topic == node.topics.command]
    driven = [decode_as(m.payload, msg.TwistStamped).twist for m in sent if m.topic == node.topics.cmd_vel]
    return state, commands, driven


def stop_reason(events: Sequence[tuple[int, Event]]) -> str:
    """Reason of the last decision; the robot is told to stand if there is one."""
    _, commands, driven = fed(events)
    assert len(commands) == len(driven)
    assert (commands[-1].v2, commands[-1].u2) == (driven[-1].linear.x, driven[-1].angular.z)
    if commands[-1].stop:
        assert (driven[-1].linear.x, driven[-1].angular.z) == (0.0, 0.0)
    return str(commands[-1].stop)


def test_a_fresh_tracking_estimate_drives() -> None:
    state, commands, driven = fed([(NOW_NS, estimate())])
    assert (commands[0].stop, commands[0].fresh) == ("", True)
    assert driven[0].linear.x > 0.05
    assert to_ns(commands[0].capture) == to_ns(commands[0].measured) == NOW_NS - 30 * MS
    assert [receipt.digest for receipt in commands[0].consumed] == [
        digest(NODE.topics.estimate, estimate().payload)
    ]
    assert state.receipts == ()


@pytest.mark.parametrize(
    ("events", "reason"),
    [
        ([], "no estimate"),
        ([(NOW_NS, estimate(status=0))], "no estimate"),
        ([(NOW_NS, estimate()), (NOW_NS, estimate(status=0))], "not settled"),
        ([(NOW_NS, estimate()), (NOW_NS, estimate(status=4))], "lost"),
        ([(NOW_NS, estimate(age_ms=200.0))], ""),
        ([(NOW_NS, estimate(age_ms=200.1))], "stale"),
        ([(NOW_NS, estimate(measured=to_time(NOW_NS - 300 * MS)))], "stale"),
        ([(NOW_NS, estimate()), (NOW_NS + 170 * MS, TICK)], ""),
        ([(NOW_NS, estimate()), (NOW_NS + 171 * MS, TICK)], "stale"),
        ([(NOW_NS, estimate()), (NOW_NS + 10**13, TICK)], "stale"),
        ([(NOW_NS, estimate(age_ms=-50.0))], ""),
        ([(NOW_NS, estimate()), (NOW_NS - 300 * MS, TICK), (NOW_NS, TICK)], "no estimate"),
        ([(NOW_NS, estimate()), (NOW_NS - 300 * MS, estimate(NOW_NS - 300 * MS))], ""),
        ([(NOW_NS, estimate()), (NOW_NS, estimate(status=2))], ""),
        ([(NOW_NS, estimate()), (NOW_NS, estimate(status=3))], ""),
        ([(NOW_NS, STOP), (NOW_NS, estimate())], "stopped"),
        ([(NOW_NS, estimate()), (NOW_NS, STOP), (NOW_NS + 50 * MS, TICK)], "stopped"),
        ([(NOW_NS, Event(topics.STOP, b"\xff"))], "stopped"),
    ],
)
def test_no_command_leaves_that_is_not_entitled_to(events: list[tuple[int, Event]], reason: str) -> None:
    assert stop_reason([*events, *([] if events else [(NOW_NS, TICK)])]) == reason


@pytest.mark.parametrize("name", ["rho", "alpha2", "v1", "alpha1", "u1", "v2", "u2"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e308])
def test_an_estimate_that_is_no_number_stops_the_robot(name: str, value: float) -> None:
    changes: dict[str, Any] = {name: value}
    assert stop_reason([(NOW_NS, estimate(**changes))]) == "not finite"


@pytest.mark.parametrize("rho", [0.0, -0.0, -0.3])
def test_no_distance_stops_the_robot(rho: float) -> None:
    assert stop_reason([(NOW_NS, estimate(rho=rho))]) == "not finite"


@pytest.mark.parametrize(
    "changes",
    [
        # Measured after its own capture; captured when nobody was there yet; far in the future.
        {"measured": to_time(NOW_NS - 10 * MS)},
        {"header": header(0, "follower")},
        {"header": header(NOW_NS + 10**12, "follower")},
    ],
)
def test_impossible_stamps_are_counted_and_move_nothing(changes: dict[str, Any]) -> None:
    state, commands, _ = fed([(NOW_NS, estimate(**changes))])
    assert state.refused == {"bad_stamp": 1}
    assert commands == []
    assert state.estimate is None


numbers = st.one_of(st.floats(), st.floats(-10.0, 10.0))
quantities = st.fixed_dictionaries(
    dict.fromkeys(("rho", "alpha2", "v1", "alpha1", "u1", "v2", "u2"), numbers)
    | {"status": st.integers(0, 255), "age_ms": st.floats(-500.0, 500.0)}
)


@given(st.lists(quantities, max_size=6))
@settings(deadline=None, max_examples=150)
def test_whatever_the_estimates_say_commands_are_finite_and_within_the_limits(
    given_values: list[dict[str, Any]],
) -> None:
    events = []
    for k, values in enumerate(given_values):
        now_ns = NOW_NS + 10 * k * MS
        events += [(now_ns, estimate(now_ns, **values)), (now_ns + 5 * MS, TICK)]
    _, commands, driven = fed(events)
    for command, twist in zip(commands, driven, strict=True):
        assert abs(twist.linear.x) <= V_MAX
        assert abs(twist.angular.z) <= U_MAX
        if command.stop:
            assert (twist.linear.x, twist.angular.z) == (0.0, 0.0)


@given(st.sampled_from([NODE.topics.estimate, topics.STOP, "elsewhere"]), st.binary(max_size=500))
@settings(deadline=None, max_examples=150)
def test_no_bytes_on_any_topic_raise(topic: str, payload: bytes) -> None:
    state, commands, _ = fed([(NOW_NS, Event(topic, payload))])
    assert state.stopped == (topic == topics.STOP)
    assert state.refused == ({"malformed": 1} if topic == NODE.topics.estimate else {})
    assert all(command.stop for command in commands)


@given(st.lists(st.tuples(st.integers(4, 400), st.integers(0, 255)), min_size=1, max_size=6))
@settings(deadline=None, max_examples=150)
def test_no_damaged_estimate_raises_or_breaks_the_limits(damage: list[tuple[int, int]]) -> None:
    payload = bytearray(estimate().payload)
    for place, value in damage:
        payload[place % len(payload)] = value
    _, _, driven = fed([(NOW_NS, Event(NODE.topics.estimate, bytes(payload))), (NOW_NS + MS, TICK)])
    assert all(abs(twist.linear.x) <= V_MAX and abs(twist.angular.z) <= U_MAX for twist in driven)


def test_what_cannot_be_read_is_counted_and_the_last_sound_estimate_holds() -> None:
    garbage = Event(NODE.topics.estimate, b"\x01\x02\x03")
    wrong_status = estimate(status=77)
    state, commands, _ = fed(
        [(NOW_NS, estimate()), (NOW_NS, garbage), (NOW_NS, wrong_status), (NOW_NS, TICK)]
    )
    assert state.refused == {"malformed": 2}
    assert [command.stop for command in commands] == ["", ""]
    assert [len(command.consumed) for command in commands] == [1, 2]


def test_copies_of_a_state_go_on_alike_and_apart() -> None:
    warm, _, _ = fed([(NOW_NS - 10 * MS, estimate(NOW_NS - 10 * MS))])
    first = NODE.step(warm.copy(), estimate(), NOW_NS)
    fed([(NOW_NS, STOP)], NODE, warm.copy())
    assert (warm.stopped, len(warm.sent)) == (False, 1)
    assert NODE.step(warm, estimate(), NOW_NS)[1] == first[1]


def test_commands_kept_for_the_prediction_stay_few_while_no_estimate_comes() -> None:
    state, _, _ = fed([(NOW_NS, estimate())] + [(NOW_NS + 20 * k * MS, TICK) for k in range(1, 500)])
    assert len(state.sent) <= 12


def test_a_command_leaves_at_least_at_the_rate_of_the_ticks() -> None:
    state, count, now_ns = NODE.begin(EPOCH_NS), 0, EPOCH_NS
    while now_ns < EPOCH_NS + 1000 * MS:
        now_ns = NODE.due_ns(state)
        state, out = NODE.step(state, TICK, now_ns)
        count += sum(message.topic == NODE.topics.cmd_vel for message in out)
    assert count == 51


def test_a_robot_that_takes_twist_gets_twist() -> None:
    node = ControllerNode(load_scenario("turtlebot3", ["controller.command_type=Twist"]))
    _, out = node.step(node.begin(EPOCH_NS), estimate(), NOW_NS)
    command = next(m for m in out if m.topic == node.topics.cmd_vel)
    assert command.typename == "geometry_msgs/msg/Twist"
    assert decode_as(command.payload, msg.Twist).linear.x > 0.05


def test_feed_forward_takes_the_turn_rate_of_the_estimate() -> None:
    node = ControllerNode(load_scenario("turtlebot3", ["controller.law=feedforward"]))
    _, turning, _ = fed([(NOW_NS, estimate(u1=0.4))], node)
    _, without, _ = fed([(NOW_NS, estimate(u1=0.4))])
    # Eq. (6) asks for rho * u1 more than (8), at the distance that is predicted.
    assert turning[0].v2_wanted - without[0].v2_wanted == pytest.approx(0.25 * 0.4, rel=0.2)


def test_a_turn_rate_that_nobody_can_know_is_not_fed_forward() -> None:
    node = ControllerNode(load_scenario("turtlebot3", ["controller.law=faded"]))
    _, plain, _ = fed([(NOW_NS, estimate())])
    # The matrix is the unit matrix: a standard deviation of 1 rad/s, of a leader that turns at 0.7 at most.
    _, doubtful, _ = fed([(NOW_NS, estimate())], node)
    assert doubtful[0].v2_wanted == plain[0].v2_wanted
    # As a filter at 2 rad/s reports it: the covariance with alpha1 is minus the variance over that.
    steady = 1e-2 * np.eye(5)
    steady[3, 4] = steady[4, 3] = -5e-3
    sure = estimate(covariance=steady.reshape(25))
    _, commands, _ = fed([(NOW_NS, sure)], node)
    assert commands[0].v2_wanted > plain[0].v2_wanted + 0.05
    torn = estimate(covariance=np.full(25, math.nan))
    _, commands, _ = fed([(NOW_NS, torn), (NOW_NS, sure)], node)
    assert [command.stop for command in commands] == ["not finite", ""]


def test_the_ideal_law_waits_for_the_leaders_turn_rate_and_uses_it() -> None:
    node = ControllerNode(load_scenario("turtlebot3", ["controller.law=ideal"]))
    turning, straight = (
        encode(drive_message(Motion(0.08, u1), NOW_NS, "leader", stamped=True)) for u1 in (0.5, 0.0)
    )
    told = "leader/cmd_vel"
    before = [estimate(), Event(told, b"\x01"), Event(told, turning), TICK]
    state, commands, _ = fed([(NOW_NS, event) for event in before], node)
    assert [command.stop for command in commands] == ["not finite", ""]
    assert state.refused == {"malformed": 1}
    _, other, _ = fed([(NOW_NS, Event(told, straight)), (NOW_NS, TICK)], node, state)
    # Eq. (6) asks for rho * u1 more, at the distance that is predicted.
    assert commands[-1].v2_wanted - other[-1].v2_wanted == pytest.approx(0.25 * 0.5, rel=0.2)


def reported(state: ControllerState, node: ControllerNode = NODE) -> dict[str, str]:
    (status,) = decode_as(node.report(state, NOW_NS).payload, msg.DiagnosticArray).status
    return {each.key: each.value for each in status.values}


def test_every_decision_is_counted_under_its_name() -> None:
    events = [
        (NOW_NS, TICK),
        (NOW_NS, estimate()),
        (NOW_NS + 20 * MS, TICK),
        (NOW_NS + 40 * MS, TICK),
        (NOW_NS + 40 * MS, estimate(status=4)),
        (NOW_NS + 41 * MS, Event(NODE.topics.estimate, b"\x01")),
        (NOW_NS + 42 * MS, STOP),
        (NOW_NS + 62 * MS, TICK),
    ]
    state, commands, _ = fed(events)
    expected = {"no estimate": 1, "driving": 3, "lost": 1, "stopped": 2}
    assert dict(state.decided) == expected
    assert len(commands) == sum(expected.values())
    said = reported(state)
    assert {key: value for key, value in said.items() if key.startswith("decided.")} == {
        f"decided.{name}": str(count) for name, count in expected.items()
    }
    assert said["refused.malformed"] == "1"
    assert said["estimate"] == "lost"


def test_the_report_warns_until_an_estimate_was_heard() -> None:
    for state, level, message in (
        (NODE.begin(NOW_NS), 1, "waiting for estimates"),
        (fed([(NOW_NS, estimate(status=0))])[0], 0, "ok"),
    ):
        (status,) = decode_as(NODE.report(state, NOW_NS).payload, msg.DiagnosticArray).status
        assert (status.level, status.message) == (level, message)


def test_a_change_of_sides_is_told_by_where_it_is() -> None:
    node = ControllerNode(load_scenario("changing-sides"))
    k_u = load_scenario("changing-sides").leader.k_u
    left = Event(node.topics.side, encode(msg.String(data="left")))
    hard, gently = estimate(u1=20.0 * k_u), estimate(u1=0.0)
    told: list[tuple[str, str]] = []
    state = node.begin(EPOCH_NS)
    for event in (gently, left, hard, gently):
        state, _ = node.step(state, event, NOW_NS)
        said = reported(state, node)
        told.append((said["side"], said["side_change"]))
    waits = ("left", "waits for a leader that turns less")
    assert told == [("right", "none"), waits, waits, ("left", "under way")]


def test_diagnostics_leave_twice_a_second() -> None:
    state, times = NODE.begin(NOW_NS), []
    for k in range(101):
        now_ns = NOW_NS + 20 * k * MS
        state, out = NODE.step(state, TICK, now_ns)
        times += [now_ns - NOW_NS for message in out if message.topic == topics.DIAGNOSTICS]
    assert times == [500 * k * MS for k in range(5)]


def test_an_estimate_may_be_50_ms_ahead_of_the_clock_before_it_is_refused() -> None:
    for ahead_ms, refused in ((50.0, {}), (50.001, {"bad_stamp": 1})):
        state, _, _ = fed([(NOW_NS, estimate(age_ms=-ahead_ms))])
        assert dict(state.refused) == refused


@pytest.mark.parametrize(("v2", "u2", "stands"), [(0.0, 0.0, True), (0.1, 0.3, False), (0.0, 0.3, False)])
def test_a_robot_that_does_not_answer_is_named_within_two_seconds(v2: float, u2: float, stands: bool) -> None:
    state = NODE.begin(NOW_NS)
    found: dict[int, set[str]] = {}
    for number in range(101):
        now_ns = NOW_NS + number * 20 * MS
        state, out = NODE.step(state, estimate(now_ns, v2=v2, u2=u2), now_ns)
        for message in out:
            if message.topic == topics.DIAGNOSTICS:
                report = decode_as(message.payload, msg.DiagnosticArray)
                found[now_ns - NOW_NS] = set(findings_in(report)[NODE.name])
    assert found[max(found)] == ({"deaf_robot"} if stands else set())
    assert not found[min(found)]
