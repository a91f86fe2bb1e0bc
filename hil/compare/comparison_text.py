"""A comparison as a person reads it in a terminal: verdict, differences, metrics side by side."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from hil.compare.change import Change
from hil.compare.comparison import Comparison, shortened
from hil.compare.group import Group, Spread
from hil.compare.metrics import is_told, shown, unit_of

_ALIKE = 0.005
"""Share by which values differ that are shown as a ratio of 1."""


def comparison_text(comparison: Comparison, further: Sequence[Sequence[str]] = (), where: str = "") -> str:
    """All of it as text, a line each.

    ``further``: rows of a table more, the header first. ``where`` all metrics are to be had.
    """
    lines = [comparison.verdict.text, *(f"! {note}" for note in comparison.notes), ""]
    groups = comparison.groups
    header = ["", *(f"{group.label} ({group.noun()})" for group in groups)]
    if comparison.differences:
        rows = [[key, *map(shortened, values)] for key, values in comparison.differences.items()]
        lines += [*_aligned([["differs", *header[1:]], *rows], right=False), ""]
    else:
        lines += ["no difference in scenario, version, law and seed", ""]
    told = [name for name in comparison.metrics() if is_told(name)]
    same = [name for name in told if is_same(comparison, name)]
    rows = [metric_row(comparison, name) for name in told if name not in same]
    if further:
        lines += [*_aligned(further, right=True), ""]
    lines += _aligned([["median (quartiles)", *_with_change(header[1:])], *rows], right=True)
    if same:
        lines.append(f"the same in all: {', '.join(same)}")
    if more := sum(not is_told(name) for name in comparison.metrics()):
        lines.append(f"{more} metrics more {where}".rstrip())
    return "\n".join(lines)


def _with_change(labels: Sequence[str]) -> list[str]:
    return [labels[0], *(text for label in labels[1:] for text in (label, "against the first"))]


def metric_row(comparison: Comparison, name: str) -> list[str]:
    """A metric's name with its unit, then its value in each group, behind all but the first its change."""
    unit = unit_of(name)[0]
    first, *others = comparison.groups
    cells = [f"{name} [{unit}]" if unit else name, spread_text(name, comparison.spread(name, first))]
    for group in others:
        cells += [spread_text(name, comparison.spread(name, group)), change_text(comparison, name, group)]
    return cells


def change_text(comparison: Comparison, name: str, group: Group) -> str:
    """By how much a metric changed from the first group, whether that is better, and whether it is chance."""
    return told_ratio(name, comparison.change(name, group))


def told_ratio(name: str, change: Change | None) -> str:
    """A change in a few words."""
    if change is None:
        return "–"
    if change.same:
        return "same"
    alike = change.ratio is not None and abs(change.ratio - 1.0) < _ALIKE
    if change.ratio is not None and math.isfinite(change.ratio):
        told = "about the same" if alike else f"× {change.ratio:.3g}"
    else:
        told = f"{'+' * (change.difference > 0.0)}{shown(name, change.difference)}"
    counts = {"better": change.better_in, "worse": change.worse_in}
    if change.pairs > 1 and (alike or change.better is None):
        found = [f"{word} {count}/{change.pairs}" for word, count in counts.items() if count]
        told += "".join(f", {each}" for each in found)
    elif change.better is not None and not alike:
        word = "better" if change.better else "worse"
        told += f" {word} {counts[word]}/{change.pairs}" if change.pairs > 1 else f" {word}"
    return told + (", chance?" if change.may_be_chance else "")


def is_same(comparison: Comparison, name: str) -> bool:
    """Whether all groups have the same values of a metric."""
    changes = [comparison.change(name, group) for group in comparison.groups[1:]]
    return all(each is not None and each.same for each in changes)


def spread_text(name: str, spread: Spread | None) -> str:
    """A median with its quartiles, where there are several values."""
    if spread is None:
        return "–"
    if spread.n == 1:
        return shown(name, spread.median)
    return f"{shown(name, spread.median)} ({shown(name, spread.q25)} to {shown(name, spread.q75)})"


def _aligned(rows: Sequence[Sequence[str]], *, right: bool) -> Iterator[str]:
    """Rows of cells in columns; all but the first to the right."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        cells = [
            cell.rjust(width) if right and column else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        yield "  ".join(cells).rstrip()
