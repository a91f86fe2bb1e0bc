"""What the observer writes down, a line of words for each thing, and how it is read again."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

_TAKEN, _ROLLED, _STOP = "taken", "rolled", "stop"


class Taken(NamedTuple):
    """A command that a driver took: when [s, monotonic], its age by its stamp [s], its motion."""

    at_s: float
    age_s: float
    v: float
    u: float

    @property
    def drives(self) -> bool:
        """Whether the robot is to move by it."""
        return self.v != 0.0 or self.u != 0.0


class Rolled(NamedTuple):
    """How far a robot had rolled [m], and how fast it was [m/s], at a time [s, monotonic]."""

    at_s: float
    way: float
    v: float


@dataclass(slots=True)
class RobotNotes:
    """What was seen of one robot, in order of time."""

    taken: list[Taken] = field(default_factory=list)
    rolled: list[Rolled] = field(default_factory=list)


@dataclass(slots=True)
class Notes:
    """What was seen of all robots by name, and when somebody said stop [s, monotonic]."""

    robots: dict[str, RobotNotes] = field(default_factory=dict)
    stops: list[float] = field(default_factory=list)

    def of(self, robot: str) -> RobotNotes:
        """The notes of a robot, empty where nothing was seen of it."""
        return self.robots.setdefault(robot, RobotNotes())

    @property
    def end_s(self) -> float:
        """When something was noted last, minus infinity for never."""
        lasts = [each.rolled[-1].at_s for each in self.robots.values() if each.rolled]
        return max(lasts, default=float("-inf"))


def taken_line(robot: str, taken: Taken) -> str:
    """A command as a line."""
    return f"{_TAKEN} {robot} {taken.at_s!r} {taken.age_s!r} {taken.v!r} {taken.u!r}\n"


def rolled_line(robot: str, rolled: Rolled) -> str:
    """A way rolled as a line."""
    return f"{_ROLLED} {robot} {rolled.at_s!r} {rolled.way!r} {rolled.v!r}\n"


def stop_line(at_s: float) -> str:
    """That somebody said stop, as a line."""
    return f"{_STOP} {at_s!r}\n"


def read_lines(lines: Iterable[str], notes: Notes) -> Notes:
    """Take lines into notes; one that is cut off in the middle is left out."""
    for line in lines:
        if not line.endswith("\n"):
            continue
        kind, *words = line.split()
        if kind == _TAKEN:
            notes.of(words[0]).taken.append(Taken(*map(float, words[1:])))
        elif kind == _ROLLED:
            notes.of(words[0]).rolled.append(Rolled(*map(float, words[1:])))
        elif kind == _STOP:
            notes.stops.append(float(words[0]))
    return notes


def read_notes(path: Path) -> Notes:
    """The notes in a file, which may still be written to; none where there is no file."""
    if not path.exists():
        return Notes()
    with path.open(encoding="utf-8") as lines:
        return read_lines(lines, Notes())
