from __future__ import annotations

import pytest

from hil.nodes.findings import ADVICE
from hil.nodes.listeners import listener_findings

TWIST, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"


@pytest.mark.parametrize(
    ("heard_as", "expected"),
    [
        ([], {"deaf_robot"}),
        ([STAMPED], set[str]()),
        ([STAMPED, TWIST], set[str]()),
        ([TWIST, TWIST], {"command_type"}),
    ],
)
def test_nobody_and_another_type_are_told_apart(heard_as: list[str], expected: set[str]) -> None:
    found = listener_findings("/tb3/cmd_vel", STAMPED, heard_as)
    assert set(found) == expected
    assert found.keys() <= ADVICE.keys()
    assert all("/tb3/cmd_vel" in text for text in found.values())
