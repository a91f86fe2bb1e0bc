"""How cells of a heat map look: coloured by how good they are, or marked as what cannot be judged."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

from bokeh.palettes import Cividis256

from hil.reports.sweep_cells import Cell

_BRIGHT = 0.18
"""Relative luminance above which black letters stand out more than white ones."""
_GREY, _PALE, _BLACK, _WHITE = "#b4b4b4", "#dcdcdc", "#000000", "#ffffff"
_PLAIN, _LINES, _CROSSES = "blank", "right_diagonal_line", "diagonal_cross"
LOOKS = ("fill", "ink", "text", "tip", "hatch", "href")
"""Fields of a look, which are columns of a map's data."""
KEPT = "↗"
DIVERGED = "✕"


@dataclass(frozen=True, slots=True)
class Look:
    """Colour, colour and text of the letters, what is told under the pointer, hatching, where a tap leads."""

    fill: str
    ink: str
    text: str
    tip: str
    hatch: str
    href: str


ABSENT = Look("rgba(0, 0, 0, 0)", _BLACK, "", "not in the sweep", _PLAIN, "#over-noise")


def coloured(share: float, text: str, tip: str, href: str) -> Look:
    """A cell that was judged. ``share``: from 0, the best, yellow, to 1, the worst, dark blue."""
    colour = Cividis256[255 - round(255 * min(max(share, 0.0), 1.0))]
    return Look(colour, ink_on(colour), _marked(text, href), tip, _PLAIN, href)


def unjudged(cell: Cell, tip: str, href: str) -> Look:
    """A cell that must not be taken for a good one: runs of it diverged, it is empty, or nothing is known."""
    diverged, runs = int(cell["diverged"]), int(cell["runs"])
    if diverged and diverged >= runs:
        return Look(_GREY, _BLACK, _marked(f"all {DIVERGED}", href), f"all diverged; {tip}", _CROSSES, href)
    if diverged:
        return Look(_PALE, _BLACK, _marked(f"{diverged} {DIVERGED}", href), f"diverged; {tip}", _LINES, href)
    if not int(cell["samples"]):
        return Look(_GREY, _BLACK, _marked("none", href), f"no estimate tracked; {tip}", _CROSSES, href)
    return Look(_PALE, _BLACK, _marked("–", href), f"not known; {tip}", _PLAIN, href)


def marked_lost(text: str, tip: str) -> Look:
    """A cell that is compared with another, of which runs of one diverged or nothing is known."""
    return Look(_PALE, _BLACK, text, tip, _LINES if DIVERGED in text else _PLAIN, "#")


def legend_html() -> str:
    """What colours and hatchings mean, in words and samples."""
    stops = ", ".join(Cividis256[place] for place in (255, 191, 127, 63, 0))
    lines = "#0000 0 4px, #0006 4px 5px"
    marks = (
        (f"background:linear-gradient(to right, {stops}); width:5rem", "best to worst of all cells"),
        (f"background:repeating-linear-gradient(45deg, {lines}), {_PALE}", f"n {DIVERGED}: n runs diverged"),
        (
            f"background:repeating-linear-gradient(45deg, {lines}), "
            f"repeating-linear-gradient(-45deg, {lines}), {_GREY}",
            f"all {DIVERGED}: all runs diverged; none: no estimate tracked",
        ),
        (f"background:{_PALE}", "–: not known"),
    )
    listed = "".join(
        f'<li><span aria-hidden="true" style="height:.9rem;{style}"></span>{escape(text)}</li>'
        for style, text in marks
    )
    return (
        f'<ul class="keys">{listed}<li>{KEPT} a run is kept</li></ul>\n'
        '<p class="soft">Tap a cell for its run where one is kept, else for its row in the table of all '
        "cells. One colour scale holds for all latencies and losses, from the best to the worst of the "
        "estimators asked about. Cells with diverged runs have no colour: their errors are only those "
        "of what still tracked. Empty places were not in the sweep.</p>"
    )


def ink_on(colour: str) -> str:
    """Black or white, whichever stands out more on a colour such as ``#1a2b3c``, by WCAG 2."""
    parts = [int(colour[start : start + 2], 16) / 255.0 for start in (1, 3, 5)]
    red, green, blue = (
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts
    )
    return _BLACK if 0.2126 * red + 0.7152 * green + 0.0722 * blue > _BRIGHT else _WHITE


def _marked(text: str, href: str) -> str:
    return text if href.startswith("#") else f"{text} {KEPT}"
