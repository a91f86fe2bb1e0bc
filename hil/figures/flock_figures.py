"""Picture of a flock: tracks from above, who follows whom, distances from the places, speeds, turn rates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from controllers.flock import FlockTrajectory
from formation.angles import FloatArray
from hil.extensions.reference import short
from hil.figures.chain_figures import LIMIT, QUIET, Colour, save, share_time_axis
from hil.figures.paper_figures import PaperFigure
from hil.scenario.schema import Scenario

MOMENTS = 8
"""Moments at which the whole flock is drawn."""
LEADER = "#c0392b"
_LEAST_SHOWN = 1e-4

Files = NDArray[np.int64]


def draw_flock(
    scenario: Scenario, trajectory: FlockTrajectory, off: FloatArray, files: Files, path: Path
) -> None:
    """Write a PNG: the flock from above at equally spaced moments, and in time what each file does.

    ``off`` (n, N): distances from the places; ``files`` (N,): number of each agent's file, 0 the leader.
    """
    figure = Figure(figsize=(14.5, 8.0), layout="constrained")
    agents, most = trajectory.neighbours.shape[1:]
    figure.suptitle(
        f"{scenario.name}: {agents} agents, each follows the mean of its {most} nearest neighbours, "
        f"{short(scenario.controller.law)} law, |v| at most {scenario.controller.v_max:g} m/s",
        fontsize=11,
    )
    grid = figure.add_gridspec(4, 2, width_ratios=(1.25, 1.0), height_ratios=(1.7, 1.0, 1.0, 1.0))
    colours = _colours(files)
    draw_from_above(figure.add_subplot(grid[:, 0]), trajectory, colours)
    draw_neighbours(figure.add_subplot(grid[0, 1]), trajectory, len(trajectory.t) - 1, colours)
    rows = [figure.add_subplot(grid[row, 1]) for row in (1, 2, 3)]
    draw_displacements(rows[0], trajectory, off, files)
    draw_speeds(rows[1], trajectory, scenario.controller.v_max, files)
    draw_turn_rates(rows[2], trajectory, files)
    share_time_axis(rows, trajectory.t)
    save(figure, path)


def flock_paper_figures(
    scenario: Scenario, trajectory: FlockTrajectory, off: FloatArray, files: Files
) -> list[PaperFigure]:
    """Each panel of the picture on its own."""
    colours, last = _colours(files), len(trajectory.t) - 1
    over = (float(trajectory.t[0]), float(trajectory.t[-1]))
    v_max = scenario.controller.v_max
    return [
        PaperFigure("tracks", lambda axes: draw_from_above(axes, trajectory, colours), square=True),
        PaperFigure("neighbours", lambda axes: draw_neighbours(axes, trajectory, last, colours), square=True),
        PaperFigure("displacement", lambda axes: draw_displacements(axes, trajectory, off, files), over),
        PaperFigure("v", lambda axes: draw_speeds(axes, trajectory, v_max, files), over),
        PaperFigure("u", lambda axes: draw_turn_rates(axes, trajectory, files), over),
    ]


def draw_from_above(axes: Axes, trajectory: FlockTrajectory, colours: list[Colour]) -> None:
    """Tracks, and the whole flock with its headings at equally spaced moments."""
    poses = trajectory.poses
    lines = LineCollection(
        list(poses[:, ::-1, :2].transpose(1, 0, 2)), colors=colours[::-1], lw=0.35, alpha=0.45
    )
    axes.add_collection(lines)
    axes.plot(poses[:, 0, 0], poses[:, 0, 1], color=LEADER, lw=1.2, zorder=4, label="leader")
    for row in np.linspace(0, len(trajectory.t) - 1, MOMENTS).round().astype(int).tolist():
        _draw_headings(axes, poses[row], colours)
        axes.annotate(
            f"{trajectory.t[row]:.0f} s",
            (float(poses[row, 0, 0]), float(poses[row, 0, 1])),
            xytext=(7, 7),
            textcoords="offset points",
            fontsize=8,
            color=LEADER,
        )
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.05)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.grid(alpha=0.25)
    axes.legend(loc="best", frameon=False, fontsize=9)


def draw_neighbours(axes: Axes, trajectory: FlockTrajectory, row: int, colours: list[Colour]) -> None:
    """Flock at one sample, the leader heading up, each agent joined to those that it follows."""
    poses, chosen = trajectory.poses[row], trajectory.neighbours[row]
    turn = 0.5 * np.pi - poses[0, 2]
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    places = (poses[:, :2] - poses[0, :2]) @ rotation.T
    follower, choice = np.nonzero(chosen >= 0)
    followed = chosen[follower, choice]
    joins = np.stack([places[follower], places[followed]], axis=1)
    axes.add_collection(LineCollection(list(joins), colors=QUIET, lw=0.5, zorder=1))
    axes.scatter(places[:, 0], places[:, 1], s=9, c=colours, lw=0, zorder=2)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.05)
    axes.set_title(f"who follows whom at {trajectory.t[row]:.0f} s, leader at the top [m]", fontsize=9)
    axes.tick_params(labelsize=8)


def draw_displacements(axes: Axes, trajectory: FlockTrajectory, off: FloatArray, files: Files) -> None:
    """Distance of each file's worst agent from its place, logarithmic; and the flock's least clearance."""
    for number, colour in _by_file(files):
        axes.plot(trajectory.t, off[:, files == number].max(axis=1), color=colour, lw=0.9)
    clearance = trajectory.clearance.min(axis=1)
    axes.plot(trajectory.t, clearance, color="black", lw=1.0, ls="--", label="least clearance")
    axes.set_yscale("log")
    axes.set_ylim(bottom=_LEAST_SHOWN)
    axes.set_ylabel("off place [m]")
    axes.legend(loc="lower right", frameon=False, fontsize=8)


def draw_speeds(axes: Axes, trajectory: FlockTrajectory, v_max: float, files: Files) -> None:
    """Speeds of each file, and the limit."""
    draw_files(axes, trajectory.t, trajectory.v, files)
    for side in (v_max, -v_max):
        if float(trajectory.v.min()) <= 0.9 * side <= float(trajectory.v.max()):
            axes.axhline(side, color=LIMIT, lw=1.0, ls=":")
    axes.set_ylabel("$v_i$ [m/s]")


def draw_turn_rates(axes: Axes, trajectory: FlockTrajectory, files: Files) -> None:
    """Turn rates of each file."""
    draw_files(axes, trajectory.t, np.degrees(trajectory.u), files)
    axes.set_ylabel("$u_i$ [deg/s]")


def draw_files(axes: Axes, t: FloatArray, values: FloatArray, files: Files) -> None:
    """Range over each file's agents as a band; the leader as a line."""
    for number, colour in reversed(_by_file(files)):
        of_file = values[:, files == number]
        axes.fill_between(t, of_file.min(axis=1), of_file.max(axis=1), color=colour, alpha=0.35, lw=0.6)
    axes.plot(t, values[:, 0], color=LEADER, lw=1.2)
    low, high = np.quantile(values, (0.001, 0.999)).tolist()
    margin = 0.15 * max(high - low, 1e-3)
    axes.set_ylim(low - margin, high + margin)


def _draw_headings(axes: Axes, poses: FloatArray, colours: list[Colour]) -> None:
    axes.quiver(
        poses[:, 0],
        poses[:, 1],
        np.cos(poses[:, 2]),
        np.sin(poses[:, 2]),
        color=colours,
        angles="xy",
        scale_units="xy",
        scale=2.2,
        width=0.0022,
        headwidth=5.0,
        zorder=3,
        pivot="mid",
    )


def _by_file(files: Files) -> list[tuple[int, Colour]]:
    last = max(1, int(files.max()))
    return [(number, colormaps["viridis"](0.92 * number / last)) for number in range(1, last + 1)]


def _colours(files: Files) -> list[Colour]:
    of_file = dict(_by_file(files))
    return [of_file.get(int(number), (0.75, 0.22, 0.17, 1.0)) for number in files]
