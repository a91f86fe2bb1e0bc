"""When a frame was captured, by its stamp or by its way."""

from __future__ import annotations

import pytest

from hil.nodes.capture_time import captured_ns
from hil.scenario.files import load_scenario

MS = 1_000_000
NOW_NS = 1_700_000_000_000_000_000


@pytest.mark.parametrize(
    ("overrides", "stamp_ns", "expected_ns"),
    [
        ([], NOW_NS - 30 * MS, NOW_NS - 30 * MS),
        (["estimator.stamp_offset_s=0.02"], NOW_NS - 30 * MS, NOW_NS - 50 * MS),
        ([], NOW_NS - 300_000 * MS, NOW_NS),
        ([], 0, NOW_NS),
        (["estimator.clock=estimated", "estimator.transport_latency_s=0.04"], NOW_NS, NOW_NS - 40 * MS),
    ],
    ids=["trusted", "late stamps", "another clock", "none", "estimated"],
)
def test_it_is_told_by_what_can_be_known(overrides: list[str], stamp_ns: int, expected_ns: int) -> None:
    given = load_scenario("turtlebot3", overrides).estimator
    assert captured_ns(given, stamp_ns, NOW_NS) == expected_ns
