"""Groups compared: what differs in their conditions and their metrics, as JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from hil.compare.change import Change, change_of
from hil.compare.conditions import Failure
from hil.compare.differences import Differences, differences_of
from hil.compare.group import RUNS, STOPPED, Group, Spread
from hil.compare.metrics import HEADLINES, goal_of, in_order
from hil.compare.verdict import Verdict, verdict_on
from hil.judge.dotted_figures import bare
from hil.reports.sweep_cells import estimators_of

_MOST_VALUES = 5


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Groups, how their conditions differ (values of each group by key), and which was better."""

    groups: tuple[Group, ...]
    differences: Differences
    verdict: Verdict
    notes: tuple[str, ...]
    failures: tuple[Failure, ...]

    def metrics(self) -> list[str]:
        """Names of all metrics, those that are told first in front."""
        return in_order(set[str]().union(*(group.metrics for group in self.groups)))

    def spread(self, name: str, group: Group) -> Spread | None:
        """Spread of a metric in a group, None where it is not known there."""
        return group.spread(name)

    def change(self, name: str, group: Group) -> Change | None:
        """How a metric changed from the first group."""
        return change_of(name, self.groups[0], group)

    def as_json(self) -> dict[str, Any]:
        """JSON of ``compare``; lists of groups' values are in the order of the groups."""
        return {
            "groups": [
                {
                    "name": group.label,
                    "path": str(group.path),
                    "kind": group.kind,
                    "samples": len(group.samples),
                }
                for group in self.groups
            ],
            "verdict": {"best": self.verdict.best, "text": self.verdict.text},
            "notes": list(self.notes),
            "differences": {key: list(map(list, values)) for key, values in self.differences.items()},
            "metrics": {name: self._metric(name) for name in self.metrics()},
            "failed": [
                {"if": each.condition.text, "group": each.group, "value": each.value, "text": each.text}
                for each in self.failures
            ],
        }

    def _metric(self, name: str) -> dict[str, Any]:
        goal = goal_of(name)
        spreads = [self.spread(name, group) for group in self.groups]
        changes = [self.change(name, group) for group in self.groups[1:]]
        return {
            "better": None if goal is None else str(goal),
            "groups": [None if each is None else asdict(each) for each in spreads],
            "against_first": [None if each is None else asdict(each) for each in changes],
        }


def compared(groups: Sequence[Group], failures: Sequence[Failure] = ()) -> Comparison:
    """Compare at least two groups of one kind."""
    differences = differences_of(groups)
    return Comparison(
        tuple(groups), differences, verdict_on(groups), tuple(_notes(groups, differences)), tuple(failures)
    )


def shortened(values: Sequence[str]) -> str:
    """Values of a condition in a few words."""
    if not values:
        return "–"
    more = f" and {len(values) - _MOST_VALUES} more" if len(values) > _MOST_VALUES else ""
    return ", ".join(values[:_MOST_VALUES]) + more


_NOISE = ("mocap.", "robot.", "leader.", "run.duration_s", "duration_s")


def _notes(groups: Sequence[Group], differences: Differences) -> list[str]:
    notes = [note for group in groups for note in group.notes]
    notes += _gone(groups)
    for group in groups:
        if stopped := sum(STOPPED in sample.facts for sample in group.samples):
            count = f"{stopped} of {len(group.samples)} runs"
            notes.append(f"of {group.label} {count} ended by a stop: what is judged of it may be its start")
    if len({tuple(sample.runs for sample in group.samples) for group in groups if group.kind != RUNS}) > 1:
        notes.append(
            "they did not do as many runs of each cell: counts are compared as shares of these, and errors "
            "of few runs scatter; sweep both with the same --runs"
        )
    harder = [key for key in differences if key.startswith(_NOISE)]
    if harder:
        named = ", ".join(harder[:_MOST_VALUES]) + (" and more" if len(harder) > _MOST_VALUES else "")
        notes.append(
            f"they did not run under the same conditions ({named}), so that metrics differ by that too"
        )
    if groups[0].kind == RUNS and any(len(group.samples) == 1 for group in groups):
        notes.append("the spread of a single run is not known: name folders of several runs to have it")
    judged = (each for group in groups if group.kind == RUNS for each in group.samples if each.metrics)
    if any(not each.facts for each in judged):
        notes.append("of some runs the log is gone, and with it their scenario and version")
    foils = dict.fromkeys(name for group in groups for name in _foils(group))
    if foils:
        notes.append(f"cells of the foils ({', '.join(foils)}) have no part in metrics and verdict")
    if left_out := [group for group in groups if len(group.samples) < _asked(group)]:
        names = ", ".join(group.label for group in left_out)
        notes.append(f"cells of {names} that not all of them have are left out")
    return notes


def _gone(groups: Sequence[Group]) -> Iterator[str]:
    """Of which groups samples lack the first headline that is known, as they broke down."""
    known = in_order(set[str]().union(*(group.known for group in groups)))
    name = next((each for each in known if bare(each) in HEADLINES), None)
    if name is None:
        return
    for group in groups:
        if lacking := sum(not sample.knows(name) for sample in group.samples):
            what = "runs" if group.kind == RUNS else "cells"
            yield f"of {group.label} {lacking} of {len(group.samples)} {what} know no {name}"


def _foils(sweep: Group) -> list[str]:
    return estimators_of(sweep.tree.get("cells", ()))[1]


def _asked(sweep: Group) -> int:
    """Cells of a sweep's estimators but for foils; 0 for runs."""
    cells = sweep.tree.get("cells", ())
    return sum(str(cell["estimator"]) not in _foils(sweep) for cell in cells)
