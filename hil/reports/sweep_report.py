"""The report of a sweep: how every estimator did over noise, latency and loss, and where it did worst."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from math import degrees
from typing import Any

import numpy as np

from hil.judge.consistency import nees_finding
from hil.reports.cell_looks import legend_html
from hil.reports.cell_table import cell_table, tightest
from hil.reports.heat_maps import (
    SWITCH,
    choices_html,
    heat_maps,
    merits_of,
    quantity_labels,
    slice_name,
    slice_of,
)
from hil.reports.page import Section, page, table_html
from hil.reports.scroll_frame import FRAME_STYLE, framed
from hil.reports.sweep_cells import Cell, estimators_of, is_known, is_sound, point_of
from hil.reports.sweep_verdict import FORMS, sweep_verdict, violations

_WORST = 10


def sweep_report(results: Mapping[str, Any]) -> str:
    """HTML of a page that needs nothing but itself, from the JSON of ``sweep``.

    A cell may name its ``worst_run``, by number, and the runs that were ``kept``, a folder relative to the
    page by the run's number as text; these are linked. What a cell does not know is left out.
    """
    cells: Sequence[Cell] = results["cells"]
    if results.get("interrupted"):
        # Cells are numbered in the whole sweep, of which some may be missing here: no run is named by them.
        cells = [{name: value for name, value in cell.items() if name != "worst_run"} for cell in cells]
    sections = [Section("By estimator", _by_estimator(cells))]
    if cells:
        names = [_name(cell) for cell in cells]
        sections += [
            Section("Over noise", f"<p>{choices_html(cells, quantity_labels(cells))}</p>\n{legend_html()}"),
            *(
                Section(merit.title, f"<p>{escape(merit.says)}</p>", heat_maps(cells, merit), narrow=True)
                for merit in merits_of(cells)
            ),
            Section("Where it is hardest", _worst(cells, names)),
            Section("All cells", _all_cells(cells, names)),
        ]
    estimators = ", ".join(dict.fromkeys(str(cell["estimator"]) for cell in cells))
    return page(f"Sweep · {estimators} – abreast", _head(results), sections, SWITCH if cells else "")


def _head(results: Mapping[str, Any]) -> str:
    cells: Sequence[Cell] = results["cells"]
    verdict = sweep_verdict(results)
    samples = sum(int(cell["samples"]) for cell in cells)
    off = [text for cell in cells if (text := nees_finding(cell))]
    facts = {
        "sweep": f"{len(cells)} cells, {sum(int(cell['runs']) for cell in cells)} runs, {samples} samples",
        "simulated": f"{_duration(float(results['run_seconds']))} of driving",
        "took": _duration(float(results["wall_s"])),
    }
    if off:
        facts["nees"] = f"in {len(off)} of {len(cells)} cells deviations are not what errors are; {off[0]}"
    listed = "".join(f"<dt>{name}</dt><dd>{escape(text)}</dd>" for name, text in facts.items())
    others = "".join(f"<li>{escape(text)}</li>" for text in verdict.others)
    return (
        f'{FRAME_STYLE}<h1>Sweep over noise</h1>\n<div class="verdict{" bad" if verdict.bad else ""}">'
        f"<p><strong>{escape(verdict.text)}</strong></p>"
        + (f"<ul>{others}</ul>" if others else "")
        + f"</div>\n<dl>{listed}</dl>\n"
    )


def _by_estimator(cells: Sequence[Cell]) -> str:
    """A row for each estimator; medians over the same cells for all, that none looks good for giving up."""
    asked, foils = estimators_of(cells)
    lost = {point_of(cell) for cell in cells if str(cell["estimator"]) in asked and not is_sound(cell)}
    rows = []
    for estimator in (*asked, *foils):
        own = [cell for cell in cells if str(cell["estimator"]) == estimator]
        judged = [cell for cell in own if point_of(cell) not in lost and is_known(cell)]
        rows.append(
            (
                f"{estimator} (foil)" if estimator in foils else estimator,
                str(sum(int(cell["runs"]) for cell in own)),
                str(sum(int(cell["diverged"]) for cell in own)),
                f"{len(judged)} of {len(own)}",
                *(
                    _median([cell.get("efficiency", {}).get(name) for cell in judged])
                    for name in ("v1", "alpha1")
                ),
                _median([cell.get("nis_mean") for cell in judged]),
                *(_median([cell.get("nees", {}).get(name) for cell in judged]) for name in ("v1", "alpha1")),
                str(sum(bool(nees_finding(cell)) for cell in own)),
                *(str(sum(violations(cell, form) for cell in own)) for form in FORMS),
            )
        )
    header = (
        *("", "runs", "diverged", "cells in medians", "v₁ / bound", "α₁ / bound"),
        *("NIS", "v₁ NEES", "α₁ NEES", "cells with NEES off"),
    )
    violated = tuple(f"outside {form}" for form in FORMS)
    caption = (
        "Medians over the cells in which no run of the estimators asked about diverged; the bound is that "
        "for random leaders; violations in samples"
    )
    return framed(table_html(caption, (*header, *violated), rows))


def _worst(cells: Sequence[Cell], names: Sequence[str]) -> str:
    """The cells in which runs diverged or bounds were nearest to breaking, of the estimators asked about."""
    asked, _ = estimators_of(cells)
    own = [place for place, cell in enumerate(cells) if str(cell["estimator"]) in asked]
    order = sorted(own, key=lambda n: (-int(cells[n]["diverged"]), -(tightest(cells[n]) or 0.0)))
    caption = "By runs that diverged, then by the largest error over its extended bound"
    return cell_table(caption, cells, order[:_WORST], names, anchors=False)


def _all_cells(cells: Sequence[Cell], names: Sequence[str]) -> str:
    table = cell_table("In the order of results.json", cells, range(len(cells)), names, anchors=True)
    return f"<details><summary>{len(cells)} cells</summary>{table}</details>"


def _name(cell: Cell) -> str:
    noise = f"{1e3 * float(cell['sigma_position']):g} mm, {degrees(float(cell['sigma_heading'])):.3g}°"
    return f"{cell['estimator']}, {noise}, {slice_name(slice_of(cell))}"


def _median(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{float(np.median(known)):.2f}" if known else "–"


def _duration(seconds: float) -> str:
    for unit, length in (("days", 86_400.0), ("h", 3_600.0), ("min", 60.0)):
        if seconds >= 2.0 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.1f} s"
