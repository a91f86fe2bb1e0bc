from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation.filters.estimators import ESTIMATORS
from estimation.tracking.tracker import Status
from formation.pose import Motion, Pose, advance
from formation.shape import shape_of
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.lockstep.lockstep import EPOCH_NS
from hil.lockstep.run import run_lockstep
from hil.log.reader import read_log
from hil.nodes.estimator import EstimatorNode, EstimatorState
from hil.nodes.node import Outgoing
from hil.scenario.files import load_scenario
from hil.scenario.schema import EstimatorName
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import TICK, Event, digest
from hil.wire.messages import decode_as, encode, header, to_ns

FRAME_NS = 8_333_333
LATENCY_NS = 30_000_000
NODE = EstimatorNode(load_scenario("turtlebot3"))
BODY_NODE = EstimatorNode(load_scenario("turtlebot3", ["estimator.front_end=body"]))

Timed = tuple[int, Event]


def frame(number: int, bodies: Sequence[tuple[str, Pose]]) -> Timed:
    at_ns = EPOCH_NS + number * FRAME_NS
    return at_ns + LATENCY_NS, Event(topics.RIGID_BODIES, encode(frame_message(at_ns, number, bodies)))


def drive(count: int, seed: int = 1) -> list[Timed]:
    """Frames of two robots side by side on arcs, odometry every fourth frame, both with noise."""
    generator = np.random.default_rng(seed)
    leader, follower, own = Pose(0.3, 0.0, 1.5), Pose(0.7, 0.1, 1.6), Motion(0.1, 0.2)
    events: list[Timed] = []
    for k in range(count):
        at_ns, shake = EPOCH_NS + k * FRAME_NS, generator.standard_normal(8) * ([3e-4] * 4 + [3e-3] * 4)
        if k % 4 == 0:
            sample = odometry_message(at_ns, "follower", follower, Motion(own.v + shake[6], own.u + shake[7]))
            events.append((at_ns, Event("follower/odom", encode(sample))))
        seen = Pose(leader.x + shake[0], leader.y + shake[1], leader.theta + shake[4])
        pose = Pose(follower.x + shake[2], follower.y + shake[3], follower.theta + shake[5])
        events.append(frame(k, [("leader", seen), ("follower", pose)]))
        leader, follower = (
            advance(leader, 0.08, 0.3, FRAME_NS * 1e-9),
            advance(follower, own.v, own.u, FRAME_NS * 1e-9),
        )
    return sorted(events, key=lambda item: item[0])


def fed(
    events: Sequence[Timed], node: EstimatorNode = NODE, state: EstimatorState | None = None
) -> tuple[EstimatorState, list[Outgoing]]:
    state = node.begin(EPOCH_NS) if state is None else state.copy()
    sent: list[Outgoing] = []
    for now_ns, event in events:
        state, out = node.step(state, event, now_ns)
        sent.extend(out)
    return state, sent


def estimates(sent: Sequence[Outgoing]) -> list[msg.LeaderEstimate]:
    return [decode_as(m.payload, msg.LeaderEstimate) for m in sent if m.topic == NODE.topics.estimate]


WARM, _ = fed(drive(60))
WARM_NS = EPOCH_NS + 60 * FRAME_NS + LATENCY_NS


def pair_after(passed_ns: int) -> list[tuple[str, Pose]]:
    passed = passed_ns * 1e-9
    return [
        ("leader", advance(Pose(0.3, 0.0, 1.5), 0.08, 0.3, passed)),
        ("follower", advance(Pose(0.7, 0.1, 1.6), 0.1, 0.2, passed)),
    ]


PAIR = pair_after(60 * FRAME_NS)


@pytest.mark.parametrize("kind", ESTIMATORS)
@pytest.mark.parametrize("front_end", ["world", "body"])
def test_frames_become_estimates_of_their_capture_time(kind: str, front_end: str) -> None:
    overrides = [f"estimator.kind={kind}", f"estimator.front_end={front_end}"]
    node = EstimatorNode(load_scenario("turtlebot3", overrides))
    events = drive(120)
    state, sent = fed(events, node)
    found = estimates(sent)
    captures = [EPOCH_NS + k * FRAME_NS for k in range(120)]
    assert [to_ns(e.header.stamp) for e in found] == captures
    assert [to_ns(e.measured) for e in found] == captures
    assert {to_ns(e.computed) - to_ns(e.header.stamp) for e in found} == {LATENCY_NS}
    assert found[0].status == Status.INITIALISING
    assert found[0].reason
    assert (found[-1].status, found[-1].reason) == (Status.TRACKING, "")
    leader, follower = Pose(0.3, 0.0, 1.5), Pose(0.7, 0.1, 1.6)
    passed = 119 * FRAME_NS * 1e-9
    shape = shape_of(advance(leader, 0.08, 0.3, passed), advance(follower, 0.1, 0.2, passed))
    assert found[-1].rho == pytest.approx(shape.rho, abs=5e-3)
    assert found[-1].v1 == pytest.approx(0.08, abs=0.04)
    assert state.taken == {"frames": 120, "used": 120, "odometry": 30}
    assert not state.refused


def test_every_input_is_receipted_once_in_the_order_of_consumption() -> None:
    events = drive(40)
    broken = (EPOCH_NS + 100_000_001, Event(topics.RIGID_BODIES, b"\x01"))
    events = sorted([*events, broken], key=lambda item: item[0])
    state, sent = fed(events)
    told = [(each.digest, to_ns(each.received)) for e in estimates(sent) for each in e.consumed]
    waiting = [(each.digest % 2**64, each.received_ns) for each in state.receipts]
    expected = [(digest(event.topic, event.payload), now_ns) for now_ns, event in events]
    assert told + waiting == expected


@given(st.sampled_from(NODE.subscribes), st.binary(max_size=300))
@settings(deadline=None, max_examples=200)
def test_no_bytes_on_any_topic_raise_or_move_the_track(topic: str, payload: bytes) -> None:
    for node in (NODE, BODY_NODE):
        after, out = node.step(WARM.copy(), Event(topic, payload), WARM_NS)
        assert out == ()
        assert after.memory.track == WARM.memory.track
        assert sum(after.refused.values()) == 1


@st.composite
def damaged_frames(draw: st.DrawFn) -> bytes:
    payload = bytearray(frame(60, PAIR)[1].payload)
    for place in draw(st.lists(st.integers(4, len(payload) - 1), min_size=1, max_size=8)):
        payload[place] = draw(st.integers(0, 255))
    return bytes(payload)


@cache
def warmed(kind: str, front_end: str) -> tuple[EstimatorNode, EstimatorState]:
    """An estimator of any kind that has followed the leader for half a second."""
    overrides = [f"estimator.kind={kind}", f"estimator.front_end={front_end}"]
    node = EstimatorNode(load_scenario("turtlebot3", overrides))
    return node, fed(drive(60), node)[0]


@given(damaged_frames(), st.sampled_from(list(ESTIMATORS)), st.sampled_from(["world", "body"]))
@settings(deadline=None, max_examples=200)
def test_no_damaged_frame_raises_and_what_leaves_is_finite(payload: bytes, kind: str, front_end: str) -> None:
    node, warm = warmed(kind, front_end)
    for repeats in ([(WARM_NS, Event(topics.RIGID_BODIES, payload))] * 2, [frame(61, PAIR), frame(62, PAIR)]):
        _, sent = fed(repeats, node, warm)
        for found in estimates(sent):
            assert all(map(math.isfinite, (found.rho, found.alpha2, found.v1, found.alpha1, found.u1)))
            assert np.isfinite(found.covariance).all()


@pytest.mark.parametrize("kind", ESTIMATORS)
@pytest.mark.parametrize("front_end", ["world", "body"])
def test_leaders_at_the_end_of_the_world_break_nothing(kind: str, front_end: str) -> None:
    overrides = [f"estimator.kind={kind}", f"estimator.front_end={front_end}"]
    node = EstimatorNode(load_scenario("turtlebot3", overrides))
    spots = [(1e4, -1e4), (-1e4, 1e4), (0.7, 0.152), (1e4, 1e4), (1e-3, 0.0)]
    events = [
        frame(60 + k, [("leader", Pose(*spots[k // 7 % 5], 0.0)), ("follower", PAIR[1][1])])
        for k in range(70)
    ]
    state, sent = fed(events, node)
    assert len(estimates(sent)) == 70
    for found in estimates(sent):
        assert all(map(math.isfinite, (found.rho, found.v1, found.alpha1, found.bound_v1)))
    assert state.taken["frames"] == 70


def wrong_frames() -> list[tuple[str, bytes]]:
    none = msg.Quaternion(x=0.0, y=0.0, z=0.0, w=0.0)
    nan = msg.Point(x=math.nan, y=0.0, z=0.0)
    good = frame_message(WARM_NS, 1, PAIR)
    leader, follower = good.rigidbodies

    def with_leader(pose: msg.Pose) -> bytes:
        body = msg.RigidBody("leader", [], pose)
        return encode(msg.RigidBodies(good.header, 1, [body, follower]))

    pose = leader.pose
    unturned = msg.RigidBody("follower", [], msg.Pose(position=follower.pose.position, orientation=none))
    return [
        ("malformed", b"\x0a\x0b\x0c"),
        ("not_finite", with_leader(msg.Pose(position=nan, orientation=pose.orientation))),
        # A leader may be a single marker; a follower needs its heading.
        ("bad_quaternion", encode(msg.RigidBodies(good.header, 1, [leader, unturned]))),
        ("unknown_body", encode(frame_message(WARM_NS, 1, [("cat", PAIR[0][1])]))),
        ("missing_follower", encode(frame_message(WARM_NS, 1, PAIR[:1]))),
        ("same_place", encode(frame_message(WARM_NS, 1, [("leader", PAIR[1][1]), PAIR[1]]))),
    ]


@pytest.mark.parametrize(("cause", "payload"), wrong_frames())
def test_what_is_refused_is_counted_by_its_cause(cause: str, payload: bytes) -> None:
    state, sent = fed([(WARM_NS, Event(topics.RIGID_BODIES, payload))] * 100, NODE, WARM)
    assert state.refused == {cause: 100}
    assert estimates(sent) == []
    assert state.memory.track == WARM.memory.track


def test_a_stranger_beside_the_pair_is_counted_and_the_pair_is_used() -> None:
    state, sent = fed([frame(60, [*PAIR, ("cat", Pose(1.0, 1.0, 0.0))])], NODE, WARM)
    assert state.refused == {"unknown_body": 1}
    assert len(estimates(sent)) == 1


def test_frames_twice_late_and_too_late_are_told_apart() -> None:
    events = [event for event in drive(60) if event[1].topic == topics.RIGID_BODIES]
    held_back, forgotten = events.pop(50), events.pop(10)
    late = [(WARM_NS, event) for _, event in (held_back, held_back, forgotten)]
    state, _ = fed([*events, *late])
    assert state.refused == {"duplicate": 1, "too_late": 1}
    assert (state.taken["used"], state.taken["late"]) == (59, 2)


@pytest.mark.parametrize(("ahead", "rho"), [(0.0, 1e-9), (0.0, 1e-200), (-0.03125, 0.03125)])
def test_a_leader_sighted_in_the_follower_s_own_place_is_refused(ahead: float, rho: float) -> None:
    """It would have no bearing, and a position without variance, which not every filter survives."""
    changes = ["estimator.kind=ukf-filterpy", "estimator.front_end=body", f"estimator.sensor_x={ahead}"]
    node = EstimatorNode(load_scenario("turtlebot3", changes))
    state = node.begin(EPOCH_NS)
    for number in range(4):
        now_ns = EPOCH_NS + number * FRAME_NS
        sighting = encode(msg.RangeBearing(header(now_ns, "follower"), rho, 0.0))
        state, _ = node.step(state, Event(node.topics.sighting, sighting), now_ns)
    assert state.refused == {"same_place": 4}
    assert not state.memory.begun


def test_a_sighting_needs_the_body_front_end() -> None:
    sighting = encode(msg.RangeBearing(header(EPOCH_NS, "follower"), 0.4, 1.5))
    event = (EPOCH_NS, Event(NODE.topics.sighting, sighting))
    state, sent = fed([event])
    assert state.refused == {"sighting_without_body_front_end": 1}
    state, sent = fed([event], BODY_NODE)
    assert (estimates(sent)[0].rho, estimates(sent)[0].alpha2) == pytest.approx((0.4, 1.5))


@pytest.mark.parametrize("kind", ESTIMATORS)
def test_copies_step_to_the_same_bytes_and_leave_what_they_are_copies_of_alone(kind: str) -> None:
    node, warm = warmed(kind, "world")

    def known() -> tuple[object, ...]:
        memory = warm.memory
        return (
            memory.track,
            memory.history,
            memory.known,
            warm.comparison,
            warm.receipts,
            warm.taken,
            warm.refused,
        )

    before, since_ns = known(), 57 * FRAME_NS + FRAME_NS // 2
    new = frame(60, PAIR)[1]
    late = Event(topics.RIGID_BODIES, encode(frame_message(EPOCH_NS + since_ns, 57, pair_after(since_ns))))
    told = odometry_message(EPOCH_NS + since_ns, "follower", PAIR[1][1], Motion(0.12, 0.1))
    odometry, broken = Event(node.topics.odom, encode(told)), Event(topics.RIGID_BODIES, b"")
    for events in ([new], [late], [odometry, new], [broken, new]):
        first, again = (fed([(WARM_NS, event) for event in events], node, warm) for _ in range(2))
        assert first[1]
        assert first[1] == again[1]
        assert first[0].memory.track == again[0].memory.track != before[0]
        assert known() == before


def test_while_measurements_are_missing_it_says_so_by_itself() -> None:
    state, told = WARM.copy(), []
    for _ in range(30):
        now_ns = max(NODE.due_ns(state), WARM_NS)
        state, out = NODE.step(state, TICK, now_ns + 50_000_000)
        told += [(now_ns - WARM_NS, e.status, e.reason) for e in estimates(out)]
    assert [status for _, status, _ in told] == sorted(status for _, status, _ in told)
    assert {status for _, status, _ in told} == {Status.COASTING, Status.LOST}
    assert all(reason for _, _, reason in told)


def test_diagnostics_name_what_is_missing_and_what_was_counted() -> None:
    begun = NODE.begin(EPOCH_NS)
    before = decode_as(NODE.report(begun, EPOCH_NS).payload, msg.DiagnosticArray).status[0]
    assert (before.level, before.message) == (1, "waiting for mocap: no frame has come on rigid_bodies")
    state, _ = fed([(WARM_NS, Event(topics.RIGID_BODIES, b"?"))], NODE, WARM)
    after = decode_as(NODE.report(state, WARM_NS).payload, msg.DiagnosticArray).status[0]
    values = {value.key: value.value for value in after.values}
    assert (after.level, after.message, after.name) == (0, "ok", "abreast/estimator")
    assert (values["status"], values["taken.frames"], values["refused.malformed"]) == ("tracking", "60", "1")


def test_a_scenario_may_name_every_estimator() -> None:
    assert set(get_args(EstimatorName)) == set(ESTIMATORS)


@pytest.fixture(scope="module")
def rough_inputs(tmp_path_factory: pytest.TempPathFactory) -> list[Timed]:
    """Frames and odometry of a lockstep run with loss and jitter, as they arrived."""
    path = tmp_path_factory.mktemp("rough") / "run.mcap"
    given = ("run.duration_s=4", "run.seed=7", "mocap.loss=0.05", "mocap.jitter_s=0.02")
    run_lockstep(load_scenario("turtlebot3", given), path)
    return [
        (record.log_ns, Event(record.topic, record.payload))
        for record in read_log(path).records([topics.RIGID_BODIES, "follower/odom"])
    ]


@pytest.mark.parametrize(("kind", "front_end"), [("ekf", "body"), ("ukf", "world")])
def test_over_a_whole_log_the_compiled_filter_is_filterpys(
    rough_inputs: list[Timed], kind: str, front_end: str
) -> None:
    # filterpy's filters keep the process noise that they are told.
    given = [f"estimator.front_end={front_end}", "estimator.process_noise=given"]
    nodes = [
        EstimatorNode(load_scenario("turtlebot3", [f"estimator.kind={kind}{suffix}", *given]))
        for suffix in ("", "-filterpy")
    ]
    left, right = (node.begin(EPOCH_NS) for node in nodes)
    compared = 0
    for event in rough_inputs:
        (left, _), (right, _) = (fed([event], node, s) for node, s in zip(nodes, (left, right), strict=True))
        for found, wanted in zip(left.memory.track[-1:], right.memory.track[-1:], strict=True):
            assert (found.verdict, found.settled) == (wanted.verdict, wanted.settled)
            sd = np.sqrt(np.diag(wanted.belief.covariance))
            change = found.belief.covariance - wanted.belief.covariance
            assert np.all(np.abs(found.belief.mean - wanted.belief.mean) <= 1e-9 * sd)
            assert np.all(np.abs(change) <= 1e-9 * np.outer(sd, sd))
            compared += 1
    assert compared > 400
    assert left.taken == right.taken


def test_it_says_which_bodies_it_sees_and_wants_and_finds_axes_of_frames_that_are_refused() -> None:
    """Bodies by other names, then by the right ones with y up, all of them refused."""
    named = [
        msg.RigidBody(name, [], msg.Pose(msg.Point(0.0, 0.0, 0.0), msg.Quaternion(0.0, 0.0, 0.0, 1.0)))
        for name in "12"
    ]
    strangers = Event(topics.RIGID_BODIES, encode(msg.RigidBodies(header(EPOCH_NS, "map"), 0, named)))
    state, _ = fed([(EPOCH_NS, strangers)], NODE, NODE.begin(EPOCH_NS))
    status = decode_as(NODE.report(state, EPOCH_NS).payload, msg.DiagnosticArray).status[0]
    assert status.message == "waiting for mocap: no body 'leader', 'follower' among those seen: '1', '2'"
    assert NODE.findings(state, EPOCH_NS)["bodies"] in status.message
    for k in range(8):
        now_ns = EPOCH_NS + (k + 1) * 250_000_000
        lying = msg.Quaternion(0.0, 0.6, 0.0, 0.8)
        bodies = [
            msg.RigidBody(name, [], msg.Pose(msg.Point(x, 0.1, -0.1), lying))
            for name, x in (("leader", 0.0), ("follower", 0.3))
        ]
        frame = encode(msg.RigidBodies(header(now_ns, "map"), k, bodies))
        state, _ = fed([(now_ns, Event(topics.RIGID_BODIES, frame))], NODE, state)
    assert "y is up" in NODE.findings(state, now_ns)["axes"]
    assert "tilted" in state.refused
