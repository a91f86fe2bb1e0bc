"""The report of a run or a replay: its verdict, its figures and its plots on one page."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np

from hil.figures.plot_data import PlotData
from hil.judge.summary_text import BAD, GOOD, verdict_lines, warnings_of
from hil.reports.bound_plot import tightness_panel
from hil.reports.command_plots import command_panels, stops_of
from hil.reports.estimate_plots import estimate_panels
from hil.reports.filter_plots import latency_panel, nis_panel, status_panel
from hil.reports.page import Section, Timeline, page
from hil.reports.plots import TimeAxis
from hil.reports.run_tables import stops_table, summary_tables
from hil.reports.shape_plots import COURSE, shape_panels
from hil.reports.track_plot import track_panel

_MARKS = {GOOD: ("good", "✓ "), BAD: ("bad", "✗ ")}


_READOUT = (("rho", "ρ", "m", 3), ("alpha1", "α₁", "rad", 2), ("alpha2", "α₂", "rad", 2))


def run_report(data: PlotData, summary: Mapping[str, Any]) -> str:
    """HTML of a page that needs nothing but itself; ``summary`` is that of the same run data.

    What cannot be known is left out. Depends on its arguments alone, and on the version of Bokeh.
    """
    run, span = data.columns.run, data.columns.span
    moments = data.seconds(np.array([run.from_ns, run.to_ns, span.from_ns]))
    axis = TimeAxis(*moments.tolist())
    tracks = track_panel(data)
    shapes = shape_panels(data, axis)
    sections = [
        Section("At a glance", panels=[*([tracks] if tracks else []), *shapes[:2]], quiet=True),
        Section("Formation", panels=shapes[2:]),
        Section(
            "What the follower believed of the leader",
            panels=[*estimate_panels(data, axis), *filter(None, [tightness_panel(data, axis)])],
        ),
        Section("What the follower was told to do", stops_table(stops_of(data)), command_panels(data, axis)),
        Section("Figures", summary_tables(summary)),
        Section(
            "How the estimates came about",
            panels=list(
                filter(None, (panel(data, axis) for panel in (status_panel, nis_panel, latency_panel)))
            ),
        ),
    ]
    readout = [(symbol, unit, digits, COURSE + name) for name, symbol, unit, digits in _READOUT if shapes]
    shaded = ""
    if axis.judged_from > axis.first:
        shaded = (
            f'<p class="soft">What is shaded in the plots, before {axis.judged_from:.3g} s, is not judged. '
            "All plots over time zoom together.</p>"
        )
    timeline = Timeline(axis.first, axis.last, readout)
    title = f"{' · '.join(_names(summary))} – abreast"
    return page(title, _head(summary) + shaded, sections, timeline=timeline)


def _names(summary: Mapping[str, Any]) -> list[str]:
    """What was run, by what, how."""
    named = [str(summary["scenario"]) or "recording", str(summary["estimator"])]
    if "seed" in summary:
        named.append(f"seed {summary['seed']}")
    return [*named, str(summary["mode"])]


def _head(summary: Mapping[str, Any]) -> str:
    warnings = warnings_of(summary)
    lines = list(verdict_lines(summary))
    broken = [finding for _, finding, style in lines if style == BAD]
    if broken:
        verdict = f"{broken[0][0].upper()}{broken[0][1:]}."
    elif warnings:
        verdict = "One thing deserves" if len(warnings) == 1 else f"{len(warnings)} things deserve"
        verdict += " a second look."
    else:
        verdict = "Nothing speaks against it."
    colour = "verdict bad" if broken else "verdict"
    listed = "".join(f"<li>{escape(warning)}</li>" for warning in warnings)
    report_lines = "".join(
        f"<dt>{escape(name)}</dt>{_finding(finding, style)}" for name, finding, style in lines
    )
    return (
        f"<h1>{escape(' · '.join(_names(summary)))}</h1>\n"
        f'<div class="{colour}"><p><strong>{escape(verdict)}</strong></p>'
        + (f"<ul>{listed}</ul>" if listed else "")
        + f"</div>\n<dl>{report_lines}</dl>\n"
    )


def _finding(text: str, style: str) -> str:
    name, sign = _MARKS.get(style, ("", ""))
    return f'<dd class="{name}">{sign}{escape(text)}</dd>' if name else f"<dd>{escape(text)}</dd>"
