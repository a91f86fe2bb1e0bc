"""How the estimates came about: their status, their innovations, and the age of what commands rest on."""

from __future__ import annotations

import numpy as np

from estimation.tracking.track_settings import gate_of
from estimation.tracking.tracker import Status
from formation.angles import FloatArray
from hil.figures.plot_data import LONGEST_LINE, PlotData
from hil.judge.columns import inside
from hil.judge.intervals import intervals_of
from hil.judge.summary import percentile
from hil.reports.colours import BELIEVED, BLACK, BOUND, FOLLOWER, GREY, PURPLE
from hil.reports.decimation import decimated_rows
from hil.reports.plot_models import Field, Model, Value, source_of
from hil.reports.plots import Key, Panel, TimeAxis, draw_level, draw_line, draw_marks, hover, marks, table

_STATUS_COLOURS = {
    Status.INITIALISING: GREY,
    Status.TRACKING: BELIEVED,
    Status.COASTING: PURPLE,
    Status.REJECTING: BOUND,
    Status.LOST: BLACK,
}
_EXPECTED_NIS = 2.0
_PERCENTILES = {"median": 50.0, "99 %": 99.0, "largest": 100.0}
_WIDE = 8.0
"""From where on the oldest is so many times the usual age that a linear axis would hide the rest."""
_ROW_HEIGHT, _AXIS_HEIGHT = 30, 90


def status_panel(data: PlotData, axis: TimeAxis) -> Panel | None:
    """What the estimates said of themselves, from when each said so; None without any.

    Not by their captures: all that are told while no frame comes are of the last one before.
    """
    estimates, run = data.columns.estimates, data.columns.run
    during = inside(estimates.told_ns, run)
    if not np.any(during):
        return None
    statuses = [Status(code) for code in estimates.status[during].tolist()]
    names = [status.name.lower() for status in statuses]
    intervals = intervals_of(data.seconds(estimates.told_ns[during]), names, LONGEST_LINE)
    occurring = [status for status in Status if status in statuses]
    lasted = {
        status: sum(each.to_s - each.from_s for each in intervals if each.what == status.name.lower())
        for status in occurring
    }
    # All may be told at one moment, as those of a single frame are.
    whole = sum(lasted.values()) or 1.0
    rows = [status.name.lower() for status in reversed(occurring)]
    plot = axis.panel("", rows, _AXIS_HEIGHT + _ROW_HEIGHT * len(rows))
    plot.set(min_border_left=78)
    for status in occurring:
        own = [interval for interval in intervals if interval.what == status.name.lower()]
        held = {
            "row": [interval.what for interval in own],
            "from": [interval.from_s for interval in own],
            "to": [interval.to_s for interval in own],
            "count": [interval.count for interval in own],
        }
        colour = _STATUS_COLOURS[status]
        place = {"y": Field("row"), "left": Field("from"), "right": Field("to"), "height": Value(0.6)}
        looks = {"fill_color": Value(colour), "line_color": Value(colour), "line_width": Value(1.5)}
        bars = plot.add_glyph(source_of(held), Model("HBar", **place, **looks))
        tips = {"status": "@row", "from": "@from{0.00} s", "to": "@to{0.00} s", "estimates": "@count"}
        hover(plot, bars, tips, mode="mouse")
    shares = ", ".join(f"{status.name.lower()} {lasted[status] / whole:.1%}" for status in occurring)
    says = f"What the estimates said of themselves, of the time: {shares}."
    return Panel("Status", says, (), plot, anchor="status")


def nis_panel(data: PlotData, axis: TimeAxis) -> Panel | None:
    """Normalised innovation squared of every estimate against its mean and the gate."""
    estimates = data.columns.estimates
    known = inside(estimates.capture_ns, data.columns.run) & np.isfinite(estimates.nis)
    if not np.any(known):
        return None
    t, nis = data.seconds(estimates.capture_ns[known]), estimates.nis[known]
    gate = gate_of(data.run_data.scenario.estimator.gate_probability)
    top = 1.25 * gate
    plot = axis.panel("NIS", (0.0, top))
    for level, colour, dash in ((_EXPECTED_NIS, GREY, "solid"), (gate, BOUND, "dashed")):
        draw_level(plot, level, colour, dash)
    rows = decimated_rows(nis)
    t, nis, over = t[rows], nis[rows], nis[rows] > top
    dots = draw_marks(plot, marks(t[~over], nis[~over]), "circle", BELIEVED, 3.0)
    hover(plot, dots, {"t": "@t{0.00} s", "NIS": "@y{0.00}"}, mode="mouse")
    keys = [
        Key("NIS", BELIEVED, "dot"),
        Key("expected mean, 2", GREY),
        Key(f"gate, {gate:.3g}", BOUND, "dashed"),
    ]
    if np.any(over):
        held = {"t": t[over], "y": np.full(np.count_nonzero(over), 0.96 * top), "nis": nis[over]}
        beyond = draw_marks(plot, source_of(held), "triangle", BOUND, 8.0)
        hover(plot, beyond, {"t": "@t{0.00} s", "NIS": "@nis{0.0}"}, mode="mouse")
        keys.append(Key("beyond the picture", BOUND, "triangle"))
    says = "How far each measurement lay from what was expected, squared and in units of its own variance."
    return Panel("Innovation", says, tuple(keys), plot)


def latency_panel(data: PlotData, axis: TimeAxis) -> Panel | None:
    """Age of what every command rests on; the first command on a capture gives the latency.

    Nothing is cut off: where the oldest is many times the usual one, the axis is logarithmic.
    """
    commands = data.columns.commands
    based = inside(commands.issued_ns, data.columns.run) & (commands.capture_ns > 0)
    if not np.any(based):
        return None
    t = data.seconds(commands.issued_ns[based])
    age_ms: FloatArray = (commands.issued_ns - commands.capture_ns)[based] * np.float64(1e-6)
    fresh = commands.fresh[based]
    known = age_ms[fresh] if np.any(fresh) else age_ms
    levels = {name: percentile(known, q) for name, q in _PERCENTILES.items()}
    least, most = float(np.min(age_ms)), float(np.max(age_ms))
    logarithmic = least > 0.0 and most > _WIDE * levels["median"]
    plot = axis.panel("age [ms]", (0.8 * least, 1.4 * most) if logarithmic else (0.0, 1.15 * most))
    if logarithmic:
        plot.make_logarithmic()
    line = draw_line(plot, table(t, age_ms, {"y": age_ms}), "y", FOLLOWER, width=1.0)
    hover(plot, line, {"t": "@t{0.00} s", "age": "@y{0.0} ms"})
    keys = [Key("age of the capture behind every command", FOLLOWER)]
    if np.any(fresh):
        rows = decimated_rows(known)
        draw_marks(plot, marks(t[fresh][rows], known[rows]), "circle", BELIEVED, 3.0)
        keys.append(Key("latency: first command on a capture", BELIEVED, "dot"))
    for (name, level), dash in zip(levels.items(), ("dashed", "dotted", "solid"), strict=True):
        draw_level(plot, level, GREY, dash)
        keys.append(Key(f"{name} {level:.1f} ms", GREY, dash if dash != "solid" else "line"))
    says = "How old the motion capture behind the commands was; all of it is in the picture."
    if logarithmic:
        says += " The axis is logarithmic."
    return Panel("Latency and age", says, tuple(keys), plot)
