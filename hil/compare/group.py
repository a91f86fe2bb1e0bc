"""What is compared: groups of samples, which are runs or cells of a sweep, with metrics and conditions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

RUNS, SWEEP = "runs", "sweep"
STOPPED = "stopped before its time"
"""The fact of a run that somebody stopped, and why."""

_COUNTS = ("diverged", "untracked", "samples", "law_failed", "bounds.violations.")


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """A run, or a cell of a sweep.

    ``name``: within its group. ``key``: what it has in common with its twin in another group, the seed of a
    run or the point of a cell; empty where nothing is known. ``metrics`` by dotted names. ``facts``: under
    which conditions, as text by the scenario's keys. ``log``: where its log is, None if it is not there.
    ``estimates``: a table of estimates that take the place of those in the log. ``runs``: how many it is of.
    ``noise``: of positions in a cell [m]. ``lost``: metrics of a cell that have no part, as a cell of another
    sweep at its place lacks them.
    """

    name: str
    key: str
    metrics: Mapping[str, float]
    facts: Mapping[str, str]
    log: Path | None = None
    estimates: Path | None = None
    runs: int = 1
    noise: float | None = None
    lost: frozenset[str] = frozenset()

    @property
    def label(self) -> str:
        """Its key, or its name where it has none."""
        return self.key or self.name

    def knows(self, name: str) -> bool:
        """Whether it has a metric, be it one that has no part in a comparison."""
        return name in self.metrics or name in self.lost


@dataclass(frozen=True, eq=False)
class Group:
    """Samples of one kind that were named together.

    ``tree``: JSON of a sweep, empty for runs. ``notes``: what a reader should know of how it came to be.
    """

    label: str
    path: Path
    kind: str
    samples: tuple[Sample, ...]
    tree: Mapping[str, Any]
    notes: tuple[str, ...] = ()

    @cached_property
    def metrics(self) -> set[str]:
        """Names of all metrics that a sample has."""
        return {name for sample in self.samples for name in sample.metrics}

    @cached_property
    def known(self) -> set[str]:
        """Names of all metrics that a sample knows, be they without a part in a comparison."""
        return self.metrics.union(*(sample.lost for sample in self.samples))

    @property
    def runs(self) -> int:
        """How many runs all samples are of."""
        return sum(sample.runs for sample in self.samples)

    def share_that_knows(self, name: str) -> float:
        """Share of the samples that know a metric."""
        return sum(sample.knows(name) for sample in self.samples) / len(self.samples)

    def values(self, name: str) -> list[float]:
        """Values of a metric, of the samples that have it; of a sweep's counts their sum alone."""
        values = [sample.metrics[name] for sample in self.samples if name in sample.metrics]
        return [sum(values)] if values and self.adds_up(name) else values

    def spread(self, name: str) -> Spread | None:
        """Spread of a metric, None where no sample knows it."""
        values = self.values(name)
        return Spread.of(values) if values else None

    def at_noise(self, level: float) -> Group:
        """Those of its cells that have a level of position noise [m]."""
        return replace(self, samples=tuple(each for each in self.samples if each.noise == level))

    def adds_up(self, name: str) -> bool:
        """Whether a metric is a count of a sweep's cells, whose sum is what matters."""
        return self.kind == SWEEP and name.startswith(_COUNTS)

    def facts(self) -> dict[str, tuple[str, ...]]:
        """Conditions with the values that occur."""
        keys = dict.fromkeys(key for sample in self.samples for key in sample.facts)
        return {
            key: tuple(dict.fromkeys(each.facts[key] for each in self.samples if key in each.facts))
            for key in keys
        }

    def noun(self) -> str:
        """Such as ``3 runs`` or ``1 run``."""
        what = "cell" if self.kind == SWEEP else "run"
        return f"{len(self.samples)} {what}{'s' * (len(self.samples) != 1)}"


@dataclass(frozen=True, slots=True)
class Spread:
    """Median of a metric over a group's samples, its quartiles, and how many there were."""

    n: int
    median: float
    q25: float
    q75: float
    least: float
    largest: float

    @staticmethod
    def of(values: list[float]) -> Spread:
        """That of at least one value."""
        least, q25, median, q75, largest = np.percentile(values, [0, 25, 50, 75, 100]).tolist()
        return Spread(len(values), median, q25, q75, least, largest)
