"""Plots of a comparison of runs: courses over each other, and the runs of each group as points."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hil.compare.comparison import Comparison
from hil.compare.courses import Course
from hil.compare.metrics import HEADLINES, unit_of
from hil.judge.dotted_figures import bare
from hil.reports.colours import BLUE, GREY, PURPLE, VERMILION
from hil.reports.plot_models import Field, Model, Value, source_of
from hil.reports.plots import (
    Key,
    Panel,
    TimeAxis,
    blank,
    draw_line,
    hover,
    limits_around,
    table,
)

LOOKS = ((BLUE, "solid"), (VERMILION, "dashed"), (PURPLE, "dotted"), (GREY, "solid"))
"""Colour and dash of each group's lines, in turn."""

_DEGREES = math.degrees(1.0)
_COURSES = (
    ("shape", "rho", "Distance ρ", "ρ [m]", 1.0, "The distance between the robots."),
    ("errors", "v1", "Error of v₁", "v₁ error [mm/s]", 1e3, "Leader's speed, estimate minus truth."),
    ("errors", "alpha1", "Error of α₁", "α₁ error [deg]", _DEGREES, "Estimate minus truth."),
    ("shape", "alpha1", "Bearing α₁", "α₁ [deg]", _DEGREES, "Where the leader sees the follower."),
    ("shape", "alpha2", "Bearing α₂", "α₂ [deg]", _DEGREES, "Where the follower sees the leader."),
    ("commands", "v2", "Commanded speed v₂", "v₂ [m/s]", 1.0, "What the follower was told."),
    (
        "commands",
        "u2",
        "Commanded turn rate u₂",
        "u₂ [deg/s]",
        _DEGREES,
        "What the follower was told.",
    ),
)
_ROW = 44


def span_of(courses: Sequence[Course]) -> tuple[float, float]:
    """From when to when courses that are shown together go [s]."""
    return 0.0, max(course.last for course in courses)


def course_panels(courses: Sequence[Course]) -> list[Panel]:
    """Panels of what is known of any of them, all over one time axis."""
    axis = TimeAxis(*span_of(courses), min(course.judged_from for course in courses))
    panels = []
    for kind, name, title, y_label, scale, says in _COURSES:
        lines = []
        for n, course in enumerate(courses):
            t, columns = getattr(course, kind)
            if name in columns and len(t):
                lines.append((n, course.label, t, scale * columns[name]))
        if not lines:
            continue
        # Before they are judged, errors of a start would flatten all that comes after.
        settled = [v[t >= axis.judged_from] if kind == "errors" else v for _, _, t, v in lines]
        plot = axis.panel(y_label, limits_around(*(settled if any(map(len, settled)) else [lines[0][3]])))
        keys = []
        for n, label, t, values in lines:
            colour, dash = LOOKS[n % len(LOOKS)]
            line = draw_line(plot, table(t, values, {"y": values}), "y", colour, dash=dash)
            hover(plot, line, {label: "@y{0.0000}", "t": "@t{0.00} s"}, mode="mouse")
            keys.append(Key(label, colour, "line" if dash == "solid" else dash))
        panels.append(Panel(title, says, tuple(keys), plot))
    return panels


def spread_panels(comparison: Comparison) -> list[Panel]:
    """For every headline the runs of each group as points, with the median; none if each is a single run."""
    if all(len(group.samples) == 1 for group in comparison.groups):
        return []
    names = [name for name in comparison.metrics() if bare(name) in HEADLINES]
    return [_points(comparison, name) for name in names]


def _points(comparison: Comparison, name: str) -> Panel:
    unit, scale = unit_of(name)
    labels = [group.label for group in comparison.groups][::-1]
    values = [scale * value for group in comparison.groups for value in group.values(name)]
    low, high = limits_around(np.array(values))
    plot = blank(
        height=70 + _ROW * len(labels),
        x_label=f"{HEADLINES[bare(name)]} [{unit}]",
        y_label="",
        x_range=Model("Range1d", start=low, end=high),
        y_range=Model("FactorRange", factors=labels),
    )
    for n, group in enumerate(comparison.groups):
        known = [sample for sample in group.samples if name in sample.metrics]
        if not known:
            continue
        points = source_of(
            {
                "x": [scale * sample.metrics[name] for sample in known],
                "y": [group.label] * len(known),
                "run": [sample.name for sample in known],
            }
        )
        colour = LOOKS[n % len(LOOKS)][0]
        dots = Model(
            "Scatter",
            x=Field("x"),
            y=Field("y"),
            size=Value(9.0),
            fill_color=Value(colour),
            fill_alpha=Value(0.45),
            line_color=Value(colour),
        )
        hover(plot, plot.add_glyph(points, dots), {"@run": f"@x{{0.0000}} {unit}"}, mode="mouse")
        spread = comparison.spread(name, group)
        middle = source_of({"x": [scale * spread.median if spread else math.nan], "y": [group.label]})
        bar = Model(
            "Scatter",
            x=Field("x"),
            y=Field("y"),
            marker=Value("dash"),
            angle=Value(math.pi / 2),
            size=Value(30.0),
            line_color=Value(colour),
            line_width=Value(3.0),
        )
        plot.add_glyph(middle, bar)
    title = HEADLINES[bare(name)] + (f" of {name.split('.')[1]}" if bare(name) != name else "")
    return Panel(title, "A point is a run, the stroke their median.", (), plot)
