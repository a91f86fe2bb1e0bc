"""The report of a run or a replay: the verdict and the picture first, then all that they rest on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from hil.figures.plot_data import PlotData
from hil.reports.bound_plot import tightness_panel
from hil.reports.command_plots import command_panels, stops_of
from hil.reports.estimate_plots import estimate_panels
from hil.reports.filter_plots import latency_panel, nis_panel, status_panel
from hil.reports.notation import written
from hil.reports.page import Section, Timeline, page
from hil.reports.plots import Panel, TimeAxis
from hil.reports.provenance import provenance_html
from hil.reports.reasons import finding_name, verdict_html, warnings_html
from hil.reports.run_tables import stops_table, summary_tables
from hil.reports.shape_plots import COURSE, shape_panels
from hil.reports.spell_list import spell_list
from hil.reports.track_plot import track_panel

_READOUT = (("rho", "ρ", "m", 3), ("alpha1", "α₁", "deg", 1), ("alpha2", "α₂", "deg", 1))


def run_report(data: PlotData, summary: Mapping[str, Any]) -> str:
    """HTML of a page that needs nothing but itself; ``summary`` is that of the same run data.

    What cannot be known is left out. Depends on its arguments alone, and on the version of Bokeh.
    """
    run, span = data.columns.run, data.columns.span
    moments = data.seconds(np.array([run.from_ns, run.to_ns, span.from_ns]))
    spells = [(spell["from_s"], spell["to_s"]) for spell in summary.get("spells", [])]
    first, last, judged_from = moments.tolist()
    axis = TimeAxis(first, last, judged_from, spells)
    shapes = shape_panels(data, axis)
    readout = [(symbol, unit, digits, COURSE + name) for name, symbol, unit, digits in _READOUT if shapes]
    title = f"{' · '.join(_names(summary))} – abreast"
    head = f"<h1>{escape(' · '.join(_names(summary)))}</h1>\n{verdict_html(summary)}"
    timeline = Timeline(axis.first, axis.last, readout)
    return page(title, head, _sections(data, axis, shapes, summary), timeline=timeline)


def _sections(
    data: PlotData, axis: TimeAxis, shapes: Sequence[Panel], summary: Mapping[str, Any]
) -> list[Section]:
    tables = summary_tables(summary)
    glance = [*_known(track_panel(data)), *shapes[:2]]

    def part(heading: str, *judged: str, html: str = "", panels: Sequence[Panel] = ()) -> Section:
        """A section: what deserves a second look in it, its plots, its tables."""
        warned = "".join(warnings_html(summary, each) for each in judged)
        place = heading.lower()
        return Section(heading, f"{warned}{html}", panels, below=tables.get(place, ""), anchor=place)

    return [
        Section("Bad spells", spell_list(summary)),
        Section("At a glance", panels=glance, below=_shaded(axis) if glance else "", quiet=True),
        part("Formation", "formation", panels=shapes[2:]),
        part(
            "Estimates",
            "tracking",
            panels=[
                *estimate_panels(data, axis),
                *_known(status_panel(data, axis)),
                *_known(nis_panel(data, axis)),
            ],
        ),
        part("Bounds", "bounds", html=_premises(summary), panels=_known(tightness_panel(data, axis))),
        part("Commands", "saturation", html=stops_table(stops_of(data)), panels=command_panels(data, axis)),
        part("Latency", "latency", panels=_known(latency_panel(data, axis))),
        part("Findings", html=_findings(summary)),
        part("Certificate"),
        Section("How it was made", provenance_html(data.run_data, summary)),
        Section("Other figures", tables["others"]),
    ]


def _known(panel: Panel | None) -> list[Panel]:
    return [] if panel is None else [panel]


def _shaded(axis: TimeAxis) -> str:
    says = "All plots over time zoom together."
    if axis.judged_from > axis.first:
        says = f"What is shaded in the plots, before {axis.judged_from:.3g} s, is not judged. {says}"
    if axis.spells:
        says = f"Bad spells are shaded in red. {says}"
    return f'<p class="soft">{says}</p>'


def _premises(summary: Mapping[str, Any]) -> str:
    """What the two kinds of bounds rest on, in words, where there are any."""
    if "violations" not in summary["bounds"]:
        return ""
    return (
        '<p class="soft">Bounds as published rest on the noise and the leader limits of the scenario alone, '
        "were known at the time, and can fail. Those by the largest errors seen tell whether the formulas "
        "are right, and can hardly fail.</p>"
    )


def _findings(summary: Mapping[str, Any]) -> str:
    """What nodes and judge found to be wrong, with what to do about it."""
    if "findings" not in summary:
        return ""
    listed = "".join(
        f"<dt>{escape(finding_name(finding))}</dt>"
        f"<dd>{escape(written(str(finding['text'])))}; {escape(str(finding['advice']))}</dd>"
        for finding in summary["findings"]
    )
    if listed:
        return f"<dl>{listed}</dl>"
    if summary.get("spells"):
        return '<p>Nodes and judge named no cause; see <a href="#bad-spells">the bad spells</a>.</p>'
    return "<p>Nothing was found to be wrong.</p>"


def _names(summary: Mapping[str, Any]) -> list[str]:
    """What was run, by what, how."""
    named = [str(summary["scenario"]) or "recording", str(summary["estimator"])]
    if "seed" in summary:
        named.append(f"seed {summary['seed']}")
    return [*named, str(summary["mode"])]
