"""Which group was better, and why, in one sentence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from hil.compare.change import Change, change_of
from hil.compare.group import RUNS, Group, Spread
from hil.compare.metrics import BROKEN, HEADLINES, UNTRACKED, in_order, shown, unit_of
from hil.judge.dotted_figures import bare

_NEGLIGIBLE = 0.02
"""Share by which errors must differ to be worth a word."""
_LOST_TRACK = 0.01
"""Share of estimates without a track that is no mere start."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """``best``: label of the better group, None where they are alike or nobody can tell; and the sentence."""

    best: str | None
    text: str


def verdict_on(groups: Sequence[Group]) -> Verdict:
    """The better group and why: by what should not be at all, else by the errors of the headlines."""
    first, *others = groups
    scores = [0.0, *(_score(first, other) for other in others)]
    breaks = [_broken(group) for group in groups]
    totals = [float(f"{sum(each.values()):.1g}") for each in breaks]
    known = [score for score in scores if score is not None]
    if len(known) < len(scores) and len(set(totals)) == 1:
        return Verdict(None, "Which was better cannot be told: they know no error in common.")
    ranks = [
        (total, math.inf if score is None else score) for total, score in zip(totals, scores, strict=True)
    ]
    order = sorted(range(len(groups)), key=lambda n: ranks[n])
    best, next_best = order[0], 0 if order[0] else order[1]
    better, worse = groups[best], groups[next_best]
    gap = ranks[next_best][1] - ranks[best][1]
    if totals[best] == totals[next_best] and not gap > _NEGLIGIBLE:
        return Verdict(None, f"{better.label} and {worse.label} are alike{_but(worse, better)}.")
    which = f"better than {worse.label}"
    if len(groups) > 2:
        which = f"the best of {len(groups)}, {'ahead of' if best == 0 else 'against'} {worse.label}"
    because = _fewer(breaks[best], breaks[next_best])
    reasons = "; ".join(filter(None, [because, _reasons(worse, better)]))
    return Verdict(better.label, f"{better.label} was {which}: {reasons}{_trust(worse, better)}.")


def _score(first: Group, other: Group) -> float | None:
    """Mean of the logarithms of ratios of the headlines' metrics; None where none is known of both."""
    ratios = []
    for name in _headlines(first, other):
        change = change_of(name, first, other)
        if change is not None and change.ratio is not None and 0.0 < change.ratio < math.inf:
            ratios.append(math.log(change.ratio))
    return sum(ratios) / len(ratios) if ratios else None


def _headlines(first: Group, other: Group) -> list[str]:
    return in_order({name for name in first.metrics & other.metrics if bare(name) in HEADLINES})


def _broken(group: Group) -> dict[str, float]:
    """What should be none, by its words: per run, in a sweep in total."""
    found: dict[str, float] = {}
    per = len(group.samples) if group.kind == RUNS else 1
    for name in group.metrics:
        for pattern, words in BROKEN.items():
            if fnmatchcase(bare(name), pattern) and (total := sum(group.values(name))):
                found[words] = found.get(words, 0.0) + total / per
    for name, tracked in UNTRACKED.items():
        lost = sum(group.values(name))
        if lost > _LOST_TRACK * (lost + sum(group.values(tracked))):
            found["estimates that did not say tracking"] = lost / per
    return found


def _fewer(best: dict[str, float], other: dict[str, float]) -> str:
    """What the better one has less of."""
    less = [(words, best.get(words, 0.0), count) for words, count in other.items()]
    told = [
        f"{_count(mine)} {words} instead of {_count(count)}" for words, mine, count in less if mine < count
    ]
    return ", ".join(told)


def _count(number: float) -> str:
    return "no" if not number else f"{number:.3g}"


def _reasons(worse: Group, better: Group) -> str:
    """Headlines with their change, those that speak for the better one first."""
    told = [
        (change.ratio or 0.0, _told(name, worse, better, change)) for name, change in _changes(worse, better)
    ]
    gains = [text for ratio, text in told if ratio <= 1.0]
    losses = [text for ratio, text in told if ratio > 1.0]
    if gains and losses:
        return f"{', '.join(gains)}; but {', '.join(losses)}"
    return ", ".join(gains or losses)


def _changes(worse: Group, better: Group) -> list[tuple[str, Change]]:
    """Headlines that changed by more than is negligible."""
    found = [(name, change_of(name, worse, better)) for name in _headlines(worse, better)]
    return [
        (name, change)
        for name, change in found
        if change is not None
        and change.ratio is not None
        and _NEGLIGIBLE < abs(change.ratio - 1.0) < math.inf
    ]


def _but(first: Group, second: Group) -> str:
    reasons = _reasons(first, second)
    return f" on the whole: in {second.label} {reasons}" if reasons else ""


def _told(name: str, worse: Group, better: Group, change: Change) -> str:
    old, new = (Spread.of(group.values(name)).median for group in (worse, better))
    unit = f" {unit_of(name)[0]}".rstrip()
    whose = f" of {name.split('.')[1]}" if bare(name) != name else ""
    percent = f"{100.0 * ((change.ratio or 0.0) - 1.0):+.0f} %"
    if change.pairs and not math.isclose(new, old * (change.ratio or 0.0), rel_tol=0.1):
        percent += " in the median of the pairs"
    values = f"{shown(name, new)} instead of {shown(name, old)}{unit}"
    return f"{HEADLINES[bare(name)]}{whose} {values} ({percent})"


def _trust(worse: Group, better: Group) -> str:
    """How far chance may have done it."""
    if min(len(worse.samples), len(better.samples)) == 1:
        return "; with one run on a side the spread is not known"
    known = [change for _, change in _changes(worse, better)]
    tested = [each for each in known if each.chance is not None]
    if tested:
        sure = sum(not each.may_be_chance for each in tested)
        which = "more than" if sure == len(tested) else f"{sure} of {len(tested)} more than"
        return f"; {which} chance (at 5 %)"
    pairs = [each for each in known if each.pairs]
    if pairs:
        wins, count = min(each.better_in for each in pairs), pairs[0].pairs
        return f"; so in all {count} pairs" if wins == count else f"; so in {wins} of {count} pairs or more"
    return "; too few runs to tell that from chance"
