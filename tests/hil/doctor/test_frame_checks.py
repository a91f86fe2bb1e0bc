"""Motion capture that is wrong in one way at a time, in rows; each is named by its check, and by no other."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from formation.pose import Pose
from hil.doctor.evidence import Evidence, Seen
from hil.doctor.frame_checks import frame_checks
from hil.scenario.files import load_scenario

SCENARIO = load_scenario("turtlebot3")
BEGIN_NS = 1_700_000_000_000_000_000
PERIOD_NS = 10_000_000
Change = Callable[[list[Seen]], list[Seen]]


def frames(count: int = 300, period_ns: int = PERIOD_NS) -> list[Seen]:
    """Frames of two robots that stand, with a noise that never repeats, 5 ms old when they come."""
    found = []
    for k in range(count):
        stamp_ns = BEGIN_NS + k * period_ns
        poses = {"leader": Pose(1e-6 * k, 0.5, 0.0), "follower": Pose(0.0, 1e-6 * k, 0.0)}
        found.append(Seen(stamp_ns + 5_000_000, stamp_ns, k, tuple(poses), poses))
    return found


def failed(seen: list[Seen]) -> dict[str, str]:
    checks = list(frame_checks(Evidence(SCENARIO, frames=seen)))
    assert all(bool(each.advice) != each.ok and each.expected for each in checks)
    return {each.name: each.seen for each in checks if not each.ok}


def renamed(seen: list[Seen]) -> list[Seen]:
    return [
        each._replace(
            names=("leader", "2"), poses={"leader": each.poses["leader"], "2": each.poses["follower"]}
        )
        for each in seen
    ]


def late(seen: list[Seen]) -> list[Seen]:
    return [each._replace(at_ns=each.at_ns + (k % 2) * 40_000_000) for k, each in enumerate(seen)]


def hidden(seen: list[Seen]) -> list[Seen]:
    return [
        each._replace(names=("leader",), poses={"leader": each.poses["leader"]}) if k % 5 == 0 else each
        for k, each in enumerate(seen)
    ]


def frozen(seen: list[Seen]) -> list[Seen]:
    return [each._replace(poses={**each.poses, "follower": Pose(0.0, 0.0, 0.0)}) for each in seen]


def test_nothing_is_wrong_with_what_is_right() -> None:
    assert failed(frames()) == {}


@pytest.mark.parametrize(
    ("change", "name", "word"),
    [
        (lambda seen: seen[:3], "frames", "3 frames"),
        (lambda seen: frames(60, 50_000_000), "rate", "20.0 frames"),
        (lambda seen: [each for k, each in enumerate(seen) if k % 10], "loss", "frames lost"),
        (late, "jitter", "20.0 ms"),
        (frozen, "frozen", "follower: the same pose for 3.0 s"),
        (hidden, "tracked", "follower: in 80 %"),
    ],
)
def test_each_thing_that_is_wrong_is_named_alone(change: Change, name: str, word: str) -> None:
    found = failed(change(frames()))
    assert list(found) == [name]
    assert word in found[name]


def test_a_missing_body_is_called_by_its_name_beside_those_that_are_seen() -> None:
    found = failed(renamed(frames()))
    assert found["bodies"] == "no body 'follower' among those seen: '2', 'leader'"
    assert "follower: in 0 %" in found["tracked"]


def test_frames_that_cannot_be_read_are_said() -> None:
    found = Evidence(SCENARIO, frames=frames(), unread={"rigid_bodies": 7})
    first = next(frame_checks(found))
    assert not first.ok
    assert "7 that cannot be read" in first.seen
