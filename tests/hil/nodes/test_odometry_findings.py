"""What is found out about odometry has a name and says what is used instead."""

from __future__ import annotations

import pytest

from estimation.own_motion.odometry_check import UNCHECKED, OdometryCheck, OdometrySample
from formation.pose import Motion, Pose
from formation.ring import Ring
from hil.nodes.estimator_desk import NOTHING_KNOWN
from hil.nodes.estimator_memory import rules_of
from hil.nodes.odometry_findings import odometry_findings
from hil.scenario.files import load_scenario
from tests.estimation.own_motion.judged_robot import EPOCH_NS, JudgedRobot, Lie, wavy

SECOND = 1_000_000_000
RULES = rules_of(load_scenario("turtlebot3", ["estimator.own_motion=auto"]))
HEARD = UNCHECKED._replace(
    heard=True, last=OdometrySample(EPOCH_NS, 0.1, 0.2, False, Pose(0.0, 0.0, 0.0)), period=0.033
)


def found(check: OdometryCheck, after_s: float = 0.1, source: str = "auto") -> dict[str, str]:
    rules = (
        RULES
        if source == "auto"
        else rules_of(load_scenario("turtlebot3", [f"estimator.own_motion={source}"]))
    )
    known = NOTHING_KNOWN._replace(odometry_check=check, own=Ring(0, 3), watched_ns=EPOCH_NS)
    return odometry_findings(known, rules, EPOCH_NS + round(after_s * SECOND))


def test_of_healthy_odometry_nothing_is_said() -> None:
    assert found(HEARD) == {}
    assert found(JudgedRobot().after(12.0), 12.0) == {}


@pytest.mark.parametrize(
    ("period", "after_s", "silent"), [(0.033, 0.49, False), (0.033, 0.51, True), (0.5, 2.4, False)]
)
def test_silence_is_named_after_half_a_second_or_five_periods(
    period: float, after_s: float, silent: bool
) -> None:
    assert ("odometry_silent" in found(HEARD._replace(period=period), after_s)) is silent


def test_odometry_that_never_comes_is_missed_after_a_second() -> None:
    assert found(UNCHECKED, 0.9) == {}
    assert "no odometry has come" in found(UNCHECKED, 1.1)["odometry_silent"]


def test_numbers_that_are_none_are_named_whatever_the_source() -> None:
    bad = HEARD._replace(bad_ns=EPOCH_NS + 3 * SECOND)
    for source in ("auto", "odometry"):
        assert set(found(bad, 3.5, source)) == {"odometry_not_finite"}
    assert set(found(bad, 4.5)) == {"odometry_silent"}


@pytest.mark.parametrize(
    ("lie", "words"),
    [
        (
            lambda t, motion, pose: (Motion(0.0, 0.0), None),
            ["speed of zero", "turn rate of zero", "mocap track"],
        ),
        (lambda t, motion, pose: (Motion(0.0, 0.0), pose), ["speed of zero", "its pose is right"]),
        (lambda t, motion, pose: (Motion(motion.v, -motion.u), pose), ["turn rate reversed"]),
        (lambda t, motion, pose: (Motion(1.5 * motion.v, motion.u), None), ["speed scaled by 1.5"]),
        (
            lambda t, motion, pose: (
                Motion(*(each / (1.0 - 0.5 * abs(wavy(t).u)) for each in motion)),
                None,
            ),
            ["slips away"],
        ),
    ],
    ids=["zero", "zero beside a pose", "reversed", "scaled", "slip"],
)  # fmt: skip
def test_a_contradiction_says_what_is_wrong(lie: Lie, words: list[str]) -> None:
    robot = JudgedRobot()
    text = found(robot.after(14.0, lie), 14.0)["odometry_contradicts"]
    assert all(word in text for word in words), text


def test_a_delay_says_how_long() -> None:
    assert "late by 0.30 s" in found(JudgedRobot(late_s=0.3).after(12.0), 12.0)["odometry_late"]
    ahead = HEARD._replace(late=-0.25)
    assert "ahead of the motion, as commands are, by 0.25 s" in found(ahead)["odometry_late"]


def test_a_reset_is_told_for_a_while() -> None:
    reset = HEARD._replace(resets=2, reset_ns=EPOCH_NS)
    assert "2 times" in found(reset)["odometry_reset"]
    late = reset._replace(last=HEARD.last._replace(stamp_ns=EPOCH_NS + 100 * SECOND))
    assert found(late, 100.0) == {}


def test_without_a_track_it_is_said_that_there_is_none() -> None:
    known = NOTHING_KNOWN._replace(odometry_check=HEARD, watched_ns=EPOCH_NS)
    text = odometry_findings(known, RULES, EPOCH_NS + 10 * SECOND)["odometry_silent"]
    assert "no mocap track" in text
