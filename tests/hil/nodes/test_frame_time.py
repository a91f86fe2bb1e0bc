"""The estimator node where the motion capture's clock is not the host's."""

from __future__ import annotations

from typing import Any

import pytest

from estimation.tracking.tracker import Status
from formation.pose import Motion, Pose, advance
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.errors import UsageError
from hil.judge.run_data import run_data_of_log
from hil.judge.summary import summarise
from hil.lockstep.lockstep import EPOCH_NS
from hil.lockstep.run import run_lockstep
from hil.log.reader import Log, read_log
from hil.nodes.estimator import EstimatorNode, EstimatorState
from hil.replay.rerun import replay
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import decode_as, encode, to_ns

FRAME_NS = 8_333_333
LATENCY_NS = 30_000_000
SECOND_NS = 1_000_000_000


def node_with(*overrides: str) -> EstimatorNode:
    return EstimatorNode(load_scenario("turtlebot3", overrides))


def lived(
    node: EstimatorNode, count: int, ahead_ns: int, jump_at: int, jump_ns: int
) -> tuple[EstimatorState, list[tuple[int, msg.LeaderEstimate]]]:
    """State after frames of a clock that is ahead and jumps, and the estimates with when they were made."""
    leader, follower = Pose(0.3, 0.0, 1.5), Pose(0.7, 0.1, 1.6)
    still = encode(odometry_message(EPOCH_NS, "follower", follower, Motion(0.0, 0.0)))
    state, _ = node.step(node.begin(EPOCH_NS), Event("follower/odom", still), EPOCH_NS)
    found = []
    for k in range(count):
        at_ns = EPOCH_NS + k * FRAME_NS
        stamp_ns = at_ns + ahead_ns + (jump_ns if k >= jump_at else 0)
        frame = frame_message(stamp_ns, k, [("leader", leader), ("follower", follower)])
        state, sent = node.step(state, Event(topics.RIGID_BODIES, encode(frame)), at_ns + LATENCY_NS)
        found += [
            (at_ns, decode_as(m.payload, msg.LeaderEstimate)) for m in sent if m.topic == node.topics.estimate
        ]
        leader = advance(leader, 0.08, 0.3, FRAME_NS * 1e-9)
    return state, found


def diagnosed(node: EstimatorNode, state: EstimatorState) -> dict[str, str]:
    report = decode_as(node.report(state, EPOCH_NS).payload, msg.DiagnosticArray)
    return {entry.key: entry.value for entry in report.status[0].values}


@pytest.mark.parametrize(
    ("jump_ns", "status"),
    [(-100_000_000, Status.TRACKING), (-3 * SECOND_NS, Status.LOST), (70_000_000, Status.TRACKING)],
)
def test_trusted_stamps_that_jump_start_the_track_anew(jump_ns: int, status: Status) -> None:
    node = node_with()
    state, found = lived(node, 600, 0, 300, jump_ns)
    assert state.times.clock.jumps == 1
    at_ns, last = found[-1]
    assert last.status == status  # what is 3 s old by its stamp may not move a robot
    assert to_ns(last.header.stamp) == at_ns + jump_ns
    assert state.refused.get("too_late", 0) < 40
    assert (last.v1, last.u1) == pytest.approx((0.08, 0.3), abs=0.01)
    if status is Status.TRACKING:
        waiting = [at_ns for at_ns, each in found if each.status == Status.INITIALISING]
        assert EPOCH_NS + 300 * FRAME_NS < waiting[-1] < EPOCH_NS + 300 * FRAME_NS + SECOND_NS
    assert diagnosed(node, state)["clock.jumps"] == "1"


def test_trusted_stamps_in_the_future_stay_refused_and_are_reported() -> None:
    node = node_with()
    state, found = lived(node, 60, 2 * SECOND_NS, 0, 0)
    assert not found
    assert state.refused == {"bad_stamp": 60}
    assert diagnosed(node, state)["clock.offset_ms"] == "1970.0"


@pytest.mark.parametrize("jump_ns", [-3 * SECOND_NS, 900_000_000])
def test_an_estimated_clock_may_be_anywhere_and_jump_without_a_new_start(jump_ns: int) -> None:
    node = node_with("estimator.clock=estimated", "estimator.transport_latency_s=0.03")
    state, found = lived(node, 600, 5 * SECOND_NS, 300, jump_ns)
    assert all(to_ns(each.header.stamp) == pytest.approx(at_ns, abs=100) for at_ns, each in found)
    settled = next(k for k, (_, each) in enumerate(found) if each.status == Status.TRACKING)
    assert {each.status for _, each in found[settled:]} <= {Status.TRACKING, Status.COASTING}
    assert found[-1][1].v1 == pytest.approx(0.08, abs=0.005)
    assert state.refused["clock_unknown"] < 40
    assert state.refused["clock_jump"] < 60


def test_without_a_known_latency_captures_seem_later_by_it() -> None:
    _, found = lived(node_with("estimator.clock=estimated"), 90, 0, 0, 0)
    assert {to_ns(each.header.stamp) - at_ns for at_ns, each in found} == {LATENCY_NS}


@pytest.fixture(scope="module")
def off_log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """The run of ``short_log`` with a clock that is 5 s ahead and drifts, estimated."""
    path = tmp_path_factory.mktemp("clock") / "run.mcap"
    given = [
        *("run.seed=7", "run.duration_s=6.0", "run.evaluate_from_s=3.0", "mocap.loss=0.05"),
        *("mocap.clock_offset_s=5", "mocap.clock_drift_ppm=50"),
        *("estimator.clock=estimated", "estimator.transport_latency_s=0.03"),
    ]
    run_lockstep(load_scenario("turtlebot3", given), path)
    return read_log(path)


def test_a_run_with_a_clock_of_its_own_is_as_good_as_one_without(short_log: Log, off_log: Log) -> None:
    plain, off = (summarise(run_data_of_log(log)) for log in (short_log, off_log))
    for name in ("v1", "alpha1"):
        assert off["estimation"]["rmse"][name] < 1.1 * plain["estimation"]["rmse"][name]
        assert off["estimation"]["efficiency"][name] < 1.1 * plain["estimation"]["efficiency"][name]
    deviations: list[dict[str, Any]] = [each["formation"]["orbit_deviation_rms"] for each in (plain, off)]
    assert deviations[1]["rho"] < 1.1 * deviations[0]["rho"] + 1e-3
    assert off["frames"]["lost"] == pytest.approx(plain["frames"]["lost"], abs=10)
    # The run takes 6.7 s from the first frame on, in which the clock gains a third of a millisecond.
    assert off["clock"]["offset_ms"] == pytest.approx(4970.3, abs=0.2)
    assert off["clock"]["jumps"] == 0
    assert plain["clock"]["offset_ms"] == pytest.approx(-30.0, abs=1e-3)


def test_a_run_with_a_clock_of_its_own_is_replayed_bit_for_bit(off_log: Log) -> None:
    played = replay(off_log)
    assert played.parity["estimates"].compared > 700
    assert played.mismatched == 0


def test_trusted_stamps_are_put_right_by_their_offset_before_they_are_judged() -> None:
    node = node_with("estimator.stamp_offset_s=0.1")
    state, found = lived(node, 60, 100_000_000, 60, 0)
    assert state.refused == {}
    assert all(to_ns(estimate.header.stamp) == at_ns for at_ns, estimate in found)
    early = node_with("estimator.stamp_offset_s=-0.1")
    state, found = lived(early, 60, 0, 60, 0)
    assert found == []
    assert state.refused["bad_stamp"] == 60


def test_stamps_are_not_corrected_twice() -> None:
    with pytest.raises(UsageError, match=r"estimator.stamp_offset_s is 0.1: .*give estimator.transport_l"):
        node_with("estimator.stamp_offset_s=0.1", "estimator.clock=estimated")


def test_a_stamp_that_would_lie_before_1970_is_refused() -> None:
    node = node_with("estimator.stamp_offset_s=0.5")
    pair = [("leader", Pose(0.3, 0.0, 1.5)), ("follower", Pose(0.7, 0.1, 1.6))]
    frame = Event(topics.RIGID_BODIES, encode(frame_message(0, 0, pair)))
    state, sent = node.step(node.begin(EPOCH_NS), frame, EPOCH_NS)
    assert (dict(state.refused), sent) == ({"bad_stamp": 1}, ())
