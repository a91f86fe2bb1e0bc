"""Figures of a try, against a robot that is moved through what its driver took."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.faults.fault import Expected
from hil.faults.judgement import Reason, driven_s, motion_of, rolled_m
from hil.faults.notes import Notes, RobotNotes, Rolled, Taken
from hil.faults.robot import Robot

STEP_S = 0.01


def seen(commands: list[tuple[float, float]], until_s: float) -> RobotNotes:
    """What is seen of a robot that takes commands (when, speed) until a time."""
    robot, notes, waiting = Robot(), RobotNotes(), sorted(commands)
    for number in range(round(until_s / STEP_S) + 1):
        now_s = number * STEP_S
        while waiting and waiting[0][0] <= now_s:
            at_s, v = waiting.pop(0)
            robot.tell(v, 0.0)
            notes.taken.append(Taken(at_s, 0.02, v, 0.0))
        robot.move(STEP_S)
        notes.rolled.append(Rolled(now_s, robot.rolled, robot.v))
    return notes


def notes_of(follower: RobotNotes, *stops: float) -> Notes:
    return Notes({"follower": follower, "leader": seen([], 10.0)}, list(stops))


@given(st.lists(st.tuples(st.integers(0, 900), st.sampled_from([0.0, 0.1])), max_size=20))
def test_a_command_holds_until_the_next_one(ticks: list[tuple[int, float]]) -> None:
    """Against the setpoint that is in force, looked at every hundredth of a second."""
    by_time = dict(ticks)
    commands = [(at * STEP_S, v) for at, v in by_time.items()]
    from_s, until_s = 3.0, 10.0
    in_force, last = 0.0, 300
    for number in range(1001):
        in_force = by_time.get(number, in_force)
        if number >= 300 and number < 1000 and in_force:
            last = number + 1
    found = driven_s(seen(commands, until_s), from_s, until_s)
    assert found == pytest.approx(last * STEP_S - from_s, abs=1e-6)


def test_the_way_is_that_to_standstill_with_the_lag() -> None:
    follower = seen([(0.0, 0.1), (2.0, 0.0)], 10.0)
    assert rolled_m(follower, 2.0, 10.0) == pytest.approx(0.01, abs=2e-3)
    assert rolled_m(follower, 1.0, 10.0) == pytest.approx(0.11, abs=2e-3)


def test_one_that_is_never_told_to_stand_runs_away_to_the_end() -> None:
    notes = notes_of(seen([(0.0, 0.1)], 10.0))
    motion = motion_of(notes, Expected({"follower": "fault"}), Reason(4.0))
    assert motion.runaway_s == pytest.approx(6.0)
    assert motion.runaway_m == pytest.approx(0.6, abs=1e-3)
    assert motion.oldest_command_s == 0.02


def test_who_is_to_stand_by_a_stop_is_timed_from_that() -> None:
    notes = notes_of(seen([(0.0, 0.1), (7.1, 0.0)], 10.0), 1.0, 7.0)
    motion = motion_of(notes, Expected({"follower": "stop"}), Reason(4.0))
    assert motion.runaway_s == pytest.approx(0.1)


def test_while_a_fault_lasts_is_only_so_long() -> None:
    notes = notes_of(seen([(0.0, 0.1), (4.15, 0.0), (5.2, 0.1)], 10.0))
    held = Expected({"follower": "fault"}, for_good=False)
    assert motion_of(notes, held, Reason(4.0, 5.0)).runaway_s == pytest.approx(0.15)
    assert motion_of(notes, Expected({}), Reason(4.0, 5.0)).runaway_s == 0.0
