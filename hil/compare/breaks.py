"""What should not be at all, as shares by which groups of any size are compared, in order of weight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from hil.compare.group import RUNS, Group
from hil.compare.metrics import BROKEN, UNTRACKED
from hil.judge.dotted_figures import bare

_RELATIVE = 0.1
"""Part of a share by which another must be less to be less at all."""
_RUNS, _TRACK, _SAMPLES = 1e-3, 0.01, 1e-4
"""The same as shares of runs, of estimates (a start is no loss of track), and of samples."""


@dataclass(frozen=True, slots=True)
class Break:
    """How often a thing happened, ``of`` so many runs or samples, in how many ``runs``; ``words`` for it.

    ``least``: difference of shares below which it is the same.
    """

    words: str
    count: float
    of: float
    runs: int
    least: float

    @property
    def share(self) -> float:
        """Of all the times that it could have happened; per run where that is not known."""
        return self.count / (self.of or self.runs)

    def is_less(self, other: Break) -> bool:
        """Whether it happened less often than in another group, beyond the tolerance."""
        return other.share - self.share > max(self.least, _RELATIVE * other.share)


def breaks_of(groups: Sequence[Group]) -> list[list[Break | None]]:
    """All that can break in each group, that of most weight first; None where nobody looked."""
    shared = set.intersection(*({sample.label for sample in group.samples} for group in groups))
    return [_breaks_of(group, shared) for group in groups]


def _breaks_of(group: Group, shared: set[str]) -> list[Break | None]:
    found = [_without_figures(group, shared), _diverged(group), _untracked(group)]
    found += [_outside(group, pattern) for pattern in BROKEN if pattern != "diverged"]
    return found


def parting(first: Sequence[Break | None], other: Sequence[Break | None]) -> tuple[Break, Break] | None:
    """The first two of the same kind that are not alike; None where all are."""
    for mine, theirs in zip(first, other, strict=True):
        if mine is not None and theirs is not None and (mine.is_less(theirs) or theirs.is_less(mine)):
            return mine, theirs
    return None


def least_broken(breaks: Sequence[Sequence[Break | None]]) -> list[int]:
    """Which groups are as good as the best, each kind of break looked at among those that are left."""
    left = list(range(len(breaks)))
    for kind in range(len(breaks[0])):
        known = [each for n in left if (each := breaks[n][kind]) is not None]
        if known:
            best = min(known, key=lambda each: each.share)
            left = [n for n in left if (each := breaks[n][kind]) is None or not best.is_less(each)]
    return left


def told_parting(better: Break, worse: Break) -> str:
    """What the better one has less of: as counts where there were as many chances, else as shares."""
    if better.runs == worse.runs and better.of == worse.of:
        counts = (better.count, worse.count)
    elif not (better.of and worse.of):
        counts = (better.share, worse.share)
    else:
        shares = [f"{100.0 * each.share:.3g} %" if each.count else "no" for each in (better, worse)]
        return f"{shares[0]} {better.words} instead of {shares[1]}"
    mine, theirs = (f"{count:.3g}" if count else "no" for count in counts)
    return f"{mine} {better.words} instead of {theirs}"


def _without_figures(group: Group, shared: set[str]) -> Break | None:
    """Of the runs that all groups have: a log that one alone has tells nothing of the others."""
    asked = [sample for sample in group.samples if sample.label in shared]
    if group.kind != RUNS or not asked:
        return None
    without = sum(not sample.metrics for sample in asked)
    return Break("runs without a figure", without, len(asked), len(asked), _RUNS)


def _diverged(group: Group) -> Break | None:
    if "diverged" not in group.metrics:
        return None
    total = sum(group.values("diverged"))
    return Break(BROKEN["diverged"], total, group.runs, group.runs, _RUNS)


def _untracked(group: Group) -> Break | None:
    names = {name: UNTRACKED[bare(name)] for name in group.metrics if bare(name) in UNTRACKED}
    if not names:
        return None
    lost = sum(sum(group.values(name)) for name in names)
    tracked = sum(sum(group.values(_beside(name, inner))) for name, inner in names.items())
    return Break("untracked estimates", lost, lost + tracked, group.runs, _TRACK)


def _outside(group: Group, pattern: str) -> Break | None:
    names = [name for name in group.metrics if fnmatchcase(bare(name), pattern)]
    if not names:
        return None
    inner = "estimation.samples" if group.kind == RUNS else "samples"
    count = sum(sum(group.values(name)) for name in names)
    of = sum(sum(group.values(_beside(name, inner))) for name in names)
    return Break(BROKEN[pattern], count, of, group.runs, _SAMPLES)


def _beside(name: str, inner: str) -> str:
    """A metric of the same pair of a chain."""
    return name.removesuffix(bare(name)) + inner
