"""The estimator node where the follower's motion comes from its own mocap track."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.own_motion.odometry_check import TWIST, source_of
from estimation.tracking.tracker import Status
from formation.pose import Motion, Pose, advance
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.lockstep.lockstep import EPOCH_NS
from hil.nodes.estimator import EstimatorNode, EstimatorState
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import decode_as, encode

FRAME_NS = 8_333_333
LATE_NS = 120_000_000
OWN = Motion(0.1, 0.4)
WRONG = Motion(0.3, -0.5)
"""What the odometry of these tests claims."""


def node_with(source: str, front_end: str = "world") -> EstimatorNode:
    # Noise is learned from frames in order alone: what late ones are folded in with depends on the order.
    overrides = [
        f"estimator.own_motion={source}",
        f"estimator.front_end={front_end}",
        "estimator.noise=given",
        "estimator.process_noise=given",
    ]
    return EstimatorNode(load_scenario("turtlebot3", overrides))


def frames(count: int, flipped: range = range(0)) -> list[Event]:
    generator = np.random.default_rng(2)
    leader, follower, events = Pose(0.3, 0.0, 1.5), Pose(0.7, 0.1, 1.6), []
    for k in range(count):
        shake = generator.normal(size=5) * [3e-4, 3e-4, 3e-4, 3e-4, 3e-3]
        seen = Pose(leader.x + shake[0], leader.y + shake[1], leader.theta)
        turned = math.pi if k in flipped else 0.0
        own = Pose(follower.x + shake[2], follower.y + shake[3], follower.theta + shake[4] + turned)
        message = frame_message(EPOCH_NS + k * FRAME_NS, k, [("leader", seen), ("follower", own)])
        events.append(Event(topics.RIGID_BODIES, encode(message)))
        leader = advance(leader, 0.08, 0.3, FRAME_NS * 1e-9)
        follower = advance(follower, OWN.v, OWN.u, FRAME_NS * 1e-9)
    return events


def odometry(k: int, motion: Motion) -> Event:
    message = odometry_message(EPOCH_NS + k * FRAME_NS, "follower", Pose(0.0, 0.0, 0.0), motion)
    return Event("follower/odom", encode(message))


def fed(node: EstimatorNode, events: list[Event]) -> tuple[EstimatorState, list[msg.LeaderEstimate]]:
    state, found = node.begin(EPOCH_NS), []
    now_ns = EPOCH_NS + 10 * 1_000_000_000
    for event in events:
        state, sent = node.step(state, event, now_ns)
        found += [decode_as(m.payload, msg.LeaderEstimate) for m in sent if m.topic == node.topics.estimate]
    return state, found


@pytest.mark.parametrize("front_end", ["world", "body"])
def test_the_own_track_takes_the_place_of_odometry(front_end: str) -> None:
    state, found = fed(node_with("mocap", front_end), [odometry(0, WRONG), *frames(240)])
    late = found[120:]
    # With a heading noise of 3 mrad a turn rate is known to about 0.3 rad/s at any one moment.
    assert np.mean([e.v2 for e in late]) == pytest.approx(OWN.v, abs=0.01)
    assert np.mean([e.u2 for e in late]) == pytest.approx(OWN.u, abs=0.05)
    assert np.std([e.u2 for e in late]) < 0.4
    assert found[-1].v1 == pytest.approx(0.08, abs=0.02)
    assert state.taken["used"] == 240


def test_good_odometry_steadies_the_own_track_and_without_any_it_stands_alone() -> None:
    mixed = [event for k, frame in enumerate(frames(240)) for event in (odometry(k, OWN), frame)]
    _, both = fed(node_with("fused"), mixed)
    _, alone = fed(node_with("mocap"), frames(240))
    _, silent = fed(node_with("fused"), frames(240))
    spread = [float(np.std([e.u2 for e in found[120:]])) for found in (both, alone)]
    assert spread[0] < 0.5 * spread[1]
    assert [e.u2 for e in silent] == [e.u2 for e in alone]


@pytest.mark.parametrize("front_end", ["world", "body"])
def test_late_frames_give_what_delivery_in_order_would_have_given(front_end: str) -> None:
    node, events = node_with("mocap", front_end), frames(120)
    shuffled = [*range(80), *(80 + k for k in np.random.default_rng(6).permutation(20)), *range(100, 120)]
    in_order, expected = fed(node, events)
    mixed, found = fed(node, [events[k] for k in shuffled])
    assert mixed.taken["late"] > 5
    assert not mixed.refused
    assert (found[-1].v2, found[-1].u2) == pytest.approx((expected[-1].v2, expected[-1].u2), abs=1e-12)
    for one, other in zip(mixed.memory.track[-12:], in_order.memory.track[-12:], strict=True):
        np.testing.assert_allclose(one.belief.mean, other.belief.mean, atol=1e-9)
        np.testing.assert_allclose(one.belief.covariance, other.belief.covariance, atol=1e-9)


def test_frames_that_come_twice_or_too_late_leave_the_own_track_alone() -> None:
    node, (*events, new) = node_with("mocap"), frames(121)
    now_ns = EPOCH_NS + 10 * 1_000_000_000
    state, _ = fed(node, events)
    expected, _ = node.step(state.copy(), new, now_ns)
    for again in (events[-1], events[50]):
        after, out = node.step(state.copy(), again, now_ns)
        assert out == ()
        assert after.memory.track == state.memory.track
        after, out = node.step(after, new, now_ns)
        assert len(out) == 1
        assert after.memory.track == expected.memory.track


def test_without_odometry_it_does_not_wait_for_any() -> None:
    node = node_with("mocap")
    state, _ = fed(node, frames(60))
    now_ns = EPOCH_NS + 60 * FRAME_NS
    report = decode_as(node.report(state, now_ns).payload, msg.DiagnosticArray).status[0]
    assert (report.level, report.message) == (0, "ok")
    assert state.memory.status(now_ns) is Status.TRACKING


@pytest.mark.parametrize(("source", "length"), [("mocap", 1), ("mocap", 40), ("fused", 40)])
def test_a_heading_that_turns_round_for_a_while_leaves_the_own_track_alone(source: str, length: int) -> None:
    events = frames(240, flipped=range(120, 120 + length))
    mixed = [event for k, frame in enumerate(events) for event in (odometry(k, OWN), frame)]
    state, found = fed(node_with(source), mixed)
    assert state.refused == {"flipped_heading": length}
    good = [e for k, e in enumerate(found) if k >= 90 and not 120 <= k < 120 + length]
    assert max(abs(e.v2 - OWN.v) for e in good) < 0.1


def driven_round(count: int, lie: Motion | None) -> list[Event]:
    """Frames, and odometry every fourth time that tells another motion, or none at all."""
    return [
        event
        for k, frame in enumerate(frames(count))
        for event in ([odometry(k, lie), frame] if lie is not None and k % 4 == 0 else [frame])
    ]


def findings(node: EstimatorNode, state: EstimatorState, k: int) -> dict[str, str]:
    report = decode_as(node.report(state, EPOCH_NS + k * FRAME_NS).payload, msg.DiagnosticArray).status[0]
    assert (report.level, report.message) == (0, "ok")
    return {value.key: value.value for value in report.values if value.key.startswith("finding.")}


def test_healthy_odometry_is_taken_to_the_last_bit() -> None:
    _, by_odometry = fed(node_with("odometry"), driven_round(360, OWN))
    node = node_with("auto")
    state, judged = fed(node, driven_round(360, OWN))
    assert [tuple(e.covariance) for e in judged] == [tuple(e.covariance) for e in by_odometry]
    assert [(e.v2, e.u2, e.v1) for e in judged] == [(e.v2, e.u2, e.v1) for e in by_odometry]
    assert findings(node, state, 360) == {}


def lied_to(node: EstimatorNode, frames: int) -> EstimatorState:
    return fed(node, driven_round(frames, WRONG))[0]


@pytest.mark.parametrize("front_end", ["world", "body"])
def test_odometry_that_lies_is_named_and_the_track_takes_over(front_end: str) -> None:
    node = node_with("auto", front_end)
    state, found = fed(node, driven_round(480, WRONG))
    assert set(findings(node, state, 480)) == {"finding.odometry_contradicts"}
    # Before it is refuted the track speaks against it already; less clearly where wheels may slip.
    slack = 1.0 if front_end == "world" else 2.0
    assert source_of(lied_to(node, 120).memory.known.odometry_check) == TWIST
    assert np.mean([e.v2 for e in found[60:120]]) == pytest.approx(OWN.v, abs=0.03 * slack)
    assert np.mean([e.u2 for e in found[60:120]]) == pytest.approx(OWN.u, abs=0.15 * slack)
    assert np.mean([e.v2 for e in found[300:]]) == pytest.approx(OWN.v, abs=0.01)
    assert np.mean([e.u2 for e in found[300:]]) == pytest.approx(OWN.u, abs=0.05)


def test_along_the_own_axes_poses_tell_the_turn_and_odometry_the_rates() -> None:
    """Whatever odometry may be worth: the leader is known as well as without any."""
    _, judged = fed(node_with("auto", "body"), driven_round(240, OWN))
    _, alone = fed(node_with("mocap", "body"), frames(240))
    assert [(e.v1, e.alpha1, e.u1) for e in judged] == [(e.v1, e.alpha1, e.u1) for e in alone]
    assert np.std([e.u2 for e in judged[120:]]) < 0.1 * np.std([e.u2 for e in alone[120:]])


def test_odometry_that_falls_silent_ages_and_gives_way() -> None:
    node = node_with("auto")
    events = [*driven_round(120, OWN), *frames(360)[120:]]
    state, found = fed(node, events)
    assert set(findings(node, state, 360)) == {"finding.odometry_silent"}
    sd = [math.sqrt(e.covariance.reshape(5, 5)[1, 1]) for e in found]
    assert sd[-1] > 3.0 * sd[100]
    assert np.mean([e.u2 for e in found[200:]]) == pytest.approx(OWN.u, abs=0.05)


def test_without_any_odometry_auto_is_as_good_as_mocap() -> None:
    node = node_with("auto")
    state, found = fed(node, frames(240))
    _, alone = fed(node_with("mocap"), frames(240))
    assert [e.u2 for e in found[1:]] == [e.u2 for e in alone[1:]]
    assert set(findings(node, state, 240)) == {"finding.odometry_silent"}


def test_numbers_that_are_none_are_counted_apart() -> None:
    node = node_with("auto")
    state, _ = fed(node, [odometry(0, Motion(math.nan, 0.0)), *frames(60)])
    assert state.refused == {"odometry_not_finite": 1}


def test_bounds_take_the_noise_of_the_source_for_granted() -> None:
    E_v2 = {source: node_with(source).rules.assumed.E_v2 for source in ("odometry", "mocap", "fused")}
    assert E_v2["odometry"] == pytest.approx(3.0 * 0.005)
    assert E_v2["fused"] < E_v2["mocap"]
    _, found = fed(node_with("mocap"), frames(240))
    errors = [abs(e.v2 - OWN.v) for e in found[120:]]
    assert 0.1 * E_v2["mocap"] < max(errors) < E_v2["mocap"]


def test_receipts_of_odometry_do_not_pile_up_without_frames() -> None:
    node, event = node_with("odometry"), odometry(0, OWN)
    state, _ = fed(node, [event] * 4500)
    assert len(state.receipts) == 4096
    assert state.taken == {"odometry": 4500}
