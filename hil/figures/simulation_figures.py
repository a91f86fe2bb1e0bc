"""Pictures of the noise-free experiments, laid out like the paper's Fig. 2 and Fig. 3."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import MaxNLocator

from formation.angles import FloatArray
from formation.closed_loop import Trajectory
from formation.periodic_orbit import PeriodicOrbit
from formation.shape import ABREAST_ALPHA1, ABREAST_ALPHA2
from hil.extensions.reference import is_reference, short
from hil.figures.paper_figures import PaperFigure
from hil.log.written_aside import written_aside
from hil.scenario.parts import station
from hil.scenario.schema import Scenario

LEADER, FOLLOWER = "#1f5fa8", "#d9741a"
ORBIT, NOW, QUIET, LIMIT = "#3c3c3c", "#2a8f4c", "#8a8a8a", "#b03030"
MOMENTS = 7
DPI = 130
_QUARTERS = {
    -math.pi: "$-180$",
    ABREAST_ALPHA1: "$-90$",
    0.0: "$0$",
    ABREAST_ALPHA2: "$90$",
    math.pi: "$180$",
}
"""Angles [rad] where bearings have ticks, and what these are called, in degrees."""
_POLAR_TICKS = tuple(f"${angle}$°" for angle in (0, 45, 90, 135, 180, -135, -90, -45))


def draw_simulation(
    scenario: Scenario, trajectory: Trajectory, orbit: PeriodicOrbit | None, path: Path
) -> None:
    """Write a PNG like Fig. 2: (i) tracks, (ii) polar plot of the shape, (iii) bearings and controls."""
    figure = _figure(scenario, trajectory, 14.0, 5.0)
    grid = figure.add_gridspec(3, 3, width_ratios=(1.05, 0.95, 1.2))
    draw_tracks(figure.add_subplot(grid[:, 0]), trajectory, scenario.formation.rho_0)
    # The layout engine does not reserve room for what sticks out of a polar plot: give it empty rows.
    middle = grid[:, 1].subgridspec(3, 1, height_ratios=(0.05, 1.0, 0.13))
    polar = figure.add_subplot(middle[1], projection="polar")
    assert isinstance(polar, PolarAxes)
    draw_polar(polar, scenario, trajectory, orbit)
    rows = [figure.add_subplot(grid[row, 2]) for row in range(3)]
    draw_bearings(rows[0], scenario, trajectory)
    draw_speed(rows[1], scenario, trajectory)
    draw_turn_rate(rows[2], scenario, trajectory)
    _share_time(rows, trajectory)
    _save(figure, path)


def draw_experiment(scenario: Scenario, trajectory: Trajectory, path: Path) -> None:
    """Write a PNG like Fig. 3: (a) tracks, (b) shape variables and controls over time."""
    figure = _figure(scenario, trajectory, 11.5, 6.0)
    grid = figure.add_gridspec(4, 2, width_ratios=(1.0, 1.15))
    draw_tracks(figure.add_subplot(grid[:, 0]), trajectory, scenario.formation.rho_0)
    rows = [figure.add_subplot(grid[row, 1]) for row in range(4)]
    draw_distance(rows[0], trajectory, scenario.formation.rho_0)
    draw_bearings(rows[1], scenario, trajectory)
    draw_speed(rows[2], scenario, trajectory)
    draw_turn_rate(rows[3], scenario, trajectory)
    _share_time(rows, trajectory)
    _save(figure, path)


def simulation_paper_figures(
    scenario: Scenario, trajectory: Trajectory, orbit: PeriodicOrbit | None
) -> list[PaperFigure]:
    """Each panel of both pictures on its own."""

    def polar(axes: Axes) -> None:
        assert isinstance(axes, PolarAxes)
        draw_polar(axes, scenario, trajectory, orbit)

    over = (float(trajectory.t[0]), float(trajectory.t[-1]))
    rho_0 = scenario.formation.rho_0
    return [
        PaperFigure("tracks", lambda axes: draw_tracks(axes, trajectory, rho_0), square=True),
        PaperFigure("shape", polar, polar=True),
        PaperFigure("distance", lambda axes: draw_distance(axes, trajectory, rho_0), over),
        PaperFigure("bearings", lambda axes: draw_bearings(axes, scenario, trajectory), over),
        PaperFigure("v2", lambda axes: draw_speed(axes, scenario, trajectory), over),
        PaperFigure("u2", lambda axes: draw_turn_rate(axes, scenario, trajectory), over),
    ]


def draw_tracks(axes: Axes, trajectory: Trajectory, rho_0: float) -> None:
    """Both tracks from above, robots drawn at equally spaced moments with growing opacity."""
    leader, follower = trajectory.leader, trajectory.follower
    axes.plot(leader[:, 0], leader[:, 1], color=LEADER, lw=1.2, alpha=0.7, label="leader", zorder=2)
    axes.plot(follower[:, 0], follower[:, 1], color=FOLLOWER, lw=1.2, alpha=0.7, label="follower", zorder=2)
    moments = np.linspace(0, len(trajectory.t) - 1, MOMENTS).round().astype(int)
    for row, opacity in zip(moments, np.linspace(0.2, 1.0, MOMENTS).tolist(), strict=True):
        ends = np.stack([leader[row, :2], follower[row, :2]])
        axes.plot(ends[:, 0], ends[:, 1], color=QUIET, lw=0.8, alpha=opacity, zorder=1)
        _draw_robot(axes, leader[row], 0.22 * rho_0, LEADER, opacity)
        _draw_robot(axes, follower[row], 0.22 * rho_0, FOLLOWER, opacity)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.grid(alpha=0.25)
    axes.legend(loc="best", frameon=False, fontsize=9)


def draw_polar(
    axes: PolarAxes, scenario: Scenario, trajectory: Trajectory, orbit: PeriodicOrbit | None
) -> None:
    """Shape in the plane: radius rho / rho_0 at angle alpha1 (of the follower) and alpha2 (of the leader)."""
    rho_0, wanted = scenario.formation.rho_0, station(scenario)
    radius = trajectory.rho / rho_0
    curves = (
        (trajectory.alpha1, wanted.alpha1, LEADER, r"$(\rho/\rho_0,\ \alpha_1)$"),
        (trajectory.alpha2, wanted.alpha2, FOLLOWER, r"$(\rho/\rho_0,\ \alpha_2)$"),
    )
    for angle, desired, colour, label in curves:
        axes.plot(np.unwrap(angle), radius, color=colour, lw=1.4, label=label)
        axes.plot(angle[0], radius[0], "o", ms=6, mfc="white", mec=colour, zorder=4)
        axes.plot(desired, 1.0, "o", ms=8, color=colour, zorder=5, clip_on=False)
    if orbit is not None and float(np.ptp(orbit.rho)) > 1e-6 * rho_0:
        axes.plot(
            np.unwrap(orbit.alpha1), orbit.rho / rho_0, color=ORBIT, lw=1.0, ls="--", label="orbit", zorder=6
        )
    final = f"t = {trajectory.t[-1]:g} s"
    axes.plot(trajectory.alpha1[-1], radius[-1], "o", ms=5, color=NOW, zorder=7, label=final)
    axes.set_rmax(1.08 * float(radius.max()))
    axes.set_rlabel_position(180.0)
    axes.yaxis.set_major_locator(MaxNLocator(4, prune="lower"))
    axes.set_xticks(np.arange(8) * math.pi / 4)
    axes.set_xticklabels(_POLAR_TICKS)
    axes.tick_params(labelsize=8, colors="#444444")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2, frameon=False, fontsize=9)


def draw_distance(axes: Axes, trajectory: Trajectory, rho_0: float) -> None:
    """Distance over time, rho_0 dashed."""
    axes.axhline(rho_0, color=ORBIT, lw=1.0, ls="--")
    axes.plot(trajectory.t, trajectory.rho, color=NOW, lw=1.4)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel(r"$\rho$ [m]")


def draw_bearings(axes: Axes, scenario: Scenario, trajectory: Trajectory) -> None:
    """Bearings over time, their desired values dashed."""
    wanted = station(scenario)
    for angle, desired, colour, label in (
        (trajectory.alpha1, wanted.alpha1, LEADER, r"$\alpha_1$"),
        (trajectory.alpha2, wanted.alpha2, FOLLOWER, r"$\alpha_2$"),
    ):
        for side in (desired, -desired) if scenario.formation.change_sides_at_s else (desired,):
            axes.axhline(side, color=colour, lw=1.0, ls="--", alpha=0.8)
        axes.plot(trajectory.t, _broken_at_jumps(angle), color=colour, lw=1.4, label=label)
    low = (
        min(float(trajectory.alpha1.min()), float(trajectory.alpha2.min()), wanted.alpha1, wanted.alpha2)
        - 0.3
    )
    high = (
        max(float(trajectory.alpha1.max()), float(trajectory.alpha2.max()), wanted.alpha1, wanted.alpha2)
        + 0.3
    )
    axes.set_ylim(low, high)
    axes.set_yticks([tick for tick in _QUARTERS if low <= tick <= high])
    axes.set_yticklabels([text for tick, text in _QUARTERS.items() if low <= tick <= high])
    axes.set_ylabel(r"$\alpha_i$ [deg]")
    axes.legend(loc="center right", ncols=2, frameon=False, fontsize=9, borderaxespad=0.1)


def draw_speed(axes: Axes, scenario: Scenario, trajectory: Trajectory) -> None:
    """Follower's speed over time; dashed what holds the station: v1 + rho_0 u1 abreast on the right."""
    across = np.full(len(trajectory.t), station(scenario).sin)
    if scenario.formation.change_sides_at_s:
        across = np.copysign(across, trajectory.alpha2)
    desired = trajectory.v1 + scenario.formation.rho_0 * trajectory.u1 / across
    limit = _named_limit(scenario, scenario.controller.v_max)
    _draw_control(axes, trajectory.t, trajectory.v2, desired, limit)
    axes.set_ylabel("$v_2$ [m/s]")


def draw_turn_rate(axes: Axes, scenario: Scenario, trajectory: Trajectory) -> None:
    """Follower's turn rate over time; dashed u1, the rate that holds the formation exactly."""
    limit = _named_limit(scenario, math.degrees(scenario.controller.u_max))
    _draw_control(axes, trajectory.t, np.degrees(trajectory.u2), np.degrees(trajectory.u1), limit)
    axes.set_ylabel("$u_2$ [deg/s]")


def _named_limit(scenario: Scenario, limit: float) -> tuple[float, str]:
    """A limit and what to call it: only a pair that is told to change sides keeps to it."""
    return limit, "limit" if scenario.formation.change_sides_at_s else "limit (not applied)"


def _draw_control(
    axes: Axes, t: FloatArray, driven: FloatArray, desired: FloatArray, named_limit: tuple[float, str]
) -> None:
    limit, name = named_limit
    axes.plot(t, desired, color=ORBIT, lw=1.0, ls="--", label="desired")
    axes.plot(t, driven, color=FOLLOWER, lw=1.4, label="follower")
    # A limit far outside what is driven would only flatten the curves.
    near = [side for side in (limit, -limit) if 1.5 * driven.min() <= side <= 1.5 * driven.max()]
    for index, side in enumerate(near):
        label = name if index == 0 else None
        axes.axhline(side, color=LIMIT, lw=1.0, ls=":", label=label)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.3 * (high - low))
    axes.legend(loc="upper right", ncols=3, frameon=False, fontsize=8, borderaxespad=0.1)


def _draw_robot(axes: Axes, pose: FloatArray, radius: float, colour: str, opacity: float) -> None:
    x, y, theta = (float(value) for value in pose)
    axes.add_patch(
        Circle((x, y), radius, facecolor=colour, edgecolor="white", lw=0.6, alpha=opacity, zorder=3)
    )
    corners = [theta, theta + 2.5, theta - 2.5]
    reach = (0.8, 0.65, 0.65)
    arrow = [
        (x + radius * r * math.cos(corner), y + radius * r * math.sin(corner))
        for r, corner in zip(reach, corners, strict=True)
    ]
    axes.add_patch(Polygon(arrow, closed=True, facecolor="white", lw=0, alpha=opacity, zorder=4))


def _broken_at_jumps(angle: FloatArray) -> FloatArray:
    """Angle with NaN where it passes through pi, so that no line is drawn across the panel."""
    broken = angle.copy()
    broken[1:][np.abs(np.diff(angle)) > math.pi] = math.nan
    return broken


def _share_time(rows: list[Axes], trajectory: Trajectory) -> None:
    for axes in rows:
        axes.set_xlim(float(trajectory.t[0]), float(trajectory.t[-1]))
        axes.grid(alpha=0.25)
        axes.tick_params(labelbottom=axes is rows[-1])
    rows[-1].set_xlabel("t [s]")
    rows[0].figure.align_ylabels(rows)


def _figure(scenario: Scenario, trajectory: Trajectory, width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    law = scenario.controller.law
    proposition = "of one's own" if is_reference(law) else "Prop. 2" if law == "independent" else "Prop. 1"
    figure.suptitle(
        f"{scenario.name}: {short(law)} law ({proposition}), noise-free, {trajectory.t[-1]:g} s",
        fontsize=11,
    )
    return figure


def _save(figure: Figure, path: Path) -> None:
    FigureCanvasAgg(figure)
    with written_aside(path) as aside:
        figure.savefig(aside, dpi=DPI, metadata={"Software": None})
