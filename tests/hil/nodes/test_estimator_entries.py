"""The entries of the estimator: what comes of each input before it is taken into the tracks, and after."""

from __future__ import annotations

import math

import pytest

from controllers.guard import CLOCK_TOLERANCE_NS
from estimation.own_motion.odometry_history import MotionSample
from estimation.tracking.tracker import Status
from formation.pose import Motion, Pose
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.nodes.estimator import EstimatorNode
from hil.nodes.estimator_inputs import RESTARTED, SEEN, SET_BACK, TICK_NS
from hil.nodes.estimator_memory import EstimatorMemory
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire.messages import decode_as, encode, header, to_ns

NOW_NS = 1_000_000_000_000
MS = 1_000_000
FOLLOWER = Pose(0.7, 0.1, 1.6)


def memory(*overrides: str) -> EstimatorMemory:
    return EstimatorNode(load_scenario("turtlebot3", overrides)).begin(NOW_NS).memory


def by_sensor(*overrides: str) -> EstimatorMemory:
    return memory("estimator.front_end=body", *overrides)


def frame(stamp_ns: int, number: int, leader: tuple[float, float] = (0.3, 0.0)) -> bytes:
    return encode(frame_message(stamp_ns, number, [("leader", Pose(*leader, 1.5)), ("follower", FOLLOWER)]))


def odometry(stamp_ns: int) -> bytes:
    return encode(odometry_message(stamp_ns, "follower", FOLLOWER, Motion(0.1, 0.2)))


def sighting(stamp_ns: int, rho: float, alpha2: float) -> bytes:
    return encode(msg.RangeBearing(header(stamp_ns, "follower"), rho, alpha2))


@pytest.mark.parametrize(("early_ns", "seen"), [(CLOCK_TOLERANCE_NS, True), (CLOCK_TOLERANCE_NS + 1, False)])
def test_odometry_and_sightings_may_be_as_early_as_clocks_differ(early_ns: int, seen: bool) -> None:
    kept = by_sensor()
    assert kept.see_odometry(odometry(NOW_NS + early_ns), 1, NOW_NS) == (SEEN if seen else 0)
    assert kept.see_sighting(sighting(NOW_NS + early_ns, 0.5, 1.0), 2, NOW_NS) == (SEEN if seen else 0)
    assert kept.refused == ({} if seen else {"bad_stamp": 2})
    assert kept.taken == ({"frames": 1, "odometry": 1} if seen else {})


def test_what_is_seen_is_what_the_message_says_by_the_hosts_clock() -> None:
    kept = memory("estimator.stamp_offset_s=0.25")
    assert kept.see_odometry(odometry(NOW_NS - 7), 1, NOW_NS) == SEEN
    assert kept.sample[:3] == (NOW_NS - 7, 0.1, 0.2)
    kept.take_odometry()
    assert kept.history == (MotionSample(NOW_NS - 7, 0.1, 0.2),)
    assert kept.see_frame(frame(NOW_NS, 1), 1, NOW_NS) == SEEN
    assert kept.frame.capture_ns == NOW_NS - 250 * MS
    assert kept.frame.seen[:2] == (0.3, 0.0)
    assert kept.frame.seen.follower == pytest.approx(FOLLOWER)


@pytest.mark.parametrize("kind", ["odometry", "frame", "sighting"])
def test_after_the_clock_was_set_back_nothing_is_known_and_an_input_still_counts(kind: str) -> None:
    kept, back_ns = by_sensor(), NOW_NS - CLOCK_TOLERANCE_NS - 1
    assert kept.see_frame(frame(NOW_NS, 1), 1, NOW_NS) == SEEN
    kept.take_frame(NOW_NS)
    assert kept.begun
    if kind == "odometry":
        came = kept.see_odometry(odometry(back_ns), 2, back_ns)
    elif kind == "frame":
        came = kept.see_frame(frame(back_ns, 2), 2, back_ns)
    else:
        came = kept.see_sighting(sighting(back_ns, 0.5, 1.0), 2, back_ns)
    assert came == SEEN + SET_BACK
    assert not kept.begun


def test_stamps_that_jump_end_the_tracks_and_leave_odometry() -> None:
    kept = memory()
    kept.see_odometry(odometry(NOW_NS), 1, NOW_NS)
    kept.take_odometry()
    came = []
    for k in range(60):
        now_ns = NOW_NS + k * 10 * MS
        came.append(kept.see_frame(frame(now_ns - (k >= 30) * 500 * MS, k), k, now_ns))
        assert kept.begun == (k > 0 and came[-1] == SEEN)
        kept.take_frame(now_ns)
    assert sorted(came)[-2:] == [SEEN, SEEN + RESTARTED]
    assert came.index(SEEN + RESTARTED) >= 30
    assert len(kept.history) == 1
    assert kept.taken["frames"] == 60


@pytest.mark.parametrize(("apart", "refused"), [(0.0009, {"same_place": 1}), (0.0011, {})])
@pytest.mark.parametrize("angle", [0.0, 0.9, 2.5, -1.8])
def test_two_bodies_within_a_millimetre_are_one(apart: float, refused: dict[str, int], angle: float) -> None:
    kept = memory()
    leader = (FOLLOWER.x + apart * math.cos(angle), FOLLOWER.y + apart * math.sin(angle))
    assert kept.see_frame(frame(NOW_NS, 1, leader), 1, NOW_NS) == (0 if refused else SEEN)
    assert kept.refused == refused


@pytest.mark.parametrize(("rho", "cause"), [(0.0509, "same_place"), (0.05, "bad_range"), (0.02, "bad_range")])
def test_what_a_biased_sensor_sees_in_its_own_place_is_refused(rho: float, cause: str) -> None:
    kept = by_sensor("estimator.range_bias=0.05")
    assert kept.see_sighting(sighting(NOW_NS, rho, 1.0), 1, NOW_NS) == 0
    assert kept.refused == {cause: 1}
    assert kept.see_sighting(sighting(NOW_NS, 0.0511, 1.0), 2, NOW_NS) == SEEN


@pytest.mark.parametrize("sensor", [(0.06, 0.0), (0.0, -0.04), (0.06, -0.04)])
def test_a_sighting_is_put_right_by_bias_and_place_of_the_sensor(sensor: tuple[float, float]) -> None:
    bias = ("estimator.range_bias=0.05", "estimator.bearing_bias=-0.3")
    kept = by_sensor(*bias, f"estimator.sensor_x={sensor[0]}", f"estimator.sensor_y={sensor[1]}")
    for alpha2 in (1.0, 3.0, -3.1):
        assert kept.see_sighting(sighting(NOW_NS, 0.45, alpha2), 1, NOW_NS) == SEEN
        # The body's axes: x ahead, y to the left, and alpha2 the bearing in them.
        x = sensor[0] + 0.4 * math.cos(alpha2 + 0.3)
        y = sensor[1] + 0.4 * math.sin(alpha2 + 0.3)
        assert kept.sighting.rho == pytest.approx(math.hypot(x, y), rel=1e-12)
        assert kept.sighting.alpha2 == pytest.approx(math.atan2(y, x), abs=1e-12)


def test_silence_is_told_of_after_a_while_and_then_with_every_tick() -> None:
    kept = memory()
    assert kept.tick(NOW_NS) == 0
    kept.see_frame(frame(NOW_NS, 1), 1, NOW_NS)
    assert kept.take_frame(NOW_NS) > 0
    assert kept.receipts == ()
    assert kept.tick(NOW_NS + 250 * MS) == 0
    late_ns = NOW_NS + 251 * MS
    length = kept.tick(late_ns)
    told = decode_as(kept.message(length)[0], msg.LeaderEstimate)
    assert (told.status, to_ns(told.computed), to_ns(told.measured)) == (Status.COASTING, late_ns, NOW_NS)
    assert kept.status(late_ns) is Status.COASTING
    assert kept.tick(late_ns + TICK_NS // 2) == 0
    assert kept.tick(late_ns + TICK_NS // 2 + 1) > 0
    assert kept.status(NOW_NS + 1001 * MS) is Status.LOST
