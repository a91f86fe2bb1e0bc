"""The estimator node where odometry is late and falls short of the motion."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from estimation.own_motion.odometry_history import AS_TOLD, IDEAL
from formation.pose import Motion, Pose, advance
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.lockstep.lockstep import EPOCH_NS, Lockstep
from hil.lockstep.run import make_nodes
from hil.nodes.estimator import EstimatorNode, EstimatorState
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import decode_as, encode, to_ns

STEP_NS = 33_333_333
LATE = 3
"""Steps by which the odometry of these tests is stamped late: a tenth of a second."""


def wheels(k: int) -> Motion:
    t = k * STEP_NS * 1e-9
    return Motion(0.1 + 0.05 * math.sin(0.9 * t), 0.5 * math.sin(1.7 * t) + 0.2 * math.sin(0.4 * t))


def lived(
    node: EstimatorNode, steps: int, scale: float, late: int, lag: float = 0.0
) -> tuple[EstimatorState, list[msg.LeaderEstimate]]:
    """State after a drive past a standing leader with odometry that tells ``scale`` of the motion, late."""
    generator, follower, found = np.random.default_rng(4), Pose(0.0, 0.0, 0.5), []
    state, moved = node.begin(EPOCH_NS), wheels(0)
    for k in range(steps):
        at_ns, shake = EPOCH_NS + k * STEP_NS, generator.normal(size=5).tolist()
        told = wheels(k - late)
        wanted = wheels(k)
        kept = math.exp(-STEP_NS * 1e-9 / lag) if lag > 0.0 else 0.0
        moved = Motion(wanted.v + kept * (moved.v - wanted.v), wanted.u + kept * (moved.u - wanted.u))
        measured = Motion(scale * told.v + 0.002 * shake[3], scale * told.u + 0.01 * shake[4])
        seen = Pose(
            follower.x + 3e-4 * shake[0], follower.y + 3e-4 * shake[1], follower.theta + 3e-3 * shake[2]
        )
        odometry = encode(odometry_message(at_ns, "follower", follower, measured))
        frame = encode(frame_message(at_ns, k, [("leader", Pose(1.0, 1.0, 0.0)), ("follower", seen)]))
        for event in (Event("follower/odom", odometry), Event(topics.RIGID_BODIES, frame)):
            state, sent = node.step(state, event, at_ns)
            found += [
                decode_as(m.payload, msg.LeaderEstimate) for m in sent if m.topic == node.topics.estimate
            ]
        follower = advance(follower, moved.v, moved.u, STEP_NS * 1e-9)
    return state, found


@pytest.mark.parametrize("source", ["odometry", "fused"])
def test_odometry_that_is_late_and_short_is_put_right(source: str) -> None:
    given = ["estimator.align_odometry=true", f"estimator.own_motion={source}"]
    node = EstimatorNode(load_scenario("turtlebot3", given))
    state, found = lived(node, 420, scale=0.9, late=LATE)
    applied = state.comparison.applied
    # The wheels keep their motion for a step, of which odometry tells at its begin.
    assert applied.delay == pytest.approx(-(LATE - 0.5) * STEP_NS * 1e-9, abs=0.01)
    assert (applied.scale_v, applied.scale_u) == pytest.approx((1 / 0.9, 1 / 0.9), abs=0.02)
    report = decode_as(node.report(state, EPOCH_NS).payload, msg.DiagnosticArray).status[0]
    assert {entry.key for entry in report.values} >= {
        "odometry.delay",
        "odometry.scale_v",
        "odometry.scale_u",
    }
    # Before the newest sample nobody knows what the wheels do now, so the scale is what can be seen at once.
    v2 = [wheels(k - LATE).v for k in range(320, 420)]
    assert np.mean([each.v2 for each in found[-100:]]) == pytest.approx(np.mean(v2), abs=0.004)


def test_good_odometry_is_left_alone_and_nothing_is_done_unasked() -> None:
    asked = EstimatorNode(load_scenario("turtlebot3", ["estimator.align_odometry=true"]))
    plain = EstimatorNode(load_scenario("turtlebot3"))
    state, found = lived(asked, 300, scale=1.0, late=0)
    untouched, expected = lived(plain, 300, scale=1.0, late=0)
    assert state.comparison.found.delay is not None
    # What is left is what an alignment is uncertain by, and unused where no motion is said to come later.
    assert state.comparison.applied._replace(left=AS_TOLD) == IDEAL
    assert 0.0 < state.comparison.applied.left < 0.1
    assert untouched.comparison.poses == ()
    assert [each.v1 for each in found] == [each.v1 for each in expected]


def test_a_lag_is_found_and_odometry_passed_through_it() -> None:
    node = EstimatorNode(
        load_scenario("turtlebot3", ["estimator.align_odometry=true", "estimator.own_motion=odometry"])
    )
    state, found = lived(node, 900, scale=1.0, late=0, lag=0.25)
    applied = state.comparison.applied
    assert applied.time_constant == pytest.approx(0.25, abs=0.04)
    assert applied.delay + applied.time_constant == pytest.approx(0.25 - 0.5 * STEP_NS * 1e-9, abs=0.02)
    report = decode_as(node.report(state, EPOCH_NS).payload, msg.DiagnosticArray).status[0]
    reported = {entry.key: entry.value for entry in report.values}
    assert float(reported["odometry.time_constant"]) == pytest.approx(applied.time_constant, abs=1e-3)
    moved, true = 0.0, []
    for k in range(900):
        kept = math.exp(-STEP_NS * 1e-9 / 0.25)
        moved = wheels(k).u + kept * (moved - wheels(k).u)
        true.append(moved)
    off = np.array([each.u2 for each in found[-150:]]) - true[-150:]
    untold = np.array([wheels(k).u for k in range(750, 900)]) - true[-150:]
    assert np.sqrt(np.mean(off**2)) < 0.4 * np.sqrt(np.mean(untold**2))


def test_a_lag_that_is_told_is_used_from_the_start() -> None:
    told = ["estimator.input_time_constant_s=0.25", "estimator.input_scale_u=0.8"]
    for source in ("odometry", "auto"):
        node = EstimatorNode(load_scenario("turtlebot3", [*told, f"estimator.own_motion={source}"]))
        state, found = lived(node, 120, scale=1.0, late=0, lag=0.25)
        history = state.memory.history
        answer = history[0].u2
        for before, after in itertools.pairwise(history):
            # The signal as a straight line in many small pieces, each of them held.
            for piece in range(200):
                share = (piece + 0.5) / 200
                held = before.u2 + share * (after.u2 - before.u2)
                kept = math.exp(-(after.stamp_ns - before.stamp_ns) * 1e-9 / 200 / 0.25)
                answer = held + kept * (answer - held)
            assert after.answer_u == pytest.approx(answer, abs=1e-5)
        if source == "odometry":
            assert found[-1].u2 == pytest.approx(0.8 * history[-1].answer_u, abs=1e-9)


def test_emulated_odometry_is_late_and_scaled_as_told() -> None:
    told: list[tuple[int, int, float]] = []
    given = [
        *("robot.odometry_delay_s=0.1", "robot.odometry_scale_v=0.5", "robot.odometry_scale_u=2"),
        *("robot.odometry_sigma_v=0", "robot.odometry_sigma_u=0", "robot.lag_s=0"),
    ]
    nodes = make_nodes(load_scenario("turtlebot3", given))

    def record(message: object, now_ns: int) -> None:
        topic, payload = getattr(message, "topic", ""), getattr(message, "payload", b"")
        if topic == "leader/odom":
            odometry = decode_as(payload, msg.Odometry)
            told.append((to_ns(odometry.header.stamp), now_ns, odometry.twist.twist.linear.x))

    Lockstep(nodes, record).run_until(EPOCH_NS + 1_000_000_000)
    assert told[0][0] == EPOCH_NS + 100_000_000
    assert all(stamp_ns == now_ns for stamp_ns, now_ns, _ in told)
    assert told[-1][2] == pytest.approx(0.04)
