"""Strokes that the plots of a report share: panels over one time axis, lines, bands, marks, legends."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from bokeh.models import ColumnDataSource, CrosshairTool, HoverTool
from bokeh.models.annotations import PolyAnnotation, Span
from bokeh.models.glyph import Glyph
from bokeh.models.glyphs import Line, Scatter, VArea
from bokeh.models.ranges import FactorRange, Range, Range1d
from bokeh.models.renderers import GlyphRenderer
from bokeh.plotting import figure

from formation.angles import FloatArray
from hil.figures.plot_data import LONGEST_LINE
from hil.reports.decimation import decimated_rows

# Colours of Okabe and Ito, told apart by eyes of every kind; bounds and limits differ by their dashes, too.
BLUE, VERMILION, PURPLE, DARK, GREY = "#0072b2", "#d55e00", "#a8478a", "#333333", "#767676"
LEADER, FOLLOWER, BELIEVED, BOUND, ORBIT, TRUE, LIMIT = BLUE, VERMILION, BLUE, VERMILION, PURPLE, DARK, GREY

HEIGHT = 210
_TOOLS = "xpan,xbox_zoom,reset"
_FONT = "system-ui, sans-serif"


@dataclass(frozen=True, slots=True)
class Key:
    """One entry of a panel's legend. ``style``: line, dashed, dotted, band, dot or cross."""

    label: str
    colour: str
    style: str = "line"


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """A plot with its title, a sentence that says what it shows, and its legend; ``tall``: two rows high."""

    title: str
    says: str
    keys: tuple[Key, ...]
    plot: figure
    tall: bool = False


class TimeAxis:
    """The time that all panels of a page share: they zoom together, and one cursor runs through all.

    ``first``, ``last``: what is shown to begin with [s]. Before ``judged_from`` it is shaded.
    """

    def __init__(self, first: float, last: float, judged_from: float) -> None:
        self.first, self.last, self.judged_from = first, last, judged_from
        self._range = Range1d(start=first, end=last if last > first else first + 1.0)
        self._cursor = Span(dimension="height", line_color=GREY, line_width=1, line_dash="dotted")

    def panel(self, y_label: str, y: tuple[float, float] | Sequence[str], height: int = HEIGHT) -> figure:
        """An empty plot over this time; ``y``: its limits, or the names of its rows."""
        limits = Range1d(start=y[0], end=y[1]) if isinstance(y, tuple) else FactorRange(factors=list(y))
        plot = blank(
            height=height, x_range=self._range, y_range=limits, tools=_TOOLS, x_label="t [s]", y_label=y_label
        )
        plot.add_tools(CrosshairTool(overlay=self._cursor))
        if self.judged_from > self.first and isinstance(y, tuple):
            across = [self.first, self.judged_from, self.judged_from, self.first]
            up = [y[0], y[0], y[1], y[1]]
            shade = PolyAnnotation(
                xs=across, ys=up, fill_color="#000000", fill_alpha=0.04, line_alpha=0.0, level="image"
            )
            plot.add_layout(shade)
        return plot


def blank(*, height: int, x_label: str, y_label: str, tools: str, x_range: Range, y_range: Range) -> figure:
    """An empty plot in the style of the page, as wide as it may be. No tool takes a finger's scrolling."""
    plot = figure(
        title=None,
        height=height,
        min_width=240,  # a first layout without any width would leave traces of its labels
        sizing_mode="stretch_width",
        tools=tools,
        active_drag=None,
        active_scroll=None,
        toolbar_location="above",
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=None,
        min_border_left=58,
        min_border_right=12,
        x_range=x_range,
        y_range=y_range,
    )
    plot.toolbar.logo = None
    plot.xaxis.axis_label, plot.yaxis.axis_label = x_label, y_label
    for axis in plot.axis:
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_font = axis.major_label_text_font = _FONT
        axis.axis_label_text_font_size = axis.major_label_text_font_size = "12px"
        axis.axis_label_text_color = axis.major_label_text_color = DARK
        axis.axis_label_standoff = 4
        axis.axis_line_color = "#bbbbbb"
        axis.minor_tick_line_color = None
    plot.grid.grid_line_color = "#e4e4e4"
    return plot


def table(t: FloatArray, by: FloatArray, columns: Mapping[str, FloatArray]) -> ColumnDataSource:
    """Columns over time, decimated by the peaks of ``by`` and broken where the time jumps."""
    holes = np.flatnonzero(np.diff(t) > LONGEST_LINE) + 1
    rows = decimated_rows(np.insert(by, holes, math.nan))
    decimated = {name: np.insert(values, holes, math.nan)[rows] for name, values in columns.items()}
    return ColumnDataSource(
        {"t": np.insert(t, holes, t[holes])[rows]} | {k: _short(v) for k, v in decimated.items()}
    )


def marks(t: FloatArray, values: FloatArray) -> ColumnDataSource:
    """Single points as they are."""
    return ColumnDataSource({"t": t, "y": _short(values)})


def draw_line(
    plot: figure,
    source: ColumnDataSource,
    column: str,
    colour: str,
    *,
    dash: str = "solid",
    width: float = 1.3,
) -> GlyphRenderer[Any]:
    """One column of a table as a line."""
    return draw(plot, source, Line(x="t", y=column, line_color=colour, line_dash=dash, line_width=width))


def draw_band(plot: figure, source: ColumnDataSource, low: str, high: str, colour: str) -> None:
    """What lies between two columns, filled."""
    draw(plot, source, VArea(x="t", y1=low, y2=high, fill_color=colour, fill_alpha=0.18))


def draw_level(plot: figure, value: float, colour: str, dash: str) -> None:
    """A level line from edge to edge."""
    plot.add_layout(
        Span(location=value, dimension="width", line_color=colour, line_dash=dash, line_width=1.2)
    )


def draw_marks(
    plot: figure, source: ColumnDataSource, marker: str, colour: str, size: float
) -> GlyphRenderer[Any]:
    """Points as markers: dots small, crosses in the colour of what was violated."""
    width = 1.6 if marker == "x" else 0.0
    glyph = Scatter(
        x="t", y="y", marker=marker, size=size, line_color=colour, fill_color=colour, line_width=width
    )
    return draw(plot, source, glyph)


def draw(plot: figure, source: ColumnDataSource, glyph: Glyph) -> GlyphRenderer[Any]:
    """A glyph as it is, without the costly copies for selections that ``plot.line`` and its like make."""
    drawn: GlyphRenderer[Any] = plot.add_glyph(source, glyph)
    return drawn


def hover(
    plot: figure,
    over: GlyphRenderer[Any],
    tips: Mapping[str, str],
    *,
    mode: Literal["mouse", "vline"] = "vline",
) -> None:
    """Show the values under the pointer: labels with Bokeh's fields."""
    plot.add_tools(HoverTool(renderers=[over], mode=mode, tooltips=list(tips.items())))


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
