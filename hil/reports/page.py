"""A web page in one file: headings, tables and Bokeh plots, with all it needs inside."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from hil.reports.colours import reference
from hil.reports.page_script import THEME, TIME, TOOLS, drawing
from hil.reports.page_style import STYLE
from hil.reports.plot_models import Figure, bokeh_script, document_of
from hil.reports.plots import Key, Panel

_DOCUMENT = "plots"
# Nothing outside the file may be asked for, whatever it holds: a browser enforces it.
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"

_SWATCHES = {
    "line": "border-top:3px solid {0}",
    "dashed": "border-top:3px dashed {0}",
    "dotted": "border-top:3px dotted {0}",
    "band": "height:.8rem;background:{0};opacity:.3",
}
_TOOLS = (
    ("zoom", "Zoom", "Drag a frame to zoom into it"),
    ("move", "Move", "Drag to move what a plot shows"),
    ("wheel", "Wheel", "Zoom with the wheel, or with two fingers"),
)
_SIGNS = {"dot": "●", "cross": "✕", "triangle": "▲"}


@dataclass(frozen=True, slots=True)
class Section:
    """A part of a page: its heading, ready HTML under it, and plots in a grid; ``narrow``: three in a row.

    ``below``: ready HTML under the plots; ``quiet``: with a heading that is heard but not seen;
    ``anchor``: its place in the page, made of the heading where none is given.
    """

    heading: str
    html: str = ""
    panels: Sequence[Panel] = ()
    narrow: bool = False
    below: str = ""
    quiet: bool = False
    anchor: str = ""

    @property
    def place(self) -> str:
        """What a link to it ends in."""
        return self.anchor or slug(self.heading)

    @property
    def filled(self) -> bool:
        """Whether there is anything to show."""
        return bool(self.html or self.panels or self.below)


@dataclass(frozen=True, slots=True)
class Timeline:
    """From when to when the time slider goes [s], and the courses whose values it tells.

    ``readout``: symbol, unit, digits behind the point, and the name of the data, which have t and y.
    """

    first: float
    last: float
    readout: Sequence[tuple[str, str, int, str]] = ()


def page(
    title: str,
    head: str,
    sections: Sequence[Section],
    script: str = "",
    timeline: Timeline | None = None,
) -> str:
    """The whole page. ``title``: of the window; ``head``: ready HTML before the first section.

    ``script``: JavaScript that runs once the page is there. A section with neither HTML nor panels is left
    out. With a ``timeline`` a bar at the bottom moves all that is drawn over time.
    """
    filled = [section for section in sections if section.filled]
    places = {
        f"plot{n}": panel for n, panel in enumerate(panel for section in filled for panel in section.panels)
    }
    place_of = {id(panel): place for place, panel in places.items()}
    body = "\n".join(_section(section, place_of) for section in filled)
    plots = _plots({place: panel.plot for place, panel in places.items()}) if places else ""
    moved = timeline is not None and bool(places)
    zooms = any(_has_zoom(panel.plot) for panel in places.values())
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(title)}</title>\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        f'<link rel="icon" href="data:,">\n<style>{STYLE}</style>\n</head>\n'
        f"<body>\n{_top(filled)}\n<header>\n{head}\n</header>\n<main>\n{body}\n</main>\n"
        + (_bar(timeline) if moved or zooms else "")
        + f"<script>{THEME}</script>\n{plots}"
        + (f"<script>{TIME}</script>\n" if moved else "")
        + (f"<script>{TOOLS}</script>\n" if moved or zooms else "")
        + (f"<script>{script}</script>\n" if script else "")
        + "</body>\n</html>\n"
    )


def slug(words: str) -> str:
    """Words as the end of a link."""
    return re.sub(r"\W+", "-", words.lower()).strip("-")


def table_html(
    caption: str, header: Sequence[str], rows: Sequence[Sequence[str]], *, long: bool = False
) -> str:
    """A table of texts; the first column names the rows. Empty without rows. ``long``: words may break."""
    if not rows:
        return ""
    head = "".join(f'<th scope="col">{escape(each)}</th>' for each in header)
    lines = "\n".join(
        f'<tr><th scope="row">{escape(first)}</th>'
        + "".join(f"<td>{escape(each)}</td>" for each in rest)
        + "</tr>"
        for first, *rest in rows
    )
    top = f"<thead><tr>{head}</tr></thead>" if header else ""
    broken = ' class="long"' if long else ' class="many"' if len(header) > 5 else ""
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f'<div class="wide"><table{broken}>{title}{top}\n<tbody>{lines}</tbody></table></div>'


def _top(sections: Sequence[Section]) -> str:
    """Contents, and the button that changes the scheme."""
    links = "".join(
        f'<li><a href="#{section.place}">{escape(section.heading)}</a></li>' for section in sections
    )
    switch = '<button id="theme" aria-label="Dark or light" title="Dark or light">◐</button>'
    return f'<div class="top"><nav aria-label="Contents"><ul>{links}</ul></nav>{switch}</div>'


def _section(section: Section, place_of: Mapping[int, str]) -> str:
    figures = "\n".join(_figure(panel, place_of[id(panel)]) for panel in section.panels)
    layout = "grid narrow" if section.narrow else "grid"
    grid = f'<div class="{layout}">\n{figures}\n</div>' if figures else ""
    hidden = ' class="hidden"' if section.quiet else ""
    heading = f"<h2{hidden}>{escape(section.heading)}</h2>"
    return f'<section id="{section.place}">\n{heading}\n{section.html}\n{grid}\n{section.below}\n</section>'


def _bar(timeline: Timeline | None) -> str:
    """The time slider, what there was at that time, and what a drag in a plot does."""
    tools = "".join(
        f'<button id="{name}" aria-pressed="false" title="{escape(says)}">{escape(label)}</button>'
        for name, label, says in _TOOLS
    )
    return (
        '<div class="bar" id="bar" role="group" aria-label="Tools of all plots" hidden>'
        + ("" if timeline is None else _slider(timeline))
        + '<button id="more" aria-expanded="false" aria-label="Zoom and move plots">⤢</button>'
        f'<div class="tools">{tools}<button id="whole">Whole run</button></div></div>\n'
    )


def _slider(timeline: Timeline) -> str:
    readout = " · ".join(
        f'{escape(symbol)} <span data-course="{name}" data-digits="{digits}">–</span> {escape(unit)}'
        for symbol, unit, digits, name in timeline.readout
    )
    return (
        '<button id="play" aria-label="Play">▶&#xfe0e;</button>'
        f'<input type="range" id="time" aria-label="Time" min="{timeline.first:.6g}" '
        f'max="{timeline.last:.6g}" step="any" value="{timeline.last:.6g}">'
        f'<output id="shown" for="time">{timeline.last:.2f} s</output>'
        + (f'<span class="readout">{readout}</span>' if readout else "")
    )


def _has_zoom(plot: Figure) -> bool:
    return any(tool.kind == "BoxZoomTool" for tool in plot.attributes["toolbar"].attributes["tools"])


def _figure(panel: Panel, place: str) -> str:
    """A plot in its place, which is kept free until it is drawn, with legend and words."""
    keys = "".join(f"<li>{_swatch(key)}{escape(key.label)}</li>" for key in panel.keys)
    legend = f'<ul class="keys">{keys}</ul>' if keys else ""
    name = escape(f"{panel.title}. {panel.says}")
    tall = ' class="tall"' if panel.tall else ""
    anchor = f' id="{panel.anchor}"' if panel.anchor else ""
    return (
        f"<figure{tall}{anchor}><h3>{escape(panel.title)}</h3>{legend}\n"
        f'<div id="{place}" role="img" aria-label="{name}" style="min-height:{panel.plot.height}px"></div>\n'
        f"<figcaption>{escape(panel.says)}</figcaption></figure>"
    )


def _swatch(key: Key) -> str:
    if key.style in _SIGNS:
        return f'<span aria-hidden="true" style="color:{reference(key.colour)}">{_SIGNS[key.style]}</span>'
    return f'<span aria-hidden="true" style="{_SWATCHES[key.style].format(reference(key.colour))}"></span>'


def _plots(plots: Mapping[str, Figure]) -> str:
    """Bokeh's own code, the plots as data, and the call that draws them in their places."""
    document, numbers = document_of(list(plots.values()))
    item = {"docid": _DOCUMENT, "roots": dict(zip(numbers, plots, strict=True)), "root_ids": numbers}
    data = _json({_DOCUMENT: document}).replace("</", "<\\/")
    return (
        "<noscript><p>The plots need JavaScript; the tables above do not.</p></noscript>\n"
        f'<script>{bokeh_script()}\nBokeh.set_log_level("warn");</script>\n'
        f'<script type="application/json" id="{_DOCUMENT}">{data}</script>\n'
        f"<script>{drawing(_json([item]))}</script>\n"
    )


def _json(value: object) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)
