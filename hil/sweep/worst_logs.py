"""Which of many logs stand out, and why."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from typing import Any

from hil.judge.dotted_figures import HEADLINES, bare, figures_of

_WORST, _NAMED = 10, 3
_STANDS_OUT = 1.5
"""So many times the median is worth a name beyond the first few."""


def worst_of(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """The logs that stand out most, and why: by failed checks, then by a headline far above its median.

    ``rows``: as :func:`hil.sweep.judged_logs.judged_row` makes them; those without a summary are left out.
    """
    headlines = [_headlines(row) for row in rows]
    medians = {
        name: statistics.median(each[name] for each in headlines if name in each)
        for name in HEADLINES
        if any(name in each for each in headlines)
    }
    ranked = []
    for row, own in zip(rows, headlines, strict=True):
        if "summary" not in row:
            continue
        above = {name: value / medians[name] for name, value in own.items() if medians[name] > 0.0}
        name = max(above, key=lambda each: above[each], default="")
        reasons = list(row.get("failed", []))
        if name:
            reasons.append(f"{HEADLINES[name]} {above[name]:.2f} times the median of all logs")
        untracked = sum(v for n, v in figures_of(row["summary"]).items() if bare(n) == "estimation.untracked")
        if untracked:
            reasons.append(f"{untracked:.0f} estimates did not say tracking")
        if not own:
            reasons.append("nothing of it could be judged")
        ranked.append(
            ((bool(row.get("failed")), not own, above.get(name, 0.0)), row["log"], "; ".join(reasons))
        )
    ranked.sort(key=lambda each: each[0], reverse=True)
    return [
        {"log": log, "why": why}
        for place, ((failed, unknown, times), log, why) in enumerate(ranked[:_WORST])
        if place < _NAMED or failed or unknown or times > _STANDS_OUT
    ]


def _headlines(row: Mapping[str, Any]) -> dict[str, float]:
    """Headlines of a log, of a chain the largest of its pairs."""
    found: dict[str, float] = {}
    for name, value in figures_of(row.get("summary", {})).items():
        if bare(name) in HEADLINES:
            found[bare(name)] = max(value, found.get(bare(name), 0.0))
    return found
