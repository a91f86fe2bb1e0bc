"""Which group was better, and why, in one sentence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hil.compare.breaks import Break, breaks_of, least_broken, parting, told_parting
from hil.compare.change import Change, change_of
from hil.compare.group import SWEEP, Group, Spread
from hil.compare.headlines import Headlines
from hil.compare.metrics import HEADLINES, shown, unit_of
from hil.judge.dotted_figures import bare

_NEGLIGIBLE = 0.02
"""Share by which errors must differ to be worth a word."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """``best``: label of the better group, None where they are alike or nobody can tell; and the sentence."""

    best: str | None
    text: str


def verdict_on(groups: Sequence[Group]) -> Verdict:
    """The better group and why: by what should not be at all, else by the errors of the headlines."""
    first, *others = groups
    headlines = Headlines.of(groups)
    scores = [0.0, *(_score(first, other, headlines) for other in others)]
    breaks = breaks_of(groups)
    best = _best(range(len(groups)), breaks, scores)
    next_best = 0
    if best is None:
        return Verdict(None, "Which was better cannot be told: they know no error in common.")
    if best == 0:
        next_best = _best(range(1, len(groups)), breaks, scores) or 1
    better, worse = groups[best], groups[next_best]
    decided = parting(breaks[best], breaks[next_best])
    gap = (scores[next_best] or 0.0) - (scores[best] or 0.0)
    if decided is None and not gap > _NEGLIGIBLE:
        return Verdict(None, f"{better.label} and {worse.label} are alike{_but(worse, better, headlines)}.")
    which = f"better than {worse.label}"
    if len(groups) > 2:
        which = f"the best of {len(groups)}, {'ahead of' if best == 0 else 'against'} {worse.label}"
    because = "" if decided is None else told_parting(*decided)
    reasons = "; ".join(filter(None, [because, _reasons(worse, better, headlines)]))
    changes = [change for _, change in _changes(worse, better, headlines)]
    trust = _trust(worse, better, changes, by_errors=decided is None)
    trust += _where_worse(worse, better, headlines) if decided is None else ""
    return Verdict(better.label, f"{better.label} was {which}: {reasons}{trust}.")


def _where_worse(worse: Group, better: Group, headlines: Headlines) -> str:
    """At which noise the better sweep is the worse one, by what decides."""
    levels = sorted({each.noise for each in better.samples if each.noise is not None})
    lost = [
        f"{1e3 * level:.3g}"
        for level in levels
        if (_score(worse.at_noise(level), better.at_noise(level), headlines) or 0.0) > _NEGLIGIBLE
    ]
    return f"; but worse at {', '.join(lost)} mm of position noise" if lost else ""


def _best(
    among: Sequence[int], breaks: Sequence[Sequence[Break | None]], scores: Sequence[float | None]
) -> int | None:
    """The best of some groups; None where several broke as little and the errors of one are not known."""
    left = [among[n] for n in least_broken([breaks[n] for n in among])]
    if len(left) == 1:
        return left[0]
    known = [(score, n) for n in left if (score := scores[n]) is not None]
    return min(known)[1] if len(known) == len(left) else None


def _score(first: Group, other: Group, headlines: Headlines) -> float | None:
    """Mean of the logarithms of ratios of the metrics that decide; None where none is known of both."""
    ratios = []
    for name in headlines.deciding(first, other):
        change = change_of(name, first, other)
        if change is not None and change.ratio is not None and 0.0 < change.ratio < math.inf:
            ratios.append(math.log(change.ratio))
    return sum(ratios) / len(ratios) if ratios else None


def _reasons(worse: Group, better: Group, headlines: Headlines) -> str:
    """Headlines with their change, those that speak for the better one first, and of these what decides."""
    found = _changes(worse, better, headlines)
    told = [
        (change.ratio or 0.0, _told(name, worse, better, change))
        for name, change in sorted(found, key=lambda each: bare(each[0]) not in headlines.decide)
    ]
    gains = [text for ratio, text in told if ratio <= 1.0]
    losses = [text for ratio, text in told if ratio > 1.0]
    if gains and losses:
        return f"{', '.join(gains)}; but {', '.join(losses)}"
    return ", ".join(gains or losses)


def _changes(worse: Group, better: Group, headlines: Headlines) -> list[tuple[str, Change]]:
    """Headlines that changed by more than is negligible."""
    found = [(name, change_of(name, worse, better)) for name in headlines.told_of(worse, better)]
    return [
        (name, change)
        for name, change in found
        if change is not None
        and change.ratio is not None
        and _NEGLIGIBLE < abs(change.ratio - 1.0) < math.inf
    ]


def _but(first: Group, second: Group, headlines: Headlines) -> str:
    reasons = _reasons(first, second, headlines)
    return f" on the whole: in {second.label} {reasons}" if reasons else ""


def _told(name: str, worse: Group, better: Group, change: Change) -> str:
    old, new = (Spread.of(group.values(name)).median for group in (worse, better))
    unit = f" {unit_of(name)[0]}".rstrip()
    whose = f" of {name.split('.')[1]}" if bare(name) != name else ""
    percent = f"{100.0 * ((change.ratio or 0.0) - 1.0):+.0f} %"
    if change.pairs and not math.isclose(new, old * (change.ratio or 0.0), rel_tol=0.1):
        percent += " in the median of the pairs"
    if better.kind == SWEEP and len(better.samples) > 1:
        percent += ", medians of the cells"
    values = f"{shown(name, new)} instead of {shown(name, old)}{unit}"
    return f"{HEADLINES[bare(name)]}{whose} {values} ({percent})"


def _trust(worse: Group, better: Group, changes: Sequence[Change], *, by_errors: bool) -> str:
    """How far chance may have done what speaks for the better one; of errors alone."""
    if better.kind == SWEEP:  # cells share their seeds
        return ""
    if min(len(worse.samples), len(better.samples)) == 1:
        return "; with one run on a side the spread is not known"
    known = [change for change in changes if (change.ratio or 0.0) < 1.0]
    if not by_errors or not known:
        return ""
    tested = [each for each in known if each.chance is not None]
    if tested:
        sure = sum(not each.may_be_chance for each in tested)
        if not sure:
            return "; which may be chance (at 5 %)"
        which = "more than" if sure == len(tested) else f"{sure} of {len(tested)} more than"
        return f"; {which} chance (at 5 %)"
    pairs = [each for each in known if each.pairs]
    if pairs:
        wins, count = min(each.better_in for each in pairs), pairs[0].pairs
        return f"; so in all {count} pairs" if wins == count else f"; so in {wins} of {count} pairs or more"
    return "; too few runs to tell that from chance"
