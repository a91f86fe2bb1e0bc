"""Shape variables over time against their equilibrium and the noise-free run."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from formation.angles import FloatArray
from hil.figures.plot_data import PlotData, broken_at_jumps
from hil.judge.columns import inside
from hil.reports.colours import BELIEVED, GREY, ORBIT, TRUE
from hil.reports.plots import Key, Panel, TimeAxis, draw_line, hover, limits_around, marks, table

_DEGREES = math.degrees(1.0)
COURSE = "course "
"""What the names of the data of shape variables begin with."""
_SHAPES = (
    ("rho", "ρ", "m", "Distance ρ", "The distance between the robots."),
    ("alpha1", "α₁", "deg", "Bearing α₁", "Where the leader sees the follower, from its own heading."),
    ("alpha2", "α₂", "deg", "Bearing α₂", "Where the follower sees the leader, from its own heading."),
)


def shape_panels(data: PlotData, axis: TimeAxis) -> list[Panel]:
    """Panels of rho, alpha1 and alpha2: true where that is known, else as estimated."""
    truth, columns = data.columns.truth, data.columns
    known = inside(truth.capture_ns, columns.run) & np.isfinite(truth.rho)
    if np.any(known):
        t = data.seconds(truth.capture_ns[known])
        courses = [np.asarray(getattr(truth, name))[known] for name, *_ in _SHAPES]
        return _panels(data, axis, t, courses, _noise_free(data, known), estimated=False)
    seen = inside(data.tracked.capture_ns, columns.run)
    if not np.any(seen):
        return []
    t = data.seconds(data.tracked.capture_ns[seen])
    courses = [np.asarray(getattr(data.tracked.seen, name))[seen] for name, *_ in _SHAPES]
    return _panels(data, axis, t, courses, None, estimated=True)


def _noise_free(data: PlotData, known: NDArray[np.bool_]) -> list[FloatArray] | None:
    """The noise-free run at the known truths, NaN before it begins."""
    if data.orbit is None:
        return None
    moments = data.columns.truth.capture_ns[known]
    before = moments < data.orbit.from_ns
    return [np.where(before, math.nan, course) for course in data.orbit.at(moments)]


def _panels(
    data: PlotData,
    axis: TimeAxis,
    t: FloatArray,
    courses: list[FloatArray],
    ideals: list[FloatArray] | None,
    *,
    estimated: bool,
) -> list[Panel]:
    colour, label = (BELIEVED, "estimate") if estimated else (TRUE, data.truth_name)
    driven = data.run_data.motion_since_ns is not None
    since, desired = data.desired()
    panels = []
    for k, (name, symbol, unit, title, says) in enumerate(_SHAPES):
        scale = 1.0 if unit == "m" else _DEGREES
        held = {"y": scale * broken_at_jumps(courses[k])}
        if ideals is not None:
            held["ideal"] = scale * broken_at_jumps(ideals[k])
        level = [scale * desired[k]] if driven else []
        floor = 0.0 if name == "rho" else -180.0
        plot = axis.panel(f"{symbol} [{unit}]", limits_around(*held.values(), *level, floor=floor))
        source = table(t, held["y"], held)
        source.set(name=COURSE + name)
        digits = "0.0000" if unit == "m" else "0.00"
        keys, tips = [Key(label, colour)], {"t": "@t{0.00} s", label: f"@y{{{digits}}} {unit}"}
        if driven:
            draw_line(plot, marks(since, level[0]), "y", GREY, dash="dotted")
            at = ", ".join(f"{value:.4g}" for value in dict.fromkeys(level[0].tolist()))
            keys.append(Key(f"station, {at} {unit}", GREY, "dotted"))
        if ideals is not None:
            draw_line(plot, table(t, held["ideal"], {"y": held["ideal"]}), "y", ORBIT, dash="dashed")
            keys.append(Key("noise-free run", ORBIT, "dashed"))
            tips["noise-free"] = f"@ideal{{{digits}}} {unit}"
        hover(plot, draw_line(plot, source, "y", colour), tips)
        panels.append(Panel(title, says, tuple(keys), plot))
    return panels
