from __future__ import annotations

import math

import pytest

from formation.pose import Motion, Pose
from hil.emulator.lab_messages import odometry_message
from hil.nodes.at_rest import STILL_U, STILL_V, own_motion, stands
from hil.wire.messages import encode


@pytest.mark.parametrize(
    ("v", "u", "still"),
    [
        (0.0, 0.0, True),
        (-0.9 * STILL_V, 0.9 * STILL_U, True),
        (-STILL_V, 0.0, False),
        (0.0, STILL_U, False),
        (math.nan, 0.0, False),
    ],
)
def test_a_robot_stands_below_what_wheels_say_of_one_that_does(v: float, u: float, still: bool) -> None:
    assert stands(Motion(v, u)) == still


def test_odometry_that_says_nothing_is_no_motion() -> None:
    def said(v: float) -> bytes:
        return encode(odometry_message(5, "leader", Pose(0.0, 0.0, 0.0), Motion(v, 0.2)))

    assert own_motion(said(0.1)) == Motion(0.1, 0.2)
    assert own_motion(said(math.nan)) is None
    assert own_motion(said(0.1)[:-9]) is None
    assert own_motion(b"") is None
