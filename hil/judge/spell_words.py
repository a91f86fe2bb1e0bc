"""What a bad spell was, in words: its causes, and the line of it that a person reads."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

FRAMES, STATUS, STOOD, OUTSIDE, ODOMETRY = "frames", "status", "stood", "outside", "odometry"
_KINDS = (FRAMES, STATUS, STOOD, OUTSIDE, ODOMETRY)
_STATUSES = {"INITIALISING": "re-acquiring", "REJECTING": "refusing frames"}
MOST_LINES = 3
"""Of spells in a terminal; more are in the report."""


@dataclass(frozen=True, slots=True)
class Bad:
    """What was bad from when to when [s]: its kind, what of it, and in how many frames or messages."""

    kind: str
    what: str
    from_s: float
    to_s: float
    count: int


def causes_of(bad: Sequence[Bad]) -> list[str]:
    """All that was bad in a spell, each kind once, in words with times of the run."""
    in_order = sorted(bad, key=lambda each: (_KINDS.index(each.kind), each.from_s, each.what))
    causes: list[str] = []
    for kind, group in groupby(in_order, key=lambda each: each.kind):
        causes += _WORDS[kind](list(group))
    return causes


def spell_line(spell: Mapping[str, Any]) -> str:
    """A spell of a summary in one line."""
    return f"{times_of(spell)}: {spell_told(spell)}"


def spell_told(spell: Mapping[str, Any]) -> str:
    """What was bad in a spell, and how far off the estimates were."""
    worst = [_off(name, each) for name, each in sorted(spell.get("worst", {}).items())]
    off = [f"off while tracking by up to {', '.join(worst)}"] if worst else []
    return "; ".join([*spell["causes"], *off])


def times_of(spell: Mapping[str, Any]) -> str:
    """From when to when a spell was, in words."""
    return _span(spell["from_s"], spell["to_s"])


def longest_first(spells: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Spells in the order in which they matter."""
    return sorted(spells, key=lambda spell: (spell["from_s"] - spell["to_s"], spell["from_s"]))


def spell_lines(summary: Mapping[str, Any]) -> Iterator[str]:
    """The longest spells of a summary, a line each, and how many more there are."""
    spells = longest_first(summary.get("spells", []))
    yield from map(spell_line, spells[:MOST_LINES])
    if len(spells) > MOST_LINES:
        yield f"and {len(spells) - MOST_LINES} more bad spells, shorter ones, in the report"


def said_by_spells(summary: Mapping[str, Any], name: str) -> int:
    """How many of the frames, estimates or commands that a summary counts as bad its spells account for."""
    return sum(spell[name] for spell in summary.get("spells", []))


def _silences(bad: Sequence[Bad]) -> Iterator[str]:
    lost = sum(each.count for each in bad)
    told = f" ({lost} lost)" if lost else ""
    whole = sum(each.to_s - each.from_s for each in bad)
    again = f" {len(bad)} times," if len(bad) > 1 else ""
    in_all = " in all" if len(bad) > 1 else ""
    used = "" if lost else " used"
    yield f"no frame{used}{again} for {_length(whole)}{in_all}{told}"


def _statuses(bad: Sequence[Bad]) -> Iterator[str]:
    told = []
    for name in dict.fromkeys(each.what for each in bad):
        own = [each for each in bad if each.what == name]
        told.append(f"{_STATUSES.get(name, name.lower())} {_during(own)}")
    yield ", ".join(told)


def _stops(bad: Sequence[Bad]) -> Iterator[str]:
    reasons = ", ".join(dict.fromkeys(each.what for each in bad))
    yield f"told to stand {_during(_joined(bad))} ({reasons})"


def _errors(bad: Sequence[Bad]) -> Iterator[str]:
    for what in dict.fromkeys(each.what for each in bad):
        count = sum(each.count for each in bad if each.what == what)
        yield f"{what} in {count} {'estimate' if count == 1 else 'estimates'}"


def _findings(bad: Sequence[Bad]) -> Iterator[str]:
    for name in dict.fromkeys(each.what for each in bad):
        during = _during([each for each in bad if each.what == name])
        yield f"{name.replace('_', ' ')} {during}"


_WORDS = {FRAMES: _silences, STATUS: _statuses, STOOD: _stops, OUTSIDE: _errors, ODOMETRY: _findings}


def _joined(bad: Sequence[Bad]) -> list[Bad]:
    """What goes on for another reason as one."""
    joined: list[Bad] = []
    for each in bad:
        if joined and each.from_s <= joined[-1].to_s:
            last = joined.pop()
            each = Bad(each.kind, each.what, last.from_s, each.to_s, last.count + each.count)
        joined.append(each)
    return joined


def _during(bad: Sequence[Bad]) -> str:
    if len(bad) == 1:
        return _span(bad[0].from_s, bad[0].to_s)
    whole = sum(each.to_s - each.from_s for each in bad)
    between = _span(bad[0].from_s, bad[-1].to_s).replace(" to ", " and ")
    return f"{len(bad)} times between {between}, {_length(whole)} in all"


def _span(from_s: float, to_s: float) -> str:
    """Times with as many digits as their distance wants."""
    digits = 1 if to_s - from_s >= 1.0 else 2
    return f"{from_s:.{digits}f} to {to_s:.{digits}f} s"


def _length(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds >= 1.0 else f"{seconds:.2f} s"


def _off(name: str, worst: Mapping[str, float]) -> str:
    told = f"{1e3 * worst['error']:.1f} mm/s" if name == "v1" else f"{math.degrees(worst['error']):.1f} deg"
    return f"{name} {told} at {worst['at_s']:.2f} s"
