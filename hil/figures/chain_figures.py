"""Picture of a chain of agents, laid out like the paper's: tracks joined by a line, speeds, steering."""

from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

from controllers.chain import ChainTrajectory
from formation.angles import FloatArray
from hil.extensions.reference import short
from hil.figures.paper_figures import PaperFigure
from hil.log.written_aside import written_aside
from hil.scenario.schema import Scenario

QUIET, LIMIT = "#8a8a8a", "#b03030"
DPI = 130
JOINED = 14
"""Moments at which the agents are joined by a line."""
_LEGEND = 8
_STILL = 0.05
_SHOWN_SHARE = 0.995

Colour = tuple[float, float, float, float]


def draw_chain(scenario: Scenario, trajectory: ChainTrajectory, until: float, path: Path) -> None:
    """Write a PNG up to a time [s]: (a) tracks, (b) distance, speed, turn rate, curvature of each agent."""
    trajectory = _first_part(trajectory, until)
    figure = Figure(figsize=(13.5, 7.5), layout="constrained")
    tilt = f", tilt {scenario.controller.tilt:g} rad" if scenario.controller.tilt else ""
    figure.suptitle(
        f"{scenario.name}: {trajectory.v.shape[1]} agents, {short(scenario.controller.law)} law{tilt}, "
        f"|v| at most {scenario.controller.v_max:g} m/s",
        fontsize=11,
    )
    grid = figure.add_gridspec(4, 2, width_ratios=(1.25, 1.0))
    colours = _colours(trajectory.v.shape[1])
    draw_tracks(figure.add_subplot(grid[:, 0]), trajectory, colours)
    rows = [figure.add_subplot(grid[row, 1]) for row in range(4)]
    draw_distances(rows[0], trajectory, scenario.formation.rho_0, colours)
    draw_speeds(rows[1], trajectory, scenario.controller.v_max, colours)
    draw_turn_rates(rows[2], trajectory, colours)
    draw_curvatures(rows[3], trajectory, colours)
    share_time_axis(rows, trajectory.t)
    save(figure, path)


def chain_paper_figures(scenario: Scenario, trajectory: ChainTrajectory, until: float) -> list[PaperFigure]:
    """Each panel of the picture on its own."""
    trajectory = _first_part(trajectory, until)
    colours = _colours(trajectory.v.shape[1])
    rho_0, v_max = scenario.formation.rho_0, scenario.controller.v_max
    over = (float(trajectory.t[0]), float(trajectory.t[-1]))
    return [
        PaperFigure("tracks", lambda axes: draw_tracks(axes, trajectory, colours), square=True),
        PaperFigure("rho", lambda axes: draw_distances(axes, trajectory, rho_0, colours), over),
        PaperFigure("v", lambda axes: draw_speeds(axes, trajectory, v_max, colours), over),
        PaperFigure("u", lambda axes: draw_turn_rates(axes, trajectory, colours), over),
        PaperFigure("curvature", lambda axes: draw_curvatures(axes, trajectory, colours), over),
    ]


def share_time_axis(rows: list[Axes], t: FloatArray) -> None:
    """Give panels that stand above each other the same time axis, labelled below the last."""
    for axes in rows:
        axes.set_xlim(float(t[0]), float(t[-1]))
        axes.grid(alpha=0.25)
        axes.tick_params(labelbottom=axes is rows[-1])
    rows[-1].set_xlabel("t [s]")


def save(figure: Figure, path: Path) -> None:
    """Write a picture as PNG, its labels aligned, without the drawing library's version in it."""
    figure.align_ylabels()
    FigureCanvasAgg(figure)
    with written_aside(path) as aside:
        figure.savefig(aside, dpi=DPI, metadata={"Software": None})


def draw_tracks(axes: Axes, trajectory: ChainTrajectory, colours: list[Colour]) -> None:
    """Tracks from above; at equally spaced moments a line joins the agents, later ones more opaque."""
    poses = trajectory.poses
    for agent, colour in enumerate(colours):
        label = f"agent {agent + 1}" if len(colours) <= _LEGEND else None
        axes.plot(poses[:, agent, 0], poses[:, agent, 1], color=colour, lw=1.1, label=label, zorder=2)
    moments = np.linspace(0, len(trajectory.t) - 1, JOINED).round().astype(int)
    for row, opacity in zip(moments, np.linspace(0.35, 1.0, JOINED).tolist(), strict=True):
        axes.plot(poses[row, :, 0], poses[row, :, 1], color=QUIET, lw=1.0, alpha=opacity, zorder=3)
        axes.scatter(poses[row, :, 0], poses[row, :, 1], s=14, c=colours, alpha=opacity, zorder=4, lw=0)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.05)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.grid(alpha=0.25)
    if len(colours) <= _LEGEND:
        axes.legend(loc="best", frameon=False, fontsize=9)


def draw_distances(axes: Axes, trajectory: ChainTrajectory, rho_0: float, colours: list[Colour]) -> None:
    """Each follower's distance to its predecessor, logarithmic; rho_0 dashed."""
    axes.axhline(rho_0, color=QUIET, lw=1.0, ls="--")
    _draw_agents(axes, trajectory.t, trajectory.rho, colours[1:])
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel(r"$\rho$ [m]")


def draw_speeds(axes: Axes, trajectory: ChainTrajectory, v_max: float, colours: list[Colour]) -> None:
    """Speeds over time and the limit."""
    _draw_agents(axes, trajectory.t, trajectory.v, colours)
    for side in (v_max, -v_max):
        if float(trajectory.v.min()) <= 0.9 * side <= float(trajectory.v.max()):
            axes.axhline(side, color=LIMIT, lw=1.0, ls=":")
    axes.set_ylabel("$v_i$ [m/s]")


def draw_turn_rates(axes: Axes, trajectory: ChainTrajectory, colours: list[Colour]) -> None:
    """Turn rates over time."""
    _draw_agents(axes, trajectory.t, np.degrees(trajectory.u), colours)
    axes.set_ylabel("$u_i$ [deg/s]")


def draw_curvatures(axes: Axes, trajectory: ChainTrajectory, colours: list[Colour]) -> None:
    """Signed curvature u / v of each track, not drawn where an agent all but stands."""
    moving = np.abs(trajectory.v) > _STILL * float(np.abs(trajectory.v).max())
    curvature = np.full_like(trajectory.u, math.nan)
    np.divide(trajectory.u, trajectory.v, out=curvature, where=moving)
    _draw_agents(axes, trajectory.t, curvature, colours)
    shown = curvature[np.isfinite(curvature)]
    if len(shown):
        first = curvature[:, 0][np.isfinite(curvature[:, 0])].tolist()
        low, high = np.quantile(shown, (1.0 - _SHOWN_SHARE, _SHOWN_SHARE)).tolist()
        low, high = min(low, *first), max(high, *first)
        margin = 0.1 * max(high - low, 1e-3)
        axes.set_ylim(low - margin, high + margin)
    axes.set_ylabel(r"$u_i / v_i$ [1/m]")


def _draw_agents(axes: Axes, t: FloatArray, values: FloatArray, colours: list[Colour]) -> None:
    for column, colour in zip(values.T, colours, strict=True):
        axes.plot(t, column, color=colour, lw=1.1 if len(colours) <= _LEGEND else 0.6)


def _first_part(trajectory: ChainTrajectory, until: float) -> ChainTrajectory:
    rows = max(2, int(np.searchsorted(trajectory.t, until, side="right")))
    columns = {field.name: getattr(trajectory, field.name)[:rows] for field in fields(trajectory)}
    return ChainTrajectory(**columns)


def _colours(agents: int) -> list[Colour]:
    if agents <= _LEGEND:
        return [colormaps["tab10"](k) for k in range(agents)]
    return [colormaps["viridis"](0.95 * k / (agents - 1)) for k in range(agents)]
