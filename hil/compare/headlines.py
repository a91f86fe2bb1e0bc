"""By which metrics a verdict goes: errors of the estimates, and how well the formation was kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hil.compare.differences import are_of_the_estimator, are_of_the_law, differences_of
from hil.compare.group import Group
from hil.compare.metrics import HEADLINES, OFF_RUN, OFF_STATION, in_order
from hil.judge.dotted_figures import bare


@dataclass(frozen=True, slots=True)
class Headlines:
    """Metrics by their names without a chain's pair: those that are ``told``, and that ``decide``.

    The noise-free run is that of a run's own law: with laws that differ it tells nothing of which is better,
    and the distance off the station does, which alone decides where nothing of the estimator differs.
    """

    told: frozenset[str]
    decide: frozenset[str]

    @staticmethod
    def of(groups: Sequence[Group]) -> Headlines:
        """Those by which these groups are told apart."""
        differing = differences_of(groups)
        if not are_of_the_law(differing):
            told = frozenset(HEADLINES) - OFF_STATION
            return Headlines(told, told)
        told = frozenset(HEADLINES) - OFF_RUN
        known = {bare(name) for name in set.intersection(*(group.metrics for group in groups))}
        alone = bool(known & OFF_STATION) and not are_of_the_estimator(differing)
        return Headlines(told, OFF_STATION if alone else told)

    def told_of(self, first: Group, other: Group) -> list[str]:
        """Names of the told metrics that both groups know, in order."""
        return in_order({name for name in first.metrics & other.metrics if bare(name) in self.told})

    def deciding(self, first: Group, other: Group) -> list[str]:
        """Names of those that decide."""
        return [name for name in self.told_of(first, other) if bare(name) in self.decide]
