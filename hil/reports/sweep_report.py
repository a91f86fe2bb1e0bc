"""The report of a sweep: how every estimator did over noise, latency and loss, and where it did worst."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any
from urllib.parse import quote

import numpy as np

from hil.judge.consistency import nees_finding
from hil.reports.heat_maps import (
    MERITS,
    SWITCH,
    Cell,
    choices_html,
    heat_maps,
    slice_name,
    slice_of,
    tightness,
)
from hil.reports.page import Section, page, table_html

_FORMS = ("extended", "sound", "paper")
_WORST = 10


def sweep_report(results: Mapping[str, Any]) -> str:
    """HTML of a page that needs nothing but itself, from the JSON of ``sweep``.

    A cell may name its ``worst_run``, by number, and the runs that were ``kept``, a folder relative to the
    page by the run's number as text; these are linked. What a cell does not know is left out.
    """
    cells: Sequence[Cell] = results["cells"]
    sections = [Section("By estimator", _by_estimator(cells))]
    if cells:
        sections += [
            Section("Where it is hardest", _worst(cells)),
            Section("Over noise", f"<p>{choices_html(cells)}</p>\n{_WORDS}"),
            *(
                Section(merit.title, f"<p>{escape(merit.says)}</p>", heat_maps(cells, merit), narrow=True)
                for merit in MERITS
            ),
            Section("All cells", _all_cells(cells)),
        ]
    estimators = ", ".join(dict.fromkeys(str(cell["estimator"]) for cell in cells))
    return page(f"Sweep · {estimators} – abreast", _head(results), sections, SWITCH if cells else "")


_WORDS = (
    '<p class="soft">Yellow is good, dark blue is bad; one colour scale holds for all estimators, latencies '
    "and losses. Empty places were not in the sweep.</p>"
)


def _head(results: Mapping[str, Any]) -> str:
    cells: Sequence[Cell] = results["cells"]
    broken = {form: sum(_violations(cell, form) for cell in cells) for form in _FORMS}
    diverged = sum(int(cell["diverged"]) for cell in cells)
    samples = sum(int(cell["samples"]) for cell in cells)
    bad = bool(broken["extended"] or broken["sound"])
    if bad:
        verdict = f"Bounds violated: extended ones {broken['extended']}, sound ones {broken['sound']} times."
    else:
        verdict = f"No sound or extended bound violated in {samples} samples."
    if diverged:
        verdict += f" {diverged} runs diverged."
    off = [text for cell in cells if (text := nees_finding(cell))]
    facts = {
        "sweep": f"{len(cells)} cells, {sum(int(cell['runs']) for cell in cells)} runs, {samples} samples",
        "simulated": f"{_duration(float(results['run_seconds']))} of driving",
        "took": _duration(float(results["wall_s"])),
    }
    if off:
        facts["nees"] = f"in {len(off)} of {len(cells)} cells deviations are not what errors are; {off[0]}"
    listed = "".join(f"<dt>{name}</dt><dd>{escape(text)}</dd>" for name, text in facts.items())
    return (
        f'<h1>Sweep over noise</h1>\n<div class="verdict{" bad" if bad else ""}">'
        f"<p><strong>{escape(verdict)}</strong></p></div>\n<dl>{listed}</dl>\n"
    )


def _by_estimator(cells: Sequence[Cell]) -> str:
    rows = []
    for estimator in dict.fromkeys(str(cell["estimator"]) for cell in cells):
        own = [cell for cell in cells if str(cell["estimator"]) == estimator]
        rows.append(
            (
                estimator,
                str(sum(int(cell["runs"]) for cell in own)),
                str(sum(int(cell["diverged"]) for cell in own)),
                *(
                    _median([cell.get("efficiency", {}).get(name) for cell in own])
                    for name in ("v1", "alpha1")
                ),
                _median([cell.get("nis_mean") for cell in own]),
                *(_median([cell.get("nees", {}).get(name) for cell in own]) for name in ("v1", "alpha1")),
                str(sum(bool(nees_finding(cell)) for cell in own)),
                *(str(sum(_violations(cell, form) for cell in own)) for form in _FORMS),
            )
        )
    header = (
        *("", "runs", "diverged", "v₁ / bound", "α₁ / bound"),
        *("NIS", "v₁ NEES", "α₁ NEES", "cells with NEES off"),
    )
    violated = tuple(f"outside {form}" for form in _FORMS)
    return table_html(
        "Medians over the cells; the bound is that for random leaders; violations in samples",
        (*header, *violated),
        rows,
    )


def _worst(cells: Sequence[Cell]) -> str:
    """The cells in which runs diverged or bounds were nearest to breaking, with links to their runs."""
    order = sorted(range(len(cells)), key=lambda n: (-int(cells[n]["diverged"]), -_tightest(cells[n])))
    rows, linked = [], []
    for number in order[:_WORST]:
        cell = cells[number]
        rows.append((f"{number}: {_name(cell)}", *_figures(cell)))
        linked.append(_links(number, cell))
    table = table_html("Runs diverged, then largest error over extended bound", ("cell", *_FIGURES), rows)
    links = "".join(f"<li>{each}</li>" for each in linked if each)
    return table + (f"<p>Their worst runs:</p><ul>{links}</ul>" if links else "")


def _links(number: int, cell: Cell) -> str:
    """Links to the reports and logs of a cell's runs that were kept, else how to get the worst one."""
    kept: Mapping[str, str] = cell.get("kept", {})
    if kept:
        runs = (
            f'run {escape(run)}: <a href="{_address(folder)}/report.html">report</a>, '
            f'<a href="{_address(folder)}/run.mcap">log</a>'
            for run, folder in kept.items()
        )
        return f"cell {number}, {', '.join(runs)}"
    if "worst_run" in cell:
        return f"cell {number}: <code>--keep {number}:{int(cell['worst_run'])}</code> writes it out as a log"
    return ""


def _all_cells(cells: Sequence[Cell]) -> str:
    rows = [(f"{number}: {_name(cell)}", *_figures(cell)) for number, cell in enumerate(cells)]
    table = table_html("In the order of results.json", ("cell", *_FIGURES), rows)
    return f"<details><summary>{len(cells)} cells</summary>{table}</details>"


_FIGURES = ("runs", "diverged", "v₁ [mm/s]", "α₁ [deg]", "error / bound", "ρ [m]")


def _figures(cell: Cell) -> tuple[str, ...]:
    rmse, formation = cell.get("rmse", {}), cell.get("formation", {})
    between = "–"
    if "rho_min" in formation:
        between = f"{formation['rho_min']:.3f} to {formation['rho_max']:.3f}"
    return (
        str(cell["runs"]),
        str(cell["diverged"]),
        f"{1e3 * rmse['v1']:.3g}" if "v1" in rmse else "–",
        f"{math.degrees(rmse['alpha1']):.3g}" if "alpha1" in rmse else "–",
        f"{_tightest(cell):.1%}",
        between,
    )


def _name(cell: Cell) -> str:
    noise = f"{1e3 * float(cell['sigma_position']):g} mm, {math.degrees(float(cell['sigma_heading'])):.3g}°"
    return f"{cell['estimator']}, {noise}, {slice_name(slice_of(cell))}"


def _tightest(cell: Cell) -> float:
    """Largest share of an extended bound that an error of the cell used up; 0 where none is known."""
    return max((tightness(cell, name) or 0.0 for name in ("v1", "alpha1", "h")), default=0.0)


def _violations(cell: Cell, form: str) -> int:
    counts: Mapping[str, int] = cell.get("bounds", {}).get("violations", {})
    return sum(count for name, count in counts.items() if _form(name) == form)


def _form(name: str) -> str:
    if name.startswith("paper_"):
        return "paper"
    return "extended" if name.endswith("_extended") else "sound"


def _median(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{float(np.median(known)):.2f}" if known else "–"


def _duration(seconds: float) -> str:
    for unit, length in (("days", 86_400.0), ("h", 3_600.0), ("min", 60.0)):
        if seconds >= 2.0 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.1f} s"


def _address(folder: str) -> str:
    return "./" + quote(folder.lstrip("/"))
