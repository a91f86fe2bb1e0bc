"""The report of a chain: all robots from above, every follower's distance, and how each of them did."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import cycle
from typing import Any

import numpy as np

from controllers.chain import ChainTrajectory
from formation.angles import FloatArray
from hil.figures.plot_data import broken_at_jumps
from hil.judge.chain_text import chain_cells
from hil.judge.replay_verdict import violated_bounds
from hil.judge.run_data import RunData
from hil.judge.summary_text import BAD, parity_line, warnings_of
from hil.reports.colours import AGENTS, LIMIT
from hil.reports.notation import written
from hil.reports.page import Section, Timeline, page, table_html
from hil.reports.plots import Key, Panel, TimeAxis, draw_level, draw_line, hover, limits_around, table
from hil.reports.provenance import provenance_html
from hil.reports.reasons import judged_html
from hil.reports.track_plot import Robot, tracks
from hil.scenario.parts import station
from hil.scenario.schema import Scenario

_HEADER = ("follower", "ρ [m]", "settled", "RMSE v₁", "RMSE α₁", "bounds", "latency p50, p99", "look again")
_DEGREES = math.degrees(1.0)


def chain_report(
    scenario: Scenario,
    runs: Sequence[RunData],
    trajectory: ChainTrajectory | None,
    summary: Mapping[str, Any],
) -> str:
    """HTML of a page about the followers of a chain, from their run data, the leader's first.

    ``trajectory``: where all robots truly were, None where that is not known; ``summary``: that of the chain.
    """
    names = [runs[0].scenario.leader.name, *(run_data.scenario.follower.name for run_data in runs)]
    title = f"{summary['scenario']} · {summary['agents']} agents · {summary['mode']}"
    head = f"<h1>{escape(title)}</h1>\n{_verdict(summary)}"
    parts = list(_plotted(scenario, names, trajectory)) if trajectory is not None else []
    sections = [
        *parts[:1],
        Section("Followers", _followers(summary)),
        *parts[1:],
        Section("How it was made", _made(runs, names, summary)),
    ]
    timeline = None
    if trajectory is not None:
        timeline = Timeline(float(trajectory.t[0]), float(trajectory.t[-1]))
    return page(f"{title} – abreast", head, sections, timeline=timeline)


def _verdict(summary: Mapping[str, Any]) -> str:
    pairs = summary["pairs"]
    known = "recovered" in summary
    lost = [str(pair["follower"]) for pair in pairs if known and "settle_s" not in pair]
    doubtful = [str(pair["follower"]) for pair in pairs if warnings_of(pair)]
    told = []
    if lost:
        told.append(f"Not at their station at the end: {', '.join(lost)}")
    elif known:
        told.append("All followers are at their station at the end")
    if violated := [str(pair["follower"]) for pair in pairs if violated_bounds(pair)]:
        told.append(f"Bounds were violated by {', '.join(violated)}")
    parity = list(parity_line(summary))
    told += [f"Replay: {text}" for _, text, _ in parity]
    wrong = bool(lost or violated) or any(style == BAD for _, _, style in parity)
    if doubtful:
        told.append(f"{', '.join(doubtful)} {'deserve' if len(doubtful) > 1 else 'deserves'} a second look")
    style = "bad" if wrong else "warn" if doubtful else "good"
    says = "; ".join(told) or "Nothing speaks against the run"
    linked = '<p><a href="#followers">What each follower did</a></p>'
    told_by = judged_html(*pairs)
    return f'<div class="verdict {style}"><p><strong>{escape(says)}.</strong></p>{told_by}{linked}</div>\n'


def _followers(summary: Mapping[str, Any]) -> str:
    rows, lists = [], []
    for pair in summary["pairs"]:
        warnings = warnings_of(pair)
        cells = [written(text) or "–" for text, _ in chain_cells(pair)]
        rows.append((*cells, str(len(warnings)) if warnings else "–"))
        if warnings:
            each = "".join(f"<li>{escape(written(warning))}</li>" for warning in warnings)
            lists.append(f'<h3 class="table">{escape(str(pair["follower"]))}</h3>\n<ul>{each}</ul>')
    return table_html("Each behind the one above it", _HEADER, rows) + "\n".join(lists)


@dataclass(frozen=True, slots=True, eq=False)
class _Courses:
    """A quantity of several robots over time, (n, robots), in its unit, and the levels it is held against."""

    title: str
    symbol: str
    unit: str
    of: Mapping[str, str]
    values: FloatArray
    level: str = ""
    levels: tuple[float, ...] = ()


def _plotted(scenario: Scenario, names: Sequence[str], trajectory: ChainTrajectory) -> Iterator[Section]:
    """What is seen from above and the distances; then bearings, and what each robot drove."""
    t, wanted = trajectory.t, station(scenario)
    axis = TimeAxis(float(t[0]), float(t[-1]), float(t[0]))
    robots = [
        Robot(name, colour, trajectory.poses[:, number])
        for number, (name, colour) in enumerate(zip(names, cycle(AGENTS), strict=False))
    ]
    agents = {robot.name: robot.colour for robot in robots}
    followers = {robot.name: robot.colour for robot in robots[1:]}
    rho_0, v_max = scenario.formation.rho_0, scenario.controller.v_max
    alpha1, alpha2 = (_DEGREES * values for values in (trajectory.alpha1, trajectory.alpha2))
    places = (_DEGREES * wanted.alpha1, _DEGREES * wanted.alpha2)
    glance = (
        _Courses("Distance ρ to the one before", "ρ", "m", followers, trajectory.rho, "station", (rho_0,)),
        _Courses("Speed v", "v", "m/s", agents, trajectory.v, "limit", (v_max, -v_max)),
    )
    others = (
        _Courses("Bearing α₁", "α₁", "deg", followers, alpha1, "station", places[:1]),
        _Courses("Bearing α₂", "α₂", "deg", followers, alpha2, "station", places[1:]),
        _Courses("Turn rate u", "u", "deg/s", agents, _DEGREES * trajectory.u),
    )
    yield Section(
        "At a glance", panels=[tracks(t, robots), *(_panel(axis, t, each) for each in glance)], quiet=True
    )
    yield Section("Bearings and turn rates", panels=[_panel(axis, t, each) for each in others])


def _panel(axis: TimeAxis, t: FloatArray, courses: _Courses) -> Panel:
    """A line for each robot, and dashed levels where they are near."""
    seen, unit = courses.values, courses.unit
    low, high = float(np.min(seen)), float(np.max(seen))
    near = [level for level in courses.levels if 2.0 * low - high <= level <= 2.0 * high - low]
    plot = axis.panel(f"{courses.symbol} [{unit}]", limits_around(seen, np.array(near)))
    for level in near:
        draw_level(plot, level, LIMIT, "dashed")
    for (name, colour), column in zip(courses.of.items(), seen.T, strict=True):
        # Half a turn is where an angle jumps.
        course = np.radians(column) if unit == "deg" else column
        drawn = _DEGREES * broken_at_jumps(course) if unit == "deg" else course
        line = draw_line(plot, table(t, drawn, {"y": drawn}), "y", colour)
        hover(plot, line, {name: "@t{0.00} s", courses.symbol: f"@y{{0.000}} {unit}"}, mode="mouse")
    keys = [Key(name, colour) for name, colour in courses.of.items()]
    if near:
        told = ", ".join(f"{level:.4g}" for level in near)
        keys.append(Key(f"{courses.level}, {told} {unit}", LIMIT, "dashed"))
    return Panel(courses.title, f"{courses.title}, a line for each robot.", tuple(keys), plot)


def _made(runs: Sequence[RunData], names: Sequence[str], summary: Mapping[str, Any]) -> str:
    log = runs[0].log
    whole = provenance_html(runs[0], summary)
    if log is None:
        return whole
    each = f"{shlex.join(['abreast', 'replay', str(log.path), '--follower', names[-1]])} --out DIR"
    return (
        f"{whole}<p><code>{escape(each)}</code> makes the report of one follower, with all its estimates.</p>"
    )
