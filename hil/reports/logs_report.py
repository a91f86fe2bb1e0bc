"""The page of many logs judged in one go: how many are sound, the worst by name, all of them side by side."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

from hil.judge.dotted_figures import HEADLINES, bare, figures_of
from hil.reports.colours import BLUE
from hil.reports.page import Section, page
from hil.reports.plot_models import Field, Model, Value, source_of
from hil.reports.plots import Panel, blank, hover, lead_on
from hil.reports.run_tables import QUANTITIES, scale_of
from hil.reports.scroll_frame import FRAME_STYLE, framed_rows

_UNITS = {
    "estimation.rmse.v1": (QUANTITIES["v1"][1], scale_of("v1")),
    "estimation.rmse.alpha1": (QUANTITIES["alpha1"][1], scale_of("alpha1")),
    "formation.orbit_deviation_rms.rho": ("mm", 1e3),
}
_HEIGHT = 240


def logs_report(result: Mapping[str, Any], folder: Path) -> str:
    """HTML of a page that needs nothing but itself, from the JSON of ``replay`` of a folder of logs.

    ``folder``: where the page is, for links to logs. Logs that have a ``report`` are linked to it.
    """
    rows: Sequence[Mapping[str, Any]] = result["logs"]
    root = Path(str(result["folder"]))
    why = {each["log"]: each["why"] for each in result["worst"]}
    places = {str(row["log"]): n for n, row in enumerate(rows)}
    worst = [(places[log], reason) for log, reason in why.items()]
    broken = [(n, _said(row)) for n, row in enumerate(rows) if "error" in row]
    every = [(n, _said(row)) for n, row in enumerate(rows)]
    table = _Table(rows, root, folder)
    sections = [
        Section("The worst", table.html(worst)),
        Section("Could not be judged", table.html(broken, figures=False)),
        Section("All logs over each other", panels=_panels(rows), narrow=True),
        Section(
            "All logs",
            f"<details><summary>{len(rows)} logs</summary>{table.html(every, anchors=True)}</details>",
        ),
    ]
    return page(f"{root.name} · {len(rows)} logs – abreast", _head(result, root), sections)


def logs_verdict(result: Mapping[str, Any]) -> str:
    """How it went, in a sentence."""
    total = len(result["logs"])
    parts = [f"{result['judged']} of {total} logs judged"]
    if result["broken"]:
        parts.append(f"{result['broken']} could not be")
    parts.append(f"{result['failed']} failed a check" if result["failed"] else "none failed a check")
    return ", ".join(parts) + ("; broken off before its end" if result.get("interrupted") else "") + "."


def headlines_of(row: Mapping[str, Any]) -> dict[str, str]:
    """Headlines of a log in their units, of a chain the largest of its pairs; a dash where not known."""
    found = figures_of(row.get("summary", {}))
    shown = {}
    for name in HEADLINES:
        values = [value for figure, value in found.items() if bare(figure) == name]
        unit, scale = _UNITS[name]
        shown[f"{HEADLINES[name]} [{unit}]"] = f"{scale * max(values):.3g}" if values else "–"
    return shown


def _head(result: Mapping[str, Any], root: Path) -> str:
    bad = bool(result["broken"] or result["failed"] or result.get("interrupted"))
    choice = ", ".join(f"{name} {value}" for name, value in result.get("choice", {}).items())
    facts = {"folder": str(root), "took": f"{float(result['wall_s']):.1f} s", "version": result["version"]}
    if choice:
        facts["replayed by"] = choice
    listed = "".join(f"<dt>{name}</dt><dd>{escape(str(text))}</dd>" for name, text in facts.items())
    first = result["worst"][0] if result["worst"] else None
    worst = f"<ul><li>Worst: {escape(first['log'])}: {escape(first['why'])}</li></ul>" if first else ""
    return (
        f'{FRAME_STYLE}<h1>{escape(root.name)}</h1>\n<div class="verdict{" bad" * bad}">'
        f"<p><strong>{escape(logs_verdict(result))}</strong></p>{worst}</div>\n<dl>{listed}</dl>\n"
    )


@dataclass(frozen=True, slots=True)
class _Table:
    """Rows of logs with links from a page in ``folder`` to what is below ``root``."""

    rows: Sequence[Mapping[str, Any]]
    root: Path
    folder: Path

    def html(self, told: Sequence[tuple[int, str]], *, figures: bool = True, anchors: bool = False) -> str:
        """Rows at some places with what is said of each; empty without any."""
        header = ("log", "what stands out", *(headlines_of({}) if figures else ()), "a closer look")
        lines = [self._line(place, text, figures=figures, anchors=anchors) for place, text in told]
        return framed_rows("", header, lines).replace('class="wide firm"', 'class="wide firm told"')

    def _line(self, place: int, text: str, *, figures: bool, anchors: bool) -> str:
        row = self.rows[place]
        name, mark = escape(str(row["log"])), f' id="log-{place}"' if anchors else ""
        said = f'<td class="said">{escape(text)}</td>'
        shown = headlines_of(row).values() if figures else ()
        links = [f'<a href="{_address(self.root / str(row["log"]), self.folder)}">log</a>']
        if "report" in row:
            links.insert(0, f'<a href="./{quote(str(row["report"]))}">report</a>')
        cells = "".join(f"<td>{each}</td>" for each in (*shown, ", ".join(links)))
        return f'<tr{mark}><th scope="row">{name}</th>{said}{cells}</tr>\n'


def _said(row: Mapping[str, Any]) -> str:
    return str(row.get("error", "; ".join(row.get("failed", []))))


def _panels(rows: Sequence[Mapping[str, Any]]) -> list[Panel]:
    """Every log as a point, for each headline in the order of its values; a point leads to its row."""
    panels = []
    for name, title in HEADLINES.items():
        unit, scale = _UNITS[name]
        known = sorted(
            (scale * value, place)
            for place, row in enumerate(rows)
            for figure, value in figures_of(row.get("summary", {})).items()
            if bare(figure) == name
        )
        if len(known) < 2:
            continue
        values = [value for value, _ in known]
        plot = blank(
            height=_HEIGHT,
            x_label="share of logs below [%]",
            y_label=f"[{unit}]",
            x_range=Model("Range1d", start=-3.0, end=103.0),
            y_range=Model("Range1d", start=0.0, end=1.08 * values[-1] or 1.0),
        )
        source = source_of(
            {
                "x": [100.0 * n / (len(known) - 1) for n in range(len(known))],
                "y": values,
                "log": [str(rows[place]["log"]) for _, place in known],
                "href": [f"#log-{place}" for _, place in known],
            }
        )
        look = {"size": Value(8.0), "fill_color": Value(BLUE), "fill_alpha": Value(0.5)}
        dots = Model("Scatter", x=Field("x"), y=Field("y"), line_color=Value(BLUE), **look)
        drawn = plot.add_glyph(source, dots)
        hover(plot, drawn, {"@log": f"@y{{0.000}} {unit}"}, mode="mouse")
        lead_on(plot, drawn)
        panels.append(Panel(title, "A point is a log; a tap leads to its row.", (), plot))
    return panels


def _address(path: Path, folder: Path) -> str:
    return quote(os.path.relpath(path, folder.absolute()))
