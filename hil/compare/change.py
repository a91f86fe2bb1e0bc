"""A metric of one group against that of another: by how much, for the better or not, and by chance or not."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from hil.compare.group import SWEEP, Group, Sample
from hil.compare.metrics import goal_of

CHANCE = 0.05
"""A change that chance alone would show more often than this is told of as one that may be chance."""
_FEWEST_PAIRS, _FEWEST_EACH = 6, 4
"""With fewer samples no test can tell a change from chance."""
_SAME = 1e-6
"""Share by which values differ that were rounded otherwise."""


@dataclass(frozen=True, slots=True)
class Change:
    """Of a metric, from the first group to another.

    ``ratio``: other over first, of twins the median of their ratios, else that of the medians; None where it
    says nothing, as of values below zero. ``difference`` likewise. ``better``: None where the goal is not
    known or nothing changed. ``pairs``: how many twins there are, 0 where samples are no twins of each other;
    ``better_in``, ``worse_in``: in how many the other is better, or worse. ``chance``: p-value of Wilcoxon's
    signed ranks for twins, else of Mann and Whitney's test; None with too few samples to tell, and of a
    sweep, whose cells share their seeds. ``same``: whether no value changed. Counts of a sweep
    are those of as many runs, or samples, as the first has.
    """

    ratio: float | None
    difference: float
    better: bool | None
    pairs: int
    better_in: int
    worse_in: int
    chance: float | None
    same: bool

    @property
    def may_be_chance(self) -> bool | None:
        """Whether chance alone may have done it; None where nobody can tell."""
        return None if self.chance is None else self.chance > CHANCE


def change_of(name: str, first: Group, other: Group) -> Change | None:
    """How a metric changed, None where one of the groups does not know it."""
    before, after = first.values(name), other.values(name)
    if not before or not after:
        return None
    if first.adds_up(name):
        amounts = [_amount(name, sweep) for sweep in (first, other)]
        if all(amounts):
            after = [value * amounts[0] / amounts[1] for value in after]
    twins = twins_of(name, first, other)
    if twins:
        ratios = [_ratio(old, new) for old, new in twins]
        known = [each for each in ratios if each is not None]
        ratio = _median(known) if len(known) == len(ratios) else None
        difference = _median([new - old for old, new in twins])
    else:
        old, new = _median(before), _median(after)
        ratio, difference = _ratio(old, new), new - old
    goal = goal_of(name)
    better, wins, losses = None, 0, 0
    if goal is not None:
        pairs = twins or [(_median(before), _median(after))]
        gains = [goal.cost(old) - goal.cost(new) for old, new in pairs]
        if twins:
            real = [0.0 if _equal(*pair) else gain for pair, gain in zip(pairs, gains, strict=True)]
            wins, losses = sum(gain > 0.0 for gain in real), sum(gain < 0.0 for gain in real)
        gain = goal.cost(_median(before)) - goal.cost(_median(after)) if not twins else _gain(gains)
        better = None if not abs(gain) > _SAME * max(map(abs, (*before, *after))) else gain > 0.0
    chance = None if first.kind == SWEEP else _chance(twins, before, after)
    same = _all_same(twins, before, after)
    return Change(ratio, difference, better, len(twins), wins, losses, chance, same)


def twins_of(name: str, first: Group, other: Group) -> list[tuple[float, float]]:
    """Values of a metric of samples that are the same in both groups but for what is compared.

    Empty where nothing tells which these are.
    """
    if first.adds_up(name):
        return []
    both = [(old.metrics, new.metrics) for old, new in twin_samples(first, other)]
    return [(old[name], new[name]) for old, new in both if name in old and name in new]


def twin_samples(first: Group, other: Group) -> list[tuple[Sample, Sample]]:
    """Samples that are the same in both groups but for what is compared.

    By their keys, else by their names, where both groups have the same of them and none twice; empty
    otherwise, and for one run beside another.
    """
    for attribute in ("key", "name"):
        sides = []
        for group in (first, other):
            known = {getattr(each, attribute): each for each in group.samples if getattr(each, attribute)}
            sides.append(known if len(known) == len(group.samples) else {})
        if set(sides[0]) == set(sides[1]) and (len(sides[0]) > 1 or first.kind == SWEEP):
            return [(sample, sides[1][label]) for label, sample in sides[0].items()]
    return []


def _amount(name: str, sweep: Group) -> float:
    """Of how many samples, or runs, a count of a sweep is one."""
    samples = sum(sweep.values("samples"))
    if name.startswith("bounds.violations."):
        return samples
    return samples + sum(sweep.values("untracked")) if name == "untracked" else float(sweep.runs)


def _equal(old: float, new: float) -> bool:
    return math.isclose(old, new, rel_tol=_SAME)


def _all_same(twins: Sequence[tuple[float, float]], before: Sequence[float], after: Sequence[float]) -> bool:
    if len(before) != len(after):
        return _equal(min(*before, *after), max(*before, *after))
    pairs = twins if len(twins) == len(before) else zip(sorted(before), sorted(after), strict=True)
    return all(_equal(old, new) for old, new in pairs)


def _gain(gains: Sequence[float]) -> float:
    finite = [gain for gain in gains if math.isfinite(gain)]
    return _median(finite) if finite else 0.0


def _ratio(old: float, new: float) -> float | None:
    if old < 0.0 or new < 0.0:
        return None
    if old == 0.0:
        return 1.0 if new == 0.0 else math.inf
    return new / old


def _median(values: Sequence[float]) -> float:
    return float(statistics.median(values))  # of what is infinite, too


def _chance(
    twins: Sequence[tuple[float, float]], before: Sequence[float], after: Sequence[float]
) -> float | None:
    differences = [new - old for old, new in twins]
    if (len(twins) < _FEWEST_PAIRS) if twins else (min(len(before), len(after)) < _FEWEST_EACH):
        return None
    if twins and not any(differences):
        return 1.0
    from scipy import stats  # takes half a second to load

    if twins:
        return float(stats.wilcoxon(differences, zero_method="zsplit").pvalue)
    return float(stats.mannwhitneyu(before, after).pvalue)
