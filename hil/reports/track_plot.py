"""Both robots from above: their tracks, and where they were and headed at a few moments."""

from __future__ import annotations

import math

import numpy as np
from bokeh.models import BasicTicker, ColumnDataSource
from bokeh.models.ranges import DataRange1d
from bokeh.plotting import figure

from formation.angles import FloatArray
from hil.figures.plot_data import PlotData, with_gaps
from hil.judge.columns import inside
from hil.reports.decimation import MOST_POINTS, spread_rows
from hil.reports.plots import FOLLOWER, GREY, LEADER, Key, Panel, blank, hover

_HEIGHT = 460
_MOMENTS = 7
_MARK_SHARE = 0.03
"""Half length of a robot's mark over the extent of the tracks."""
_MARK = np.array([(1.0, 0.0), (-0.7, 0.62), (-0.4, 0.0), (-0.7, -0.62)])


def track_panel(data: PlotData) -> Panel | None:
    """Tracks of both robots in the world frame [m]; None where the truth is not known."""
    columns = data.columns
    both = np.column_stack([columns.truth.leader, columns.truth.follower])
    known = inside(columns.truth.capture_ns, columns.run) & np.all(np.isfinite(both), axis=1)
    if not np.any(known):
        return None
    t, both = data.seconds(columns.truth.capture_ns[known]), both[known]
    plot = blank(
        height=_HEIGHT,
        x_label="x [m]",
        y_label="y [m]",
        tools="pan,wheel_zoom,box_zoom,reset",
        x_range=DataRange1d(range_padding=0.15),
        y_range=DataRange1d(range_padding=0.15),
    )
    plot.xaxis.ticker = BasicTicker(desired_num_ticks=5)
    plot.match_aspect = True
    for colour, name, poses in ((LEADER, "leader", both[:, :3]), (FOLLOWER, "follower", both[:, 3:])):
        _draw_track(plot, t, poses, colour, name)
    rows = spread_rows(len(t), _MOMENTS)
    ends = [both[rows, 0].tolist(), both[rows, 3].tolist()], [both[rows, 1].tolist(), both[rows, 4].tolist()]
    plot.multi_line(
        [list(pair) for pair in zip(*ends[0], strict=True)],
        [list(pair) for pair in zip(*ends[1], strict=True)],
        line_color=GREY,
        line_dash="dotted",
    )
    extent = float(np.max(np.ptp(np.concatenate([both[:, :2], both[:, 3:5]]), axis=0)))
    size = _MARK_SHARE * max(extent, 1.0)
    _draw_marks(plot, t[rows], both[rows, :3], LEADER, size)
    _draw_marks(plot, t[rows], both[rows, 3:], FOLLOWER, size)
    says = (
        f"True tracks of both robots from {t[0]:.3g} s to {t[-1]:.3g} s. Arrowheads show where each was "
        f"and headed at {len(rows)} moments, dotted lines join the two."
    )
    return Panel("From above", says, (Key("leader", LEADER), Key("follower", FOLLOWER)), plot, tall=True)


def _draw_track(plot: figure, t: FloatArray, poses: FloatArray, colour: str, name: str) -> None:
    rows = spread_rows(len(t), MOST_POINTS)
    moments, x = with_gaps(t[rows], poses[rows, 0])
    _, y = with_gaps(t[rows], poses[rows, 1])
    _, heading = with_gaps(t[rows], np.degrees(poses[rows, 2]))
    columns = {"t": moments, "x": x, "y": y, "heading": heading}
    source = ColumnDataSource({key: values.astype(np.float32) for key, values in columns.items()})
    line = plot.line("x", "y", source=source, line_color=colour, line_width=1.8)
    tips = {name: "@t{0.00} s", "x": "@x{0.000} m", "y": "@y{0.000} m", "heading": "@heading{0.0}°"}
    hover(plot, line, tips, mode="mouse")


def _draw_marks(plot: figure, t: FloatArray, poses: FloatArray, colour: str, size: float) -> None:
    """Arrowheads, the later the darker, with the moment behind each."""
    xs, ys = [], []
    for x, y, theta in poses.tolist():
        turn = np.array([[math.cos(theta), math.sin(theta)], [-math.sin(theta), math.cos(theta)]])
        outline = size * (_MARK @ turn) + (x, y)
        xs.append(outline[:, 0].tolist())
        ys.append(outline[:, 1].tolist())
    opacities = np.linspace(0.45, 1.0, len(xs)).tolist()
    plot.patches(xs, ys, fill_color=colour, fill_alpha=opacities, line_color="white", line_width=0.7)
    plot.text(
        poses[:, 0].tolist(),
        poses[:, 1].tolist(),
        text=[f"{moment:.3g} s" for moment in t.tolist()],
        text_font_size="11px",
        text_color=GREY,
        x_offset=9,
        y_offset=-7,
    )
