from __future__ import annotations

import pytest

from formation.pose import Motion, Pose, advance
from formation.shape import shape_of
from hil.emulator.lab_messages import odometry_message
from hil.nodes.estimator import EstimatorNode
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire.events import Event
from hil.wire.messages import decode_as, encode, header

START_NS = 1_000_000_000
STEP_NS = 50_000_000
NO_SLIP = ["estimator.slip_v2=0", "estimator.slip_u2=0"]  # slip might be what an offset does
BODY = ["estimator.front_end=body", "estimator.turn_bandwidth=0.01", "estimator.sigma_u2=0.005", *NO_SLIP]
OFFSETS = (0.03, -0.08)


def reported(settings: list[str], u2: float, seconds: float = 20.0) -> tuple[dict[str, str], float, float]:
    """Diagnostics, and errors of rho and alpha2, of a node that sees a leader drive straight on.

    Its sightings have offsets; its follower turns at u2.
    """
    node = EstimatorNode(load_scenario("turtlebot3", settings))
    leader, follower, own = Pose(0.5, 0.3, 0.0), Pose(0.0, 0.0, 0.0), Motion(0.15, u2)
    state, now_ns = node.begin(START_NS), START_NS
    for k in range(round(seconds * 1e9 / STEP_NS)):
        now_ns = START_NS + k * STEP_NS
        shape = shape_of(leader, follower)
        told = odometry_message(now_ns, "follower", Pose(0.0, 0.0, 0.0), own)
        seen = msg.RangeBearing(header(now_ns, "follower"), shape.rho + OFFSETS[0], shape.alpha2 + OFFSETS[1])
        for topic, message in ((node.topics.odom, told), (node.topics.sighting, seen)):
            state, _ = node.step(state, Event(topic, encode(message)), now_ns)
        leader, follower = advance(leader, 0.15, 0.0, 0.05), advance(follower, own.v, own.u, 0.05)
    report = decode_as(node.report(state, now_ns).payload, msg.DiagnosticArray).status[0]
    told_last = state.memory.estimate(now_ns)
    assert told_last is not None
    found = told_last.estimate
    return (
        {each.key: each.value for each in report.values},
        found.rho - shape.rho,
        found.alpha2 - shape.alpha2,
    )


def test_known_offsets_are_taken_off() -> None:
    known = [f"estimator.range_bias={OFFSETS[0]}", f"estimator.bearing_bias={OFFSETS[1]}"]
    said, rho, alpha2 = reported([*BODY, *known], 0.4, 5.0)
    assert (rho, alpha2) == pytest.approx((0.0, 0.0), abs=2e-3)
    assert not [name for name in said if "bias" in name]


def test_offsets_are_told_where_the_follower_turns_against_the_leader() -> None:
    said, _, alpha2 = reported([*BODY, "estimator.bias_states=true"], 0.4)
    assert said["bearing_bias_state"] == "estimated"
    assert float(said["bearing_bias"]) == pytest.approx(OFFSETS[1], abs=3 * float(said["bearing_bias_sd"]))
    assert float(said["bearing_bias_sd"]) < 0.05
    assert abs(alpha2) < 0.5 * abs(OFFSETS[1])


def test_offsets_are_left_alone_where_both_drive_straight_on_and_the_report_says_why() -> None:
    said, *_ = reported([*BODY, "estimator.bias_states=true"], 0.0)
    assert said["range_bias_state"] == "off: the line of sight does not turn against the leader"
    assert said["bearing_bias_state"] == "off: the follower's velocity does not change against the leader's"
    assert float(said["range_bias_sd"]) == pytest.approx(0.05, rel=0.1)
    assert float(said["bearing_bias_sd"]) == pytest.approx(0.1, rel=0.1)
