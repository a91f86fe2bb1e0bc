"""Frames as messages: who is called what, who is in them, and by which axes."""

from __future__ import annotations

import pytest

from hil.bridge.body_frames import frame_message, known_as
from hil.bridge.seen_frame import SeenBody, SeenFrame
from hil.scenario.lab import SourceSection
from hil.wire.messages import to_ns

NAN = float("nan")
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
T0 = 1_700_000_000_000_000_123


def bodies(*named: tuple[str, str]) -> list[SeenBody]:
    return [SeenBody(name, number, (0.0, 0.0, 0.0), UPRIGHT) for name, number in named]


@pytest.mark.parametrize(
    ("wanted", "called"),
    [
        (["leader", "follower"], ["Robot A", "Robot B"]),
        (["Robot A", "2"], ["Robot A", "2"]),
        (["2", "1"], ["1", "2"]),
        (["Robot A", "1"], ["Robot A", "Robot B"]),
    ],
)
def test_name_and_streaming_id_both_count(wanted: list[str], called: list[str]) -> None:
    assert known_as(bodies(("Robot A", "1"), ("Robot B", "2")), wanted) == called


def test_a_body_that_has_an_id_as_its_name_goes_before_one_that_has_it_as_its_id() -> None:
    assert known_as(bodies(("2", "1"), ("Robot B", "2")), ["2", "leader"]) == ["2", "Robot B"]


def test_what_is_not_seen_is_left_out_and_what_has_no_orientation_gets_zeros() -> None:
    frame = SeenFrame(
        2**32 + 5,
        T0,
        T0,
        (
            SeenBody("lost", "1", (1.0, 1.0, 1.0), UPRIGHT, tracked=False),
            SeenBody("nowhere", "2", (NAN, 1.0, 1.0), UPRIGHT),
            SeenBody("marker", "3", (1.0, 2.0, 3.0), (NAN, NAN, NAN, NAN)),
            SeenBody("whole", "4", (4.0, 5.0, 6.0), (0.0, 0.6, 0.0, 0.8)),
        ),
    )
    told = frame_message(frame, ["lost", "nowhere", "marker", "whole"], "y", SourceSection())
    assert to_ns(told.header.stamp) == T0
    assert told.frame_number == 5
    poses = {body.rigid_body_name: (body.pose.position, body.pose.orientation) for body in told.rigidbodies}
    assert list(poses) == ["marker", "whole"]
    at, turned = poses["marker"]
    assert (at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w) == (1.0, -3.0, 2.0, 0.0, 0.0, 0.0, 0.0)
    at, turned = poses["whole"]
    assert (at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w) == (4.0, -6.0, 5.0, 0.0, 0.0, 0.6, 0.8)
