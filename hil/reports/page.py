"""A web page in one file: headings, tables and Bokeh plots, with all it needs inside."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from hil.reports.page_style import STYLE
from hil.reports.plot_models import Figure, bokeh_script, document_of
from hil.reports.plots import Key, Panel

_DOCUMENT = "plots"
# Nothing outside the file may be asked for, whatever it holds: a browser enforces it.
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"

_DRAW = """
Bokeh.embed.embed_items(JSON.parse(document.getElementById("plots").textContent), %s).then(() => {
  if (!matchMedia("(pointer: fine)").matches) return; // a finger that drags scrolls the page
  for (const plot of Bokeh.documents[0].roots())
    for (const tool of plot.toolbar.tools) if (tool.type === "BoxZoomTool") tool.active = true;
});
"""

_SWATCHES = {
    "line": "border-top:3px solid {0}",
    "dashed": "border-top:3px dashed {0}",
    "dotted": "border-top:3px dotted {0}",
    "band": "height:.8rem;background:{0};opacity:.3",
}
_SIGNS = {"dot": "●", "cross": "✕", "triangle": "▲"}


@dataclass(frozen=True, slots=True)
class Section:
    """A part of a page: its heading, ready HTML under it, and plots in a grid; ``narrow``: three in a row."""

    heading: str
    html: str = ""
    panels: Sequence[Panel] = ()
    narrow: bool = False


def page(title: str, head: str, sections: Sequence[Section], script: str = "") -> str:
    """The whole page. ``title``: of the window; ``head``: ready HTML before the first section.

    ``script``: JavaScript that runs once the page is there. A section with neither HTML nor panels is left
    out.
    """
    filled = [section for section in sections if section.html or section.panels]
    places = {
        f"plot{n}": panel for n, panel in enumerate(panel for section in filled for panel in section.panels)
    }
    place_of = {id(panel): place for place, panel in places.items()}
    body = "\n".join(_section(section, place_of) for section in filled)
    plots = _plots({place: panel.plot for place, panel in places.items()}) if places else ""
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(title)}</title>\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        f'<link rel="icon" href="data:,">\n<style>{STYLE}</style>\n</head>\n'
        f"<body>\n<header>\n{head}\n</header>\n<main>\n{body}\n</main>\n{plots}"
        + (f"<script>{script}</script>\n" if script else "")
        + "</body>\n</html>\n"
    )


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


def _section(section: Section, place_of: Mapping[int, str]) -> str:
    figures = "\n".join(_figure(panel, place_of[id(panel)]) for panel in section.panels)
    layout = "grid narrow" if section.narrow else "grid"
    grid = f'<div class="{layout}">\n{figures}\n</div>' if figures else ""
    return f"<section>\n<h2>{escape(section.heading)}</h2>\n{section.html}\n{grid}\n</section>"


def _figure(panel: Panel, place: str) -> str:
    """A plot in its place, which is kept free until it is drawn, with legend and words."""
    keys = "".join(f"<li>{_swatch(key)}{escape(key.label)}</li>" for key in panel.keys)
    legend = f'<ul class="keys">{keys}</ul>' if keys else ""
    name = escape(f"{panel.title}. {panel.says}")
    tall = ' class="tall"' if panel.tall else ""
    return (
        f"<figure{tall}><h3>{escape(panel.title)}</h3>{legend}\n"
        f'<div id="{place}" role="img" aria-label="{name}" style="min-height:{panel.plot.height}px"></div>\n'
        f"<figcaption>{escape(panel.says)}</figcaption></figure>"
    )


def _swatch(key: Key) -> str:
    if key.style in _SIGNS:
        return f'<span aria-hidden="true" style="color:{key.colour}">{_SIGNS[key.style]}</span>'
    return f'<span aria-hidden="true" style="{_SWATCHES[key.style].format(key.colour)}"></span>'


def _plots(plots: Mapping[str, Figure]) -> str:
    """Bokeh's own code, the plots as data, and the call that draws them in their places."""
    document, numbers = document_of(list(plots.values()))
    item = {"docid": _DOCUMENT, "roots": dict(zip(numbers, plots, strict=True)), "root_ids": numbers}
    data = _json({_DOCUMENT: document}).replace("</", "<\\/")
    return (
        "<noscript><p>The plots need JavaScript; the tables above do not.</p></noscript>\n"
        f'<script>{bokeh_script()}\nBokeh.set_log_level("warn");</script>\n'
        f'<script type="application/json" id="{_DOCUMENT}">{data}</script>\n'
        f"<script>{_DRAW % _json([item])}</script>\n"
    )


def _json(value: object) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)
