"""What the notes of the observer say of one try, in figures."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass

from hil.faults.fault import Expected
from hil.faults.notes import Notes, RobotNotes


@dataclass(frozen=True, slots=True)
class Reason:
    """When the fault began and ended [s, monotonic]; it never ended where that is infinite."""

    from_s: float
    until_s: float = math.inf


@dataclass(frozen=True, slots=True)
class Motion:
    """How long [s] and how far [m] robots that were to stand went on, and the oldest command [s]."""

    runaway_s: float = 0.0
    runaway_m: float = 0.0
    oldest_command_s: float = 0.0


def motion_of(notes: Notes, expected: Expected, reason: Reason) -> Motion:
    """The worst of all robots that were to stand; the age is of all commands to any that made it move."""
    until_s = notes.end_s if expected.for_good else min(notes.end_s, reason.until_s)
    runaway_s = runaway_m = 0.0
    for robot, since in expected.stands.items():
        from_s = reason.from_s if since == "fault" else stop_after(notes, reason.from_s)
        seen = notes.of(robot)
        runaway_s = max(runaway_s, driven_s(seen, from_s, until_s))
        runaway_m = max(runaway_m, rolled_m(seen, from_s, until_s))
    ages = [each.age_s for seen in notes.robots.values() for each in seen.taken if each.drives]
    return Motion(runaway_s, runaway_m, max(ages, default=0.0))


def stop_after(notes: Notes, from_s: float) -> float:
    """When somebody first said stop after a moment; that moment where nobody did."""
    return next((at_s for at_s in notes.stops if at_s >= from_s), from_s)


def driven_s(seen: RobotNotes, from_s: float, until_s: float) -> float:
    """How long after ``from_s`` a robot was last told to move: a command holds until the next one comes.

    So one that is never followed by a standstill drives the robot to the end.
    """
    last_s = from_s
    for at, taken in enumerate(seen.taken):
        if taken.at_s >= until_s or not taken.drives:
            continue
        ends_s = seen.taken[at + 1].at_s if at + 1 < len(seen.taken) else until_s
        last_s = max(last_s, min(ends_s, until_s))
    return last_s - from_s


def rolled_m(seen: RobotNotes, from_s: float, until_s: float) -> float:
    """The way that a robot rolled between two moments."""
    return max(0.0, _way(seen, until_s) - _way(seen, from_s))


def _way(seen: RobotNotes, at_s: float) -> float:
    """How far it had rolled, between notes by its speed at the one before."""
    at = bisect.bisect_right(seen.rolled, at_s, key=lambda each: each.at_s) - 1
    if at < 0:
        return 0.0
    before = seen.rolled[at]
    if at + 1 == len(seen.rolled):
        return before.way
    return min(before.way + abs(before.v) * (at_s - before.at_s), seen.rolled[at + 1].way)
