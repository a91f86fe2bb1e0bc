"""Strokes that the plots of a report share: panels over one time axis, lines, bands, marks, legends."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from formation.angles import FloatArray
from hil.figures.plot_data import LONGEST_LINE
from hil.reports.colours import AXIS, BOUND, DARK, GREY, GRID, SHADE
from hil.reports.decimation import decimated_rows
from hil.reports.page_script import NOW
from hil.reports.plot_models import DASHES, Field, Figure, Model, Value, source_of

HEIGHT = 210
_MOST_SHADED = 20
_FONT = "system-ui, sans-serif"


@dataclass(frozen=True, slots=True)
class Key:
    """One entry of a panel's legend. ``style``: line, dashed, dotted, band, dot or cross."""

    label: str
    colour: str
    style: str = "line"


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """A plot with its title, a sentence that says what it shows, and its legend; ``tall``: two rows high.

    ``anchor``: its place in the page, where links lead to it.
    """

    title: str
    says: str
    keys: tuple[Key, ...]
    plot: Figure
    tall: bool = False
    anchor: str = ""


class TimeAxis:
    """The time that all panels of a page share: they zoom together, and one cursor runs through all.

    ``first``, ``last``: what is shown to begin with [s]. Before ``judged_from`` it is shaded, and so are
    ``spells``, from when to when [s], the longest if there are many.
    """

    def __init__(
        self, first: float, last: float, judged_from: float, spells: Sequence[tuple[float, float]] = ()
    ) -> None:
        self.first, self.last, self.judged_from = first, last, judged_from
        self.spells = sorted(spells, key=lambda spell: spell[0] - spell[1])[:_MOST_SHADED]
        self._range = Model("Range1d", start=first, end=last if last > first else first + 1.0)
        self._cursor = Model("Span", dimension="height", line_color=GREY, line_dash=DASHES["dotted"])
        self._now = Model(
            "Span", name=NOW, dimension="height", level="overlay", location=last, line_color=DARK
        )

    def panel(self, y_label: str, y: tuple[float, float] | Sequence[str], height: int = HEIGHT) -> Figure:
        """An empty plot over this time; ``y``: its limits, or the names of its rows."""
        if isinstance(y, tuple):
            limits = Model("Range1d", start=y[0], end=y[1])
        else:
            limits = Model("FactorRange", factors=list(y))
        plot = blank(height=height, x_range=self._range, y_range=limits, x_label="t [s]", y_label=y_label)
        plot.add_tools(
            Model("PanTool", dimensions="width"),
            Model("BoxZoomTool", dimensions="width"),
            Model("WheelZoomTool", dimensions="width"),
            Model("ResetTool"),
            Model("CrosshairTool", overlay=self._cursor),
        )
        plot.add_layout(self._now)
        if self.judged_from > self.first and isinstance(y, tuple):
            across = [self.first, self.judged_from, self.judged_from, self.first]
            up = [y[0], y[0], y[1], y[1]]
            looks = {"fill_color": SHADE, "fill_alpha": 0.05, "line_alpha": 0.0, "level": "image"}
            plot.add_layout(Model("PolyAnnotation", xs=across, ys=up, **looks))
        for left, right in self.spells:
            looks = {"fill_color": BOUND, "fill_alpha": 0.1, "line_alpha": 0.0, "level": "image"}
            plot.add_layout(Model("BoxAnnotation", left=left, right=right, **looks))
        return plot


def blank(*, height: int, x_label: str, y_label: str, x_range: Model, y_range: Model) -> Figure:
    """An empty plot in the style of the page, as wide as it may be. No tool takes a finger's scrolling."""
    plot = Figure(
        height=height,
        x_range=x_range,
        y_range=y_range,
        x_label=x_label,
        y_label=y_label,
        min_width=240,  # a first layout without any width would leave traces of its labels
        sizing_mode="stretch_width",
        toolbar_location=None,
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=None,
        min_border_left=58,
        min_border_right=12,
    )
    for axis in (plot.x_axis, plot.y_axis):
        axis.set(
            axis_label_text_font_style="normal",
            axis_label_text_font=_FONT,
            major_label_text_font=_FONT,
            axis_label_text_font_size="12px",
            major_label_text_font_size="12px",
            axis_label_text_color=DARK,
            major_label_text_color=DARK,
            axis_label_standoff=4,
            axis_line_color=AXIS,
            minor_tick_line_color=None,
        )
    for grid in plot.grids:
        grid.set(grid_line_color=GRID)
    return plot


def table(t: FloatArray, by: FloatArray, columns: Mapping[str, FloatArray]) -> Model:
    """Columns over time, decimated by the peaks of ``by`` and broken where the time jumps."""
    holes = np.flatnonzero(np.diff(t) > LONGEST_LINE) + 1
    rows = decimated_rows(np.insert(by, holes, math.nan))
    decimated = {name: np.insert(values, holes, math.nan)[rows] for name, values in columns.items()}
    return source_of(
        {"t": np.insert(t, holes, t[holes])[rows]} | {k: _short(v) for k, v in decimated.items()}
    )


def marks(t: FloatArray, values: FloatArray) -> Model:
    """Single points as they are."""
    return source_of({"t": t, "y": _short(values)})


def draw_line(
    plot: Figure,
    source: Model,
    column: str,
    colour: str,
    *,
    dash: str = "solid",
    width: float = 1.3,
) -> Model:
    """One column of a table as a line."""
    looks = {"line_color": colour, "line_dash": DASHES[dash], "line_width": width}
    return plot.add_glyph(source, Model("Line", x=Field("t"), y=Field(column), **looks))


def draw_band(plot: Figure, source: Model, low: str, high: str, colour: str) -> None:
    """What lies between two columns, filled, and broken where these are."""
    looks = {"fill_color": colour, "fill_alpha": 0.18}
    held = source.attributes["data"]
    t, lower, upper = (np.asarray(held[name]) for name in ("t", low, high))
    if np.all(np.isfinite(lower) & np.isfinite(upper)):
        plot.add_glyph(source, Model("VArea", x=Field("t"), y1=Field(low), y2=Field(high), **looks))
        return
    # An area of Bokeh's goes straight through what is not known; the outline of several parts does not.
    x, y = _outlines(t, lower, upper)
    plot.add_glyph(
        source_of({"x": x, "y": _short(y)}),
        Model("Patch", x=Field("x"), y=Field("y"), **looks, line_alpha=0.0),
    )


def _outlines(t: FloatArray, lower: FloatArray, upper: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Outlines of a band with NaN between its parts: there along the lower side, back along the upper one."""
    known = np.isfinite(lower) & np.isfinite(upper)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8)))
    gap = np.array([math.nan])
    x: list[FloatArray] = []
    y: list[FloatArray] = []
    for first, end in edges.reshape(-1, 2).tolist():
        x += [t[first:end], t[first:end][::-1], gap]
        y += [lower[first:end], upper[first:end][::-1], gap]
    return np.concatenate([gap, *x]), np.concatenate([gap, *y])


def draw_level(plot: Figure, value: float, colour: str, dash: str) -> None:
    """A level line from edge to edge."""
    looks = {"line_color": colour, "line_dash": DASHES[dash], "line_width": 1.2}
    plot.add_layout(Model("Span", location=value, dimension="width", **looks))


def draw_marks(plot: Figure, source: Model, marker: str, colour: str, size: float) -> Model:
    """Points as markers: dots small, crosses in the colour of what was violated."""
    looks = {
        "marker": Value(marker),
        "size": Value(size),
        "line_color": Value(colour),
        "fill_color": Value(colour),
        "line_width": Value(1.6 if marker == "x" else 0.0),
    }
    return plot.add_glyph(source, Model("Scatter", x=Field("t"), y=Field("y"), **looks))


def hover(
    plot: Figure,
    over: Model,
    tips: Mapping[str, str],
    *,
    mode: Literal["mouse", "vline"] = "vline",
) -> None:
    """Show the values under the pointer: labels with Bokeh's fields."""
    plot.add_tools(Model("HoverTool", renderers=[over], mode=mode, tooltips=list(tips.items())))


def lead_on(plot: Figure, *drawn: Model) -> None:
    """Have a tap on a point lead to the address in its column ``href``, and leave all as it is drawn."""
    for renderer in drawn:
        renderer.set(selection_glyph=None, nonselection_glyph=None)
    there = Model("OpenURL", url="@href", same_tab=True)
    plot.add_tools(Model("TapTool", renderers=[drawn[0]], callback=there))


def limits_around(
    *values: FloatArray, floor: float = -math.inf, ceiling: float = math.inf
) -> tuple[float, float]:
    """Limits of an axis that shows all these values, but nothing outside ``floor`` and ``ceiling``."""
    known = np.concatenate([np.asarray(each, dtype=np.float64).ravel() for each in values])
    known = known[np.isfinite(known)]
    if not len(known):
        return 0.0, 1.0
    low, high = max(float(known.min()), floor), min(float(known.max()), ceiling)
    margin = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    return low - margin, high + margin


def _short(values: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """In single precision: a seventh digit is far below a pixel, and the page half as heavy."""
    return np.asarray(values, dtype=np.float32)
