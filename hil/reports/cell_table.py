"""Cells of a sweep as a table: a row each, which pages and maps can point at, with links to kept runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from urllib.parse import quote

from hil.reports.scroll_frame import framed_rows
from hil.reports.sweep_cells import Cell, is_known, number

_HEADER = ("cell", "runs", "diverged", "v₁ [mm/s]", "α₁ [deg]", "error / bound", "ρ [m]", "a closer look")


def cell_table(
    caption: str, cells: Sequence[Cell], places: Sequence[int], names: Sequence[str], *, anchors: bool
) -> str:
    """Rows of the cells at these places. ``anchors``: whether it is these rows that maps lead to."""
    rows = [_row(cells[place], place, names[place], anchors=anchors) for place in places]
    return framed_rows(caption, _HEADER, rows)


def address_of(cell: Cell, place: int) -> str:
    """Where a cell's map leads: to the first of its runs that were kept, else to its row."""
    kept: Mapping[str, str] = cell.get("kept", {})
    return f"{_folder(next(iter(kept.values())))}/report.html" if kept else f"#cell-{place}"


def tightest(cell: Cell) -> float | None:
    """Largest share of an extended bound that an error of the cell used up; None where none is known."""
    shares: Mapping[str, object] = cell.get("bounds", {}).get("tightness", {})
    found = [number(shares.get(f"{name}_extended")) for name in ("v1", "alpha1", "h")]
    return max((share for share in found if share is not None), default=None) if is_known(cell) else None


def _row(cell: Cell, place: int, name: str, *, anchors: bool) -> str:
    rmse, formation = cell.get("rmse", {}) if is_known(cell) else {}, cell.get("formation", {})
    share, diverged = tightest(cell), int(cell["diverged"])
    between = "–"
    if "rho_min" in formation:
        between = f"{formation['rho_min']:.3f} to {formation['rho_max']:.3f}"
    figures = (
        str(cell["runs"]),
        str(diverged),
        f"{1e3 * rmse['v1']:.3g}" if "v1" in rmse else "–",
        f"{math.degrees(rmse['alpha1']):.3g}" if "alpha1" in rmse else "–",
        "–" if share is None else f"{share:.1%}",
        between,
    )
    cells = "".join(
        f'<td class="bad">{each}</td>' if n == 1 and diverged else f"<td>{each}</td>"
        for n, each in enumerate(figures)
    )
    mark = f' id="cell-{place}"' if anchors else ""
    head = f'<th scope="row">{place}: {escape(name)}</th>'
    return f"<tr{mark}>{head}{cells}<td>{_look_closer(cell, place)}</td></tr>"


def _look_closer(cell: Cell, place: int) -> str:
    """Links to the reports and logs of a cell's runs that were kept, else how to get the worst one."""
    kept: Mapping[str, str] = cell.get("kept", {})
    if kept:
        return "; ".join(
            f'<a href="{_folder(folder)}/report.html">run {escape(run)}</a>, '
            f'<a href="{_folder(folder)}/run.mcap">its log</a>'
            for run, folder in kept.items()
        )
    return f"<code>--keep {place}:{int(cell['worst_run'])}</code>" if "worst_run" in cell else ""


def _folder(name: str) -> str:
    return "./" + quote(name.lstrip("/"))
