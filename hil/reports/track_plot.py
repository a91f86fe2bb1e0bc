"""Both robots from above: their tracks, and where they were and headed at a few moments."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from formation.angles import FloatArray
from hil.figures.plot_data import PlotData, with_gaps
from hil.judge.columns import inside
from hil.reports.colours import DARK, FOLLOWER, GREY, LEADER, PAPER
from hil.reports.decimation import MOST_POINTS, spread_rows
from hil.reports.page_script import JOINED, ROBOT, TRACK
from hil.reports.plot_models import Field, Figure, Model, Value, source_of
from hil.reports.plots import Key, Panel, blank, hover

_HEIGHT = 460
_MOMENTS = 7
_MARK_SHARE = 0.03
"""Half length of a robot's mark over the extent of the tracks."""
_OUTLINE = {"xs": Field("xs"), "ys": Field("ys")}
_MARK = np.array([(1.0, 0.0), (-0.7, 0.62), (-0.4, 0.0), (-0.7, -0.62)])


@dataclass(frozen=True, slots=True, eq=False)
class Robot:
    """A robot's name, its colour, and its poses, rows x, y, theta."""

    name: str
    colour: str
    poses: FloatArray


def track_panel(data: PlotData) -> Panel | None:
    """Tracks of both robots in the world frame [m]; None where the truth is not known."""
    columns = data.columns
    both = np.column_stack([columns.truth.leader, columns.truth.follower])
    known = inside(columns.truth.capture_ns, columns.run) & np.all(np.isfinite(both), axis=1)
    if not np.any(known):
        return None
    t, both = data.seconds(columns.truth.capture_ns[known]), both[known]
    return tracks(t, (Robot("leader", LEADER, both[:, :3]), Robot("follower", FOLLOWER, both[:, 3:])))


def tracks(t: FloatArray, robots: Sequence[Robot]) -> Panel:
    """Tracks of robots, each joined to the next, whose poses are known at all of the times t [s]."""
    plot = blank(
        height=_HEIGHT,
        x_label="x [m]",
        y_label="y [m]",
        x_range=Model("DataRange1d", range_padding=0.15),
        y_range=Model("DataRange1d", range_padding=0.15),
    )
    zoom = Model("BoxZoomTool", dimensions="both")
    plot.add_tools(Model("PanTool"), Model("WheelZoomTool"), zoom, Model("ResetTool"))
    plot.x_axis.set(ticker=Model("BasicTicker", desired_num_ticks=5))
    plot.set(match_aspect=True)
    lines = [_draw_track(plot, t, robot, number) for number, robot in enumerate(robots)]
    for axis_range in ("x_range", "y_range"):
        # What moves over the tracks does not move the picture.
        plot.attributes[axis_range].set(renderers=lines)
    rows = spread_rows(len(t), _MOMENTS)
    places = np.stack([robot.poses[rows, :2] for robot in robots], axis=1)
    joins = source_of({"xs": places[:, :, 0].tolist(), "ys": places[:, :, 1].tolist()})
    looks = {"line_color": Value(GREY), "line_dash": Value("dotted")}
    plot.add_glyph(joins, Model("MultiLine", **_OUTLINE, **looks))
    extent = float(np.max(np.ptp(np.concatenate([robot.poses[:, :2] for robot in robots]), axis=0)))
    size = _MARK_SHARE * max(extent, 1.0)
    for number, robot in enumerate(robots):
        _draw_marks(plot, robot.poses[rows], robot.colour, size)
        if number == 0 or len(robots) == 2:
            _write_moments(plot, t[rows], robot.poses[rows])
    _draw_robots(plot, robots, 1.7 * size)
    says = (
        f"True tracks of {'both' if len(robots) == 2 else 'all'} robots from {t[0]:.3g} s to {t[-1]:.3g} s. "
        f"Arrowheads show where each was and headed at {len(rows)} moments, dotted lines join them; the "
        "large ones are at the time of the slider."
    )
    return Panel("From above", says, tuple(Key(each.name, each.colour) for each in robots), plot, tall=True)


def _draw_track(plot: Figure, t: FloatArray, robot: Robot, number: int) -> Model:
    poses, name = robot.poses, robot.name
    rows = spread_rows(len(t), MOST_POINTS)
    moments, x = with_gaps(t[rows], poses[rows, 0])
    _, y = with_gaps(t[rows], poses[rows, 1])
    _, heading = with_gaps(t[rows], np.degrees(poses[rows, 2]))
    columns = {"t": moments, "x": x, "y": y, "heading": heading}
    source = source_of({key: values.astype(np.float32) for key, values in columns.items()})
    source.set(name=f"{TRACK}{number}")
    glyph = Model("Line", x=Field("x"), y=Field("y"), line_color=robot.colour, line_width=1.8)
    line = plot.add_glyph(source, glyph)
    tips = {name: "@t{0.00} s", "x": "@x{0.000} m", "y": "@y{0.000} m", "heading": "@heading{0.0} deg"}
    hover(plot, line, tips, mode="mouse")
    return line


def _draw_marks(plot: Figure, poses: FloatArray, colour: str, size: float) -> None:
    """Arrowheads, the later the darker."""
    xs, ys = [], []
    for pose in poses:
        outline = _outline(pose, size)
        xs.append(outline[:, 0].tolist())
        ys.append(outline[:, 1].tolist())
    opacities = np.linspace(0.45, 1.0, len(xs)).tolist()
    outlines = source_of({"xs": xs, "ys": ys, "opacity": opacities})
    looks = {"fill_color": Value(colour), "fill_alpha": Field("opacity")}
    edge = {"line_color": Value(PAPER), "line_width": Value(0.7)}
    plot.add_glyph(outlines, Model("Patches", **_OUTLINE, **looks, **edge))


def _write_moments(plot: Figure, t: FloatArray, poses: FloatArray) -> None:
    """The moment beside each pose."""
    texts = [f"{moment:.3g} s" for moment in t.tolist()]
    moments = source_of({"x": poses[:, 0], "y": poses[:, 1], "text": texts})
    font = {"text_font_size": Value("11px"), "text_color": Value(GREY)}
    offset = {"x_offset": Value(9), "y_offset": Value(-7)}
    plot.add_glyph(moments, Model("Text", x=Field("x"), y=Field("y"), text=Field("text"), **font, **offset))


def _draw_robots(plot: Figure, robots: Sequence[Robot], size: float) -> None:
    """The robots at the time of the slider, and the line that joins them; at first where they ended."""
    last = [robot.poses[-1].tolist() for robot in robots]
    joined = source_of({"x": [x for x, _, _ in last], "y": [y for _, y, _ in last]})
    joined.set(name=JOINED)
    line = Model("Line", x=Field("x"), y=Field("y"), line_color=DARK, line_width=1.5)
    drawn = [plot.add_glyph(joined, line)]
    for number, robot in enumerate(robots):
        outline = _outline(robot.poses[-1], size)
        source = source_of({"xs": [outline[:, 0].tolist()], "ys": [outline[:, 1].tolist()]})
        source.set(name=f"{ROBOT}{number}", tags=(size * _MARK).tolist())
        looks = {"fill_color": Value(robot.colour), "line_color": Value(DARK), "line_width": Value(1.5)}
        drawn.append(plot.add_glyph(source, Model("Patches", **_OUTLINE, **looks)))
    for each in drawn:
        each.set(level="overlay")


def _outline(pose: FloatArray, size: float) -> FloatArray:
    """A robot's mark at a pose x, y, theta: rows x, y."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    placed: FloatArray = size * (_MARK @ np.array([[cos, sin], [-sin, cos]])) + pose[:2]
    return placed
