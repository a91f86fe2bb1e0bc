"""What the follower was told to do, and when it was told to stand still."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from formation.angles import FloatArray
from hil.figures.plot_data import LONGEST_LINE, PlotData
from hil.judge.columns import inside
from hil.reports.colours import FOLLOWER, GREY, LIMIT
from hil.reports.intervals import TimeInterval, intervals_of
from hil.reports.plot_models import Field, Figure, Model, Value, source_of
from hil.reports.plots import Key, Panel, TimeAxis, draw_level, draw_line, hover, limits_around, table


def stops_of(data: PlotData) -> list[TimeInterval]:
    """Intervals over which the robot was told to stand still, by reason, while the run lasted.

    That it waits before its first drive is none.
    """
    commands = data.columns.commands
    issued_ns, stood = commands.issued_ns, commands.stood
    during = inside(issued_ns, data.columns.run) & (issued_ns < data.columns.run.to_ns)
    told = [
        (stop, stands) for stop, stands, counts in zip(commands.stop, stood, during, strict=True) if counts
    ]
    reasons = [stop if stands else "" for stop, stands in told]
    intervals = intervals_of(data.seconds(issued_ns[during]), reasons, LONGEST_LINE)
    return [interval for interval in intervals if interval.what]


def command_panels(data: PlotData, axis: TimeAxis) -> list[Panel]:
    """Commanded speed and turn rate with the limits that are near, and the stops."""
    commands, controller = data.columns.commands, data.run_data.scenario.controller
    during = inside(commands.issued_ns, data.columns.run)
    if not np.any(during):
        return []
    t, stops = data.seconds(commands.issued_ns[during]), stops_of(data)
    speed = _panel(axis, "speed", "v₂", "m/s", t, commands.v2[during], controller.v_max, stops)
    turn = _panel(axis, "turn rate", "u₂", "rad/s", t, commands.u2[during], controller.u_max, stops)
    return [speed, turn]


def _panel(
    axis: TimeAxis,
    what: str,
    symbol: str,
    unit: str,
    t: FloatArray,
    sent: FloatArray,
    limit: float,
    stops: Sequence[TimeInterval],
) -> Panel:
    low, high = min(float(np.min(sent)), 0.0), float(np.max(sent))
    # A limit far outside what is driven would only flatten the curve.
    near = [side for side in (limit, -limit) if 1.6 * low <= side <= 1.6 * high]
    y = limits_around(sent, np.array([0.0, *near]))
    plot = axis.panel(f"{symbol} [{unit}]", y)
    keys = [Key("command", FOLLOWER)]
    if stops:
        _shade(plot, stops, y)
        keys.append(Key("told to stand still", GREY, "band"))
    for side in near:
        draw_level(plot, side, LIMIT, "dashed")
    if near:
        keys.append(Key(f"limit, {limit:g} {unit}", LIMIT, "dashed"))
    line = draw_line(plot, table(t, sent, {"y": sent}), "y", FOLLOWER)
    hover(plot, line, {"t": "@t{0.00} s", "command": f"@y{{0.000}} {unit}"})
    return Panel(f"Commanded {what} {symbol}", f"The follower's {what} as commanded.", tuple(keys), plot)


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
