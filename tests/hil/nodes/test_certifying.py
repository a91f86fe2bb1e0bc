from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from formation.angles import wrap
from formation.pose import Motion, Pose, advance
from formation.shape import shape_of
from hil.emulator.lab_messages import frame_message, odometry_message
from hil.errors import UsageError
from hil.lockstep.lockstep import EPOCH_NS
from hil.nodes.estimator import EstimatorNode
from hil.scenario.certify import CERTIFY
from hil.scenario.files import load_scenario
from hil.wire import message_types as msg
from hil.wire import topics
from hil.wire.events import Event
from hil.wire.messages import decode_as, encode, header

FRAME_NS = 8_333_333
FINE = tuple(
    f"estimator.{key}" for key in ("sigma_range=5e-4", "sigma_bearing=2e-3", "sigma_v2=5e-4", "sigma_u2=2e-3")
)
BODY = ("estimator.front_end=body", *FINE, CERTIFY)
LEADER, FOLLOWER = Motion(0.08, 0.3), Motion(0.1, 0.3)
Timed = tuple[int, Event]


def poses(number: int) -> tuple[Pose, Pose]:
    passed = number * FRAME_NS * 1e-9
    return (
        advance(Pose(0.3, 0.0, 1.5), LEADER.v, LEADER.u, passed),
        advance(Pose(0.5, 0.0, 1.5), FOLLOWER.v, FOLLOWER.u, passed),
    )


def frame(number: int, aside: float = 0.0) -> Timed:
    leader, follower = poses(number)
    seen = [("leader", Pose(leader.x + aside, leader.y, leader.theta)), ("follower", follower)]
    at_ns = EPOCH_NS + number * FRAME_NS
    return at_ns + 1, Event(topics.RIGID_BODIES, encode(frame_message(at_ns, number, seen)))


def odometry(number: int) -> Timed:
    at_ns = EPOCH_NS + number * FRAME_NS
    return at_ns, Event("follower/odom", encode(odometry_message(at_ns, "follower", Pose(0, 0, 0), FOLLOWER)))


def sighting(number: int) -> Timed:
    shape, at_ns = shape_of(*poses(number)), EPOCH_NS + number * FRAME_NS
    message = msg.RangeBearing(header(at_ns, "follower"), shape.rho, shape.alpha2)
    return at_ns + 1, Event("follower/leader_sighting", encode(message))


def certified(events: Sequence[Timed], *overrides: str) -> list[msg.CertifiedEstimate]:
    node = EstimatorNode(load_scenario("turtlebot3", overrides))
    state, found = node.begin(EPOCH_NS), []
    for now_ns, event in events:
        state, sent = node.step(state, event, now_ns)
        told = [message for message in sent if message.topic == node.topics.certified]
        found += [decode_as(message.payload, msg.CertifiedEstimate) for message in told]
    return found


def test_a_frame_that_is_not_believed_certifies_nothing_and_spoils_nothing() -> None:
    events = [odometry(0), *(frame(number, 0.05 * (number == 80)) for number in range(82))]
    found = certified(events, CERTIFY)
    assert found[0].failed == "gap"
    assert [each.failed for each in found[1:]] == [""] * 79 + ["unseen", ""]
    assert math.isnan(found[80].radius_v1)
    assert found[80].measurements == 0
    assert found[81].radius_v1 == pytest.approx(found[79].radius_v1, rel=0.1)
    assert found[81].radius_alpha1 == pytest.approx(found[79].radius_alpha1, rel=0.1)


def test_late_frames_are_taken_in_where_they_belong() -> None:
    numbers = list(range(90))
    late = [*numbers[:80], 82, 81, 80, *numbers[83:]]
    now_ns = frame(90)[0]
    in_order, swapped = (
        certified([odometry(0), *((now_ns, frame(number)[1]) for number in order)], CERTIFY)
        for order in (numbers, late)
    )
    assert in_order[-1] == swapped[-1]


def test_fine_sightings_and_odometry_certify_too() -> None:
    events = sorted(each for number in range(150) for each in (odometry(number), sighting(number)))
    found = certified(events, *BODY)
    assert {each.failed for each in found[1:]} == {""}
    leader, follower = poses(149)
    assert abs(found[-1].v1 - LEADER.v) <= found[-1].radius_v1 < 0.05
    error = wrap(found[-1].alpha1 - shape_of(leader, follower).alpha1)
    assert abs(error) <= found[-1].radius_alpha1 < 0.6


def test_without_being_asked_nothing_is_certified() -> None:
    assert certified([odometry(0), *map(frame, range(10))]) == []


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (BODY[:1], r"uncertain by 0\.\d+ m/s at 0\.2 m, expected less than leader\.k_v = 0\.1 m/s"),
        ((*BODY, "estimator.input_lag_s=0.1"), "estimator.input_lag_s is 0.1, expected 0"),
    ],
)
def test_a_body_front_end_that_can_guarantee_nothing_is_refused(overrides: Sequence[str], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        certified([], *overrides, CERTIFY)
