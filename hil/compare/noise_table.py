"""Sweeps compared at each level of position noise: what a verdict over all cells leaves out."""

from __future__ import annotations

from collections.abc import Sequence

from hil.compare.change import change_of
from hil.compare.comparison import Comparison
from hil.compare.comparison_text import spread_text, told_ratio
from hil.compare.group import SWEEP, Group
from hil.compare.headlines import Headlines
from hil.compare.metrics import HEADLINES, unit_of
from hil.judge.dotted_figures import bare


def noise_rows(comparison: Comparison) -> list[list[str]]:
    """Rows of a table of sweeps: of each metric that decides, each level of noise, all groups; none for runs.

    The first row is the header.
    """
    first, *others = comparison.groups
    levels = sorted({sample.noise for sample in first.samples if sample.noise is not None})
    if first.kind != SWEEP or not levels:
        return []
    header = ["at position noise [mm]", first.label]
    rows = [header + [text for group in others for text in (group.label, "against the first")]]
    for name in Headlines.of(comparison.groups).deciding(first, others[0]):
        unit = unit_of(name)[0]
        rows += [
            _row(f"{HEADLINES[bare(name)]} [{unit}], {1e3 * level:.3g}", name, level, comparison.groups)
            for level in levels
        ]
    return rows


def _row(title: str, name: str, level: float, groups: Sequence[Group]) -> list[str]:
    first, *others = (group.at_noise(level) for group in groups)
    cells = [title, spread_text(name, first.spread(name))]
    for group in others:
        change = change_of(name, first, group)
        cells += [spread_text(name, group.spread(name)), told_ratio(name, change)]
    return cells
