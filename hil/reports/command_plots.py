"""What the follower was told to do, and when it was told to stand still."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray
from hil.figures.plot_data import LONGEST_LINE, PlotData
from hil.judge.columns import inside
from hil.judge.intervals import TimeInterval, intervals_of
from hil.reports.colours import FOLLOWER, GREY, LIMIT
from hil.reports.plot_models import Field, Figure, Model, Value, source_of
from hil.reports.plots import Key, Panel, TimeAxis, draw_level, draw_line, hover, limits_around, table

_DEGREES = math.degrees(1.0)


def stops_of(data: PlotData) -> list[TimeInterval]:
    """Intervals over which the robot was told to stand still, by reason, while the run lasted.

    That it waits before its first drive is none.
    """
    commands = data.columns.commands
    issued_ns, stood = commands.issued_ns, commands.stood
    during = inside(issued_ns, data.columns.run) & (issued_ns < data.columns.run.to_ns)
    reasons = [commands.stop[row] if stood[row] else "" for row in np.flatnonzero(during).tolist()]
    intervals = intervals_of(data.seconds(issued_ns[during]), reasons, LONGEST_LINE)
    return [interval for interval in intervals if interval.what]


@dataclass(frozen=True, slots=True, eq=False)
class _Course:
    """What was commanded over time in a unit, and the robot's limit of it."""

    what: str
    symbol: str
    unit: str
    sent: FloatArray
    limit: float


def command_panels(data: PlotData, axis: TimeAxis) -> list[Panel]:
    """Commanded speed and turn rate with the limits that are near, and the stops."""
    commands, controller = data.columns.commands, data.run_data.scenario.controller
    during = inside(commands.issued_ns, data.columns.run)
    if not np.any(during):
        return []
    t, stops = data.seconds(commands.issued_ns[during]), stops_of(data)
    turned, u_max = _DEGREES * commands.u2[during], _DEGREES * controller.u_max
    speed = _Course("speed", "v₂", "m/s", commands.v2[during], controller.v_max)
    turn = _Course("turn rate", "u₂", "deg/s", turned, u_max)
    waits = _waits(t, commands.stopped[during])
    return [_panel(axis, course, t, stops, waits) for course in (speed, turn)]


def _waits(t: FloatArray, stopped: NDArray[np.bool_]) -> str:
    """From when on the robot was driven, where it waited for that."""
    drives = np.flatnonzero(~stopped)
    if not len(drives):
        return " It was never driven."
    return f" It waited until {t[drives[0]]:.2f} s." if drives[0] > 0 else ""


def _panel(
    axis: TimeAxis, course: _Course, t: FloatArray, stops: Sequence[TimeInterval], waits: str
) -> Panel:
    sent, limit, unit = course.sent, course.limit, course.unit
    low, high = min(float(np.min(sent)), 0.0), float(np.max(sent))
    # A limit far outside what is driven would only flatten the curve.
    near = [side for side in (limit, -limit) if 1.6 * low <= side <= 1.6 * high]
    y = limits_around(sent, np.array([0.0, *near]))
    plot = axis.panel(f"{course.symbol} [{unit}]", y)
    keys = [Key("command", FOLLOWER)]
    if stops:
        _shade(plot, stops, y)
        keys.append(Key("told to stand still", GREY, "band"))
    for side in near:
        draw_level(plot, side, LIMIT, "dashed")
    if near:
        keys.append(Key(f"limit, {limit:.4g} {unit}", LIMIT, "dashed"))
    line = draw_line(plot, table(t, sent, {"y": sent}), "y", FOLLOWER)
    hover(plot, line, {"t": "@t{0.00} s", "command": f"@y{{0.000}} {unit}"})
    says = f"The follower's {course.what} as commanded.{waits}"
    return Panel(f"Commanded {course.what} {course.symbol}", says, tuple(keys), plot)


def _shade(plot: Figure, stops: Sequence[TimeInterval], y: tuple[float, float]) -> None:
    held = {
        "left": [interval.from_s for interval in stops],
        "right": [interval.to_s for interval in stops],
        "why": [interval.what for interval in stops],
    }
    sides = {"left": Field("left"), "right": Field("right"), "bottom": Value(y[0]), "top": Value(y[1])}
    looks = {"fill_color": Value(GREY), "fill_alpha": Value(0.3)}
    edge = {"line_color": Value(GREY), "line_alpha": Value(0.6)}
    area = Model("Quad", **sides, **looks, **edge)
    tips = {"stands": "@why", "from": "@left{0.00} s", "to": "@right{0.00} s"}
    hover(plot, plot.add_glyph(source_of(held), area), tips, mode="mouse")
