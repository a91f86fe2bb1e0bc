"""What a sweep says of the estimators that it is about, and apart from them of its foils."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from hil.reports.sweep_cells import Cell, estimators_of

FORMS = ("extended", "sound", "paper")
"""Forms of the bounds."""


@dataclass(frozen=True, slots=True)
class SweepVerdict:
    """The sentence on the estimators asked about, whether it is bad, and what else there is to say."""

    text: str
    bad: bool
    others: tuple[str, ...]

    def lines(self) -> tuple[str, ...]:
        """All of it, a line each."""
        return self.text, *self.others


def sweep_verdict(results: Mapping[str, Any]) -> SweepVerdict:
    """Verdict on the JSON of a sweep.

    Bad where an extended bound was violated, a run diverged, nothing was judged, or it was broken off.
    """
    cells: Sequence[Cell] = results["cells"]
    verdict = _on_cells(cells)
    if not results.get("interrupted"):
        return verdict
    return replace(verdict, text=f"Broken off after {results['runs_done']} runs. {verdict.text}", bad=True)


def _on_cells(cells: Sequence[Cell]) -> SweepVerdict:
    asked, foils = estimators_of(cells)
    own = [cell for cell in cells if str(cell["estimator"]) in asked]
    samples = sum(int(cell["samples"]) for cell in own)
    broken, diverged = sum(violations(cell, "extended") for cell in own), _diverged(own)
    if not samples:
        return SweepVerdict(f"{_listed(asked)}: nothing was judged, as no estimate tracked.", True, ())
    bounds = f"extended bounds violated in {broken} of {samples} samples"
    if not broken:
        bounds = f"no extended bound violated in {samples} samples"
    text = f"{_listed(asked)}: {bounds}; {_runs(own)}."
    others = []
    if sound := sum(violations(cell, "sound") for cell in own):
        others.append(
            f"Sound bounds, which assume exact positions and own motion, were violated in {sound} samples."
        )
    for name in foils:
        foil = [cell for cell in cells if str(cell["estimator"]) == name]
        others.append(
            f"For comparison, {name} (a foil): {_runs(foil)}; outside bounds in "
            f"{sum(violations(cell, form) for cell in foil for form in FORMS[:2])} of "
            f"{sum(int(cell['samples']) for cell in foil)} samples."
        )
    return SweepVerdict(text, bool(broken or diverged), tuple(others))


def violations(cell: Cell, form: str) -> int:
    """Samples of a cell outside its bounds of a form."""
    counts: Mapping[str, int] = cell.get("bounds", {}).get("violations", {})
    return sum(count for name, count in counts.items() if _form(name) == form)


def _form(name: str) -> str:
    if name.startswith("paper_"):
        return "paper"
    return "extended" if name.endswith("_extended") else "sound"


def _diverged(cells: Sequence[Cell]) -> int:
    return sum(int(cell["diverged"]) for cell in cells)


def _runs(cells: Sequence[Cell]) -> str:
    """How many runs diverged, and in how many cells."""
    runs, diverged = sum(int(cell["runs"]) for cell in cells), _diverged(cells)
    if not diverged:
        return f"none of {runs} runs diverged"
    hit = sum(int(cell["diverged"]) > 0 for cell in cells)
    return f"{diverged} of {runs} runs diverged, in {hit} of {len(cells)} cells"


def _listed(names: Sequence[str]) -> str:
    *most, last = names or ["no estimator"]
    return f"{', '.join(most)} and {last}" if most else last
