"""Heat maps of a sweep over position and heading noise, one for every estimator and figure of merit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from hil.reports.cell_looks import ABSENT, LOOKS, Look, coloured, unjudged
from hil.reports.cell_table import address_of
from hil.reports.plot_models import Field, Model, Value, source_of
from hil.reports.plots import Panel, blank, hover, lead_on
from hil.reports.run_tables import QUANTITIES, scale_of
from hil.reports.sweep_cells import Cell, estimators_of, is_sound, number

_HEIGHT_OF_ROW, _HEIGHT_OF_LABEL, _HEIGHT_OF_REST = 38, 130, 64
# What is shown when another quantity or slice is chosen lies in the page already, by its key.
SWITCH = (
    f"""
const looks = {list(LOOKS)};
"""
    + """
const chosen = () => ["quantity", "slice"].map(id => document.getElementById(id).value).join("|");
const show = () => {
  for (const plot of Bokeh.documents[0].roots()) for (const renderer of plot.renderers) {
    const data = renderer.data_source.data, key = chosen();
    const shown = Object.fromEntries(looks.map(name => [name, data[name + "|" + key]]));
    renderer.data_source.data = {...data, ...shown};
  }
};
for (const id of ["quantity", "slice"]) document.getElementById(id).addEventListener("change", show);
"""
)


@dataclass(frozen=True, slots=True)
class Merit:
    """A figure of merit of a cell's quantity: title, what it says, value (None: not known) and its text."""

    title: str
    says: str
    value: Callable[[Cell, str], float | None]
    text: Callable[[float, str], str]


def _rmse(cell: Cell, quantity: str) -> float | None:
    return number(cell.get("rmse", {}).get(quantity))


def _efficiency(cell: Cell, quantity: str) -> float | None:
    return number(cell.get("efficiency", {}).get(quantity))


def tightness(cell: Cell, quantity: str) -> float | None:
    """Largest error of a quantity over its extended bound, None where that is not known."""
    return number(cell.get("bounds", {}).get("tightness", {}).get(f"{quantity}_extended"))


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


def off_station(cell: Cell, _: str = "") -> float | None:
    """How far the distance was off the station [m, RMS], None where that is not known."""
    return number(cell.get("formation", {}).get("equilibrium_deviation", {}).get("rho"))


def off_run(cell: Cell, _: str = "") -> float | None:
    """The same off the noise-free run of the cell's law."""
    return number(cell.get("formation", {}).get("deviation", {}).get("rho"))


FORMATION = (
    Merit(
        "Distance off the station",
        "RMS of ρ minus ρ₀ [mm], whatever the quantity: by this laws are told apart.",
        off_station,
        lambda value, _: f"{1e3 * value:.3g}",
    ),
    Merit(
        "Distance off the noise-free run",
        "RMS of ρ off what the same law does without noise [mm]: by this estimators are told apart.",
        off_run,
        lambda value, _: f"{1e3 * value:.3g}",
    ),
)
"""How well the formation was kept, which is of a cell and of no quantity."""


def merits_of(cells: Sequence[Cell]) -> list[Merit]:
    """Merits of which any cell knows a value."""
    kept = [merit for merit in FORMATION if any(merit.value(cell, "") is not None for cell in cells)]
    return [*MERITS, *kept]


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


def quantity_labels(cells: Sequence[Cell]) -> dict[str, str]:
    """Symbol and unit of each quantity of which any cell knows an error."""
    return {name: f"{QUANTITIES[name][0]} [{QUANTITIES[name][1]}]" for name in quantities_of(cells)}


def choices_html(cells: Sequence[Cell], labels: Mapping[str, str]) -> str:
    """The two lists from which a slice and what is shown are chosen, the latter by its key."""
    slices = {str(n): slice_name(each) for n, each in enumerate(slices_of(cells))}
    return _choice("quantity", "Quantity", labels) + _choice("slice", "Latency and loss", slices)


def slice_name(where: Slice) -> str:
    """Such as ``30 ms, 5 % lost`` or ``30 ms, 0 % lost, k 0.5``."""
    latency_s, loss, swept = where
    parameters = "".join(f", {name} {value:g}" for name, value in swept)
    return f"{1e3 * latency_s:g} ms, {100.0 * loss:g} % lost{parameters}"


def heat_maps(cells: Sequence[Cell], merit: Merit) -> list[Panel]:
    """One map for every estimator, all of one colour scale, that of a quantity through all slices.

    Colours are of cells none of whose runs diverged; the others are marked as what they are. The scale is
    that of the estimators asked about.
    """
    rows, columns = noise_labels(cells, "sigma_position"), noise_labels(cells, "sigma_heading")
    asked, foils = estimators_of(cells)
    sound = [cell for cell in cells if is_sound(cell) and str(cell["estimator"]) in asked]
    panels = []
    for estimator in (*asked, *foils):
        data: dict[str, list[str]] = {
            "row": [row for row in rows.values() for _ in columns],
            "column": [column for _ in rows for column in columns.values()],
        }
        own = [(n, cell) for n, cell in enumerate(cells) if str(cell["estimator"]) == estimator]
        for quantity in quantities_of(cells):
            scale = _scale([merit.value(cell, quantity) for cell in sound])
            for n, each in enumerate(slices_of(cells)):
                looks = {
                    (cell["sigma_position"], cell["sigma_heading"]): _look(cell, k, quantity, merit, scale)
                    for k, cell in own
                    if slice_of(cell) == each
                }
                shown = [looks.get((row, column), ABSENT) for row in rows for column in columns]
                data |= {f"{name}|{quantity}|{n}": [getattr(look, name) for look in shown] for name in LOOKS}
        first = f"{quantities_of(cells)[0]}|0" if quantities_of(cells) else ""
        if first:
            data |= {name: data[f"{name}|{first}"] for name in LOOKS}
            says = f"{merit.title} of {estimator} over position and heading noise."
            title = f"{estimator} (foil)" if estimator in foils else estimator
            panels.append(noise_map(title, says, data, list(rows.values()), list(columns.values())))
    return panels


def noise_labels(cells: Sequence[Cell], axis: str) -> dict[float, str]:
    """Noise that occurs in order, with what it is called: positions in mm, headings in degrees."""
    scale = math.degrees(1.0) if axis == "sigma_heading" else 1e3
    return {value: f"{scale * value:.3g}" for value in sorted({float(cell[axis]) for cell in cells})}


def noise_map(
    title: str,
    says: str,
    data: Mapping[str, list[str]],
    rows: Sequence[str],
    columns: Sequence[str],
    *,
    leads: bool = True,
) -> Panel:
    """A map of :class:`~hil.reports.cell_looks.Look` as columns of ``data``.

    ``leads``: whether a tap on a cell leads to its ``href``.
    """
    plot = blank(
        height=_HEIGHT_OF_REST + max(_HEIGHT_OF_ROW * len(rows), _HEIGHT_OF_LABEL),
        x_label="heading noise [deg]",
        y_label="position noise [mm]",
        x_range=Model("FactorRange", factors=list(columns)),
        y_range=Model("FactorRange", factors=list(rows)),
    )
    for grid in plot.grids:
        grid.set(grid_line_color=None)
    source, place = source_of(data), {"x": Field("column"), "y": Field("row")}
    area = Model(
        "Rect",
        **place,
        width=Value(0.96),
        height=Value(0.92),
        fill_color=Field("fill"),
        line_color=Value(None),
        hatch_pattern=Field("hatch"),
        hatch_color=Value("#101010"),
        hatch_alpha=Value(0.2),
        hatch_scale=Value(9.0),
        hatch_weight=Value(1.0),
    )
    drawn = plot.add_glyph(source, area)
    hover(plot, drawn, {title: "@tip"}, mode="mouse")
    centred = {"text_align": Value("center"), "text_baseline": Value("middle")}
    font = {"text_color": Field("ink"), "text_font_size": Value("12px"), "text_font_style": Value("bold")}
    letters = plot.add_glyph(source, Model("Text", **place, text=Field("text"), **centred, **font))
    if leads:
        lead_on(plot, drawn, letters)
    return Panel(title, says, (), plot)


def _look(cell: Cell, place: int, quantity: str, merit: Merit, scale: tuple[float, float]) -> Look:
    value = merit.value(cell, quantity)
    href = address_of(cell, place)
    tip = f"cell {place}, {cell['runs']} runs, {cell['diverged']} diverged"
    if not is_sound(cell) or value is None:
        known = f"{merit.text(value, quantity)} where it did not; " if value and int(cell["samples"]) else ""
        return unjudged(cell, known + tip, href)
    low, high = scale
    share = (math.log(value) - low) / (high - low) if value > 0.0 and high > low else 0.0
    return coloured(share, merit.text(value, quantity), tip, href)


def _scale(values: Sequence[float | None]) -> tuple[float, float]:
    """Ends of a logarithmic scale through all that is known."""
    positive = np.array([value for value in values if value is not None and value > 0.0])
    if not len(positive):
        return 0.0, 0.0
    return math.log(float(positive.min())), math.log(float(positive.max()))


def _choice(name: str, label: str, options: Mapping[str, str]) -> str:
    lines = "".join(f'<option value="{escape(key)}">{escape(text)}</option>' for key, text in options.items())
    return f'<label>{label} <select id="{name}" autocomplete="off">{lines}</select></label>\n'
