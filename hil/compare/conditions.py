"""Conditions of ``--fail-if``: on a metric's ratio to that of the first group, its change, or its value."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from hil.compare.change import change_of, twin_samples
from hil.compare.group import SWEEP, Group, Spread
from hil.compare.metrics import shown, unit_of
from hil.errors import UsageError

_FORM = re.compile(
    r"\s*(?:(?P<what>\w+)\s*\(\s*(?P<inner>[^\s()<>=]+)\s*\)|(?P<name>[^\s()<>=]+))"
    r"\s*(?P<sign><=|>=|<|>)\s*(?P<limit>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<percent>%?)\s*"
)
_SIGNS: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
RATIO, CHANGE, VALUE = "ratio", "change", "value"
_EXPECTED = (
    'expected like "estimation.rmse.v1 > 1.1" (its ratio to that of the first), '
    '"change(NAME) > 0.001" or "value(NAME) > 0.002" in SI units'
)


@dataclass(frozen=True, slots=True)
class Condition:
    """A parsed ``--fail-if``: ``what`` (ratio, change or value) of a metric, a sign, a limit."""

    text: str
    what: str
    name: str
    sign: str
    limit: float

    def holds(self, value: float) -> bool:
        """Whether a value meets it, which is to fail."""
        return _SIGNS[self.sign](value, self.limit)


@dataclass(frozen=True, slots=True)
class Failure:
    """A condition that a group meets: ``value`` is what it met it with, None for a metric that is gone."""

    condition: Condition
    group: str
    value: float | None
    text: str


def parsed_condition(text: str) -> Condition:
    """The condition that a text states. Raises :class:`UsageError` for one that states none."""
    match = _FORM.fullmatch(text)
    if match is None:
        raise UsageError(f"--fail-if {text!r}: {_EXPECTED}")
    what = match["what"] or RATIO
    if what not in (RATIO, CHANGE, VALUE):
        raise UsageError(f"--fail-if {text!r}: {what!r} is none of ratio, change, value; {_EXPECTED}")
    limit = float(match["limit"])
    if match["percent"]:
        if what != RATIO:
            raise UsageError(f"--fail-if {text!r}: a {what} takes no %; {_EXPECTED}")
        limit /= 100.0
    return Condition(text.strip(), what, match["inner"] or match["name"], match["sign"], limit)


def failures_of(conditions: Sequence[Condition], groups: Sequence[Group]) -> list[Failure]:
    """What groups other than the first fail by, in the order of the conditions.

    Raises :class:`UsageError` for a metric that no group knows, and for a ratio that says nothing.
    """
    known = set[str]().union(*(group.known for group in groups))
    for condition in conditions:
        if condition.name not in known:
            near = get_close_matches(condition.name, sorted(known), n=1, cutoff=0.0)
            hint = f"; the nearest is {near[0]}" if near else ""
            raise UsageError(f"--fail-if {condition.text!r}: no metric {condition.name!r}{hint}")
    found = (_failure(condition, groups[0], other) for condition in conditions for other in groups[1:])
    return [failure for failure in found if failure is not None]


def _failure(condition: Condition, first: Group, other: Group) -> Failure | None:
    name = condition.name
    if (lost := _lost(name, first, other)) is not None:
        return Failure(condition, other.label, None, lost)
    if not other.values(name) and not other.known & {name}:
        return Failure(condition, other.label, None, f"{name} is not known in {other.label} any more")
    if condition.what == VALUE and other.values(name):
        value = Spread.of(other.values(name)).median
        told = f"{name} is {value:.6g}"
        return _told(condition, other, value, told)
    change = change_of(name, first, other)
    if change is None:
        raise UsageError(
            f"--fail-if {condition.text!r}: {first.label} does not know {name}; use value({name}), or "
            "compare with what does"
        )
    if condition.what == RATIO and change.ratio is None:
        raise UsageError(
            f"--fail-if {condition.text!r}: {name} may be negative, so that a ratio says nothing; "
            f"use change({name})"
        )
    old, new = (Spread.of(group.values(name)).median for group in (first, other))
    unit = f" {unit_of(name)[0]}".rstrip()
    was = f"{shown(name, new)}{unit} in {other.label}, {shown(name, old)}{unit} in {first.label}"
    if condition.what == CHANGE:
        return _told(
            condition, other, change.difference, f"{name} changed by {change.difference:+.6g} ({was})"
        )
    ratio = change.ratio or 0.0
    return _told(condition, other, ratio, f"{name} is {ratio:.4g} times the first ({was})")


def _lost(name: str, first: Group, other: Group) -> str | None:
    """That a metric of the first group is gone from samples of another, in words; None where it is not."""
    twins = twin_samples(first, other)
    gone = sum(old.knows(name) and not new.knows(name) for old, new in twins)
    what = "cells" if first.kind == SWEEP else "runs"
    if gone:
        return f"{name} is not known in {gone} of {len(twins)} {what} of {other.label} any more"
    share, before = other.share_that_knows(name), first.share_that_knows(name)
    if twins or share >= before:
        return None
    return (
        f"{name} is known in {100.0 * share:.0f} % of the {what} of {other.label} instead of "
        f"{100.0 * before:.0f} %"
    )


def _told(condition: Condition, other: Group, value: float, text: str) -> Failure | None:
    if not condition.holds(value):
        return None
    return Failure(condition, other.label, value, f"{other.label}: {text}, fails if {condition.text}")
