"""Heat maps of a sweep over position and heading noise, one for every estimator and figure of merit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from bokeh.palettes import Cividis256

from hil.reports.colours import DARK
from hil.reports.plot_models import Field, Model, Value, source_of
from hil.reports.plots import Panel, blank, hover
from hil.reports.run_tables import QUANTITIES, scale_of

Cell = Mapping[str, Any]

_NOTHING = ("#ffffff", DARK, "")
_HEIGHT_OF_ROW, _HEIGHT_OF_LABEL, _HEIGHT_OF_REST = 38, 130, 64
_BRIGHT = 0.18
"""Relative luminance above which black letters stand out more than white ones."""

# What is shown when another quantity or slice is chosen lies in the page already, by its key.
SWITCH = """
const chosen = () => ["quantity", "slice"].map(id => document.getElementById(id).value).join("|");
const show = () => {
  for (const plot of Bokeh.documents[0].roots()) for (const renderer of plot.renderers) {
    const data = renderer.data_source.data;
    const key = chosen();
    renderer.data_source.data = {
      ...data, fill: data["fill|" + key], ink: data["ink|" + key], text: data["text|" + key],
      tip: data["tip|" + key]};
  }
};
for (const id of ["quantity", "slice"]) document.getElementById(id).addEventListener("change", show);
"""


@dataclass(frozen=True, slots=True)
class Merit:
    """A figure of merit of a cell's quantity: title, what it says, value (None: not known) and its text."""

    title: str
    says: str
    value: Callable[[Cell, str], float | None]
    text: Callable[[float, str], str]


def _rmse(cell: Cell, quantity: str) -> float | None:
    return _known(cell.get("rmse", {}).get(quantity))


def _efficiency(cell: Cell, quantity: str) -> float | None:
    return _known(cell.get("efficiency", {}).get(quantity))


def tightness(cell: Cell, quantity: str) -> float | None:
    """Largest error of a quantity over its extended bound, None where that is not known."""
    return _known(cell.get("bounds", {}).get("tightness", {}).get(f"{quantity}_extended"))


MERITS = (
    Merit(
        "RMSE",
        "Root mean square error of the estimate.",
        _rmse,
        lambda value, quantity: f"{scale_of(quantity) * value:.3g}",
    ),
    Merit(
        "RMSE / bound for random leaders",
        "Root mean square error over what the posterior Cramér-Rao bound allows for random leaders of the "
        "model's process noise. It is no bound for a leader that is calmer than that: there it is below 1.",
        _efficiency,
        lambda value, _: f"{value:.2f}",
    ),
    Merit(
        "Largest error / bound",
        "Largest error over its extended bound; above 100 % the bound is violated.",
        tightness,
        lambda value, _: f"{100.0 * value:.3g}%",
    ),
)


Slice = tuple[float, float, tuple[tuple[str, float], ...]]
"""Latency [s], loss, and parameters of a law of one's own by name."""


def slice_of(cell: Cell) -> Slice:
    """The slice through the grid that a cell is in."""
    given = cell.get("parameters", {})
    swept = tuple((str(name), float(value)) for name, value in given.items())
    return float(cell["latency_s"]), float(cell["loss"]), swept


def slices_of(cells: Sequence[Cell]) -> list[Slice]:
    """Slices that occur, in order."""
    return sorted(set(map(slice_of, cells)))


def quantities_of(cells: Sequence[Cell]) -> list[str]:
    """Quantities of which any cell knows an error."""
    return [name for name in QUANTITIES if any(_rmse(cell, name) is not None for cell in cells)]


def choices_html(cells: Sequence[Cell]) -> str:
    """The two lists from which quantity and slice are chosen."""
    symbols = {name: f"{QUANTITIES[name][0]} [{QUANTITIES[name][1]}]" for name in quantities_of(cells)}
    slices = {str(n): slice_name(each) for n, each in enumerate(slices_of(cells))}
    return _choice("quantity", "Quantity", symbols) + _choice("slice", "Latency and loss", slices)


def slice_name(where: Slice) -> str:
    """Such as ``30 ms, 5 % lost`` or ``30 ms, 0 % lost, k 0.5``."""
    latency_s, loss, swept = where
    parameters = "".join(f", {name} {value:g}" for name, value in swept)
    return f"{1e3 * latency_s:g} ms, {100.0 * loss:g} % lost{parameters}"


def heat_maps(cells: Sequence[Cell], merit: Merit) -> list[Panel]:
    """One map for every estimator, all of one colour scale, that of a quantity through all slices."""
    positions = sorted({float(cell["sigma_position"]) for cell in cells})
    headings = sorted({float(cell["sigma_heading"]) for cell in cells})
    rows, columns = [f"{1e3 * each:g}" for each in positions], [_degrees(each) for each in headings]
    places = {
        (position, heading): n
        for n, (position, heading) in enumerate((p, h) for p in positions for h in headings)
    }
    held = {
        "row": [row for row in rows for _ in columns],
        "column": [column for _ in rows for column in columns],
    }
    panels = []
    for estimator in dict.fromkeys(str(cell["estimator"]) for cell in cells):
        data: dict[str, list[str]] = dict(held)
        for quantity in quantities_of(cells):
            scale = _scale([merit.value(cell, quantity) for cell in cells])
            for n, each in enumerate(slices_of(cells)):
                looks = [(*_NOTHING, "no such cell")] * len(places)
                for number, cell in enumerate(cells):
                    if str(cell["estimator"]) == estimator and slice_of(cell) == each:
                        place = places[float(cell["sigma_position"]), float(cell["sigma_heading"])]
                        looks[place] = _look(cell, number, quantity, merit, scale)
                for name, values in zip(
                    ("fill", "ink", "text", "tip"), zip(*looks, strict=True), strict=True
                ):
                    data[f"{name}|{quantity}|{n}"] = list(values)
        first = f"{quantities_of(cells)[0]}|0"
        data |= {name: data[f"{name}|{first}"] for name in ("fill", "ink", "text", "tip")}
        panels.append(_map(estimator, data, rows, columns, merit))
    return panels


def _map(
    estimator: str, data: Mapping[str, list[str]], rows: Sequence[str], columns: Sequence[str], merit: Merit
) -> Panel:
    plot = blank(
        height=_HEIGHT_OF_REST + max(_HEIGHT_OF_ROW * len(rows), _HEIGHT_OF_LABEL),
        x_label="heading noise [deg]",
        y_label="position noise [mm]",
        x_range=Model("FactorRange", factors=list(columns)),
        y_range=Model("FactorRange", factors=list(rows)),
    )
    plot.set(toolbar_location=None)
    for grid in plot.grids:
        grid.set(grid_line_color=None)
    source, place = source_of(data), {"x": Field("column"), "y": Field("row")}
    size = {"width": Value(0.96), "height": Value(0.92)}
    area = Model("Rect", **place, **size, fill_color=Field("fill"), line_color=Value(None))
    hover(plot, plot.add_glyph(source, area), {estimator: "@tip"}, mode="mouse")
    centred = {"text_align": Value("center"), "text_baseline": Value("middle")}
    font = {"text_color": Field("ink"), "text_font_size": Value("12px")}
    plot.add_glyph(source, Model("Text", **place, text=Field("text"), **centred, **font))
    says = f"{merit.title} of {estimator} over position and heading noise."
    return Panel(estimator, says, (), plot)


def _look(
    cell: Cell, number: int, quantity: str, merit: Merit, scale: tuple[float, float]
) -> tuple[str, str, str, str]:
    """Colour, colour of the letters, letters, and what is told under the pointer."""
    value = merit.value(cell, quantity)
    tooltip = f"cell {number}, {cell['runs']} runs, {cell['diverged']} diverged"
    if value is None:
        return "#eeeeee", DARK, "–", f"not known; {tooltip}"
    low, high = scale
    share = (math.log(value) - low) / (high - low) if value > 0.0 and high > low else 0.0
    # Yellow is the good end, dark blue the bad one.
    colour = Cividis256[255 - round(255 * min(max(share, 0.0), 1.0))]
    return (
        colour,
        "#000000" if _luminance(colour) > _BRIGHT else "#ffffff",
        merit.text(value, quantity),
        tooltip,
    )


def _luminance(colour: str) -> float:
    """Relative luminance of a colour such as ``#1a2b3c``, by WCAG 2."""
    parts = [int(colour[start : start + 2], 16) / 255.0 for start in (1, 3, 5)]
    red, green, blue = (
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts
    )
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def _scale(values: Sequence[float | None]) -> tuple[float, float]:
    """Ends of a logarithmic scale through all that is known."""
    positive = np.array([value for value in values if value is not None and value > 0.0])
    if not len(positive):
        return 0.0, 0.0
    return math.log(float(positive.min())), math.log(float(positive.max()))


def _known(value: object) -> float | None:
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else None


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.3g}"


def _choice(name: str, label: str, options: Mapping[str, str]) -> str:
    lines = "".join(f'<option value="{escape(key)}">{escape(text)}</option>' for key, text in options.items())
    return f'<label>{label} <select id="{name}" autocomplete="off">{lines}</select></label>\n'
