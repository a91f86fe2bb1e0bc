"""Picture of the propositions checked with numbers: V1 along the run, regions of attraction, gain."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from controllers.attraction import SettlingMap
from formation.spacing import Spacing
from hil.figures.paper_figures import PaperFigure
from hil.judge.stability import PROVED_V1, Gain, Stability
from hil.log.written_aside import written_aside
from hil.scenario.parts import gains
from hil.scenario.schema import Scenario

PROVED, RUN, WORST, TURN, LOST = "#b03030", "#1f5fa8", "#d9741a", "#2a8f4c", "#d8d8d8"
DPI = 130
_PI_TICKS = (-math.pi, -0.5 * math.pi, 0.0, 0.5 * math.pi, math.pi)
_PI_LABELS = ("$-180$", "$-90$", "$0$", "$90$", "$180$")


def draw_stability(scenario: Scenario, found: Stability, path: Path) -> None:
    """Write a PNG: three maps of settling times over the start, V1 along the run, and the gain."""
    figure = Figure(figsize=(14.0, 8.4), layout="constrained")
    figure.suptitle(f"{scenario.name}: the propositions in numbers", fontsize=11)
    grid = figure.add_gridspec(2, 6)
    spacing = gains(scenario).spacing
    longest = _longest(found)
    maps = []
    for column, (each, title) in enumerate(_titled(found)):
        axes = figure.add_subplot(grid[0, 2 * column : 2 * column + 2])
        mesh = draw_map(axes, each, spacing, longest)
        axes.set_title(f"{title}: {each.share:.1%} settle", fontsize=10)
        maps.append(axes)
    first = found.trajectory.shape_at(0)
    start = (first.alpha1, first.rho / spacing.rho_0)
    maps[0].plot(*start, "o", ms=6, mfc="white", mec=RUN, label="this run", clip_on=False)
    maps[0].legend(loc="lower left", fontsize=8, framealpha=0.9)
    figure.colorbar(mesh, ax=maps, label="settled after [s]", aspect=30)
    draw_lyapunov(figure.add_subplot(grid[1, :3]), found)
    draw_gain(figure.add_subplot(grid[1, 3:]), found.gain, spacing, found.margin.lower, found.margin.upper)
    FigureCanvasAgg(figure)
    with written_aside(path) as aside:
        figure.savefig(aside, dpi=DPI, metadata={"Software": None})


def stability_paper_figures(scenario: Scenario, found: Stability) -> list[PaperFigure]:
    """Each panel of the picture on its own."""
    spacing, longest, margin = gains(scenario).spacing, _longest(found), found.margin

    def settling(each: SettlingMap, title: str, axes: Axes) -> None:
        mesh = draw_map(axes, each, spacing, longest)
        axes.set_title(f"{title}: {each.share:.1%} settle")
        figure = axes.figure
        assert isinstance(figure, Figure)
        figure.colorbar(mesh, ax=axes, label="settled after [s]")

    names = ("settling-free", "settling-limited", "settling-turned")
    maps = [
        PaperFigure(name, partial(settling, each, title), square=True)
        for name, (each, title) in zip(names, _titled(found), strict=True)
    ]
    return [
        *maps,
        PaperFigure("lyapunov", lambda axes: draw_lyapunov(axes, found)),
        PaperFigure(
            "gain", lambda axes: draw_gain(axes, found.gain, spacing, margin.lower, margin.upper), square=True
        ),
    ]


def _longest(found: Stability) -> float:
    """Settling time [s] that has the last colour of the maps."""
    return max(
        float(np.nanquantile(each.settled_s, 0.98)) if each.share else 1.0
        for each in (found.free, found.limited)
    )


def _titled(found: Stability) -> tuple[tuple[SettlingMap, str], ...]:
    return (
        (found.free, r"no limits, $\alpha_2(0) = 90$°"),
        (found.limited, r"within limits, $\alpha_2(0) = 90$°"),
        (found.turned, rf"within limits, $\alpha_2(0) = {math.degrees(found.turned.alpha2):.0f}$°"),
    )


def draw_map(axes: Axes, found: SettlingMap, spacing: Spacing, longest: float) -> QuadMesh:
    """Settling time by start (grey: not within the time followed), and the edge of V1 < 2."""
    axes.set_facecolor(LOST)
    share = found.rho / spacing.rho_0
    mesh = axes.pcolormesh(
        found.alpha1, share, found.settled_s, shading="nearest", cmap="viridis_r", vmin=0.0, vmax=longest
    )
    alpha1, rho = np.linspace(-math.pi, math.pi, 181), np.geomspace(found.rho[0], found.rho[-1], 181)
    V1 = 1.0 + np.sin(alpha1)[None, :] + spacing.g(rho)[:, None]
    axes.contour(alpha1, rho / spacing.rho_0, V1, levels=[PROVED_V1], colors=PROVED, linewidths=1.5)
    axes.plot([], [], color=PROVED, lw=1.5, label="$V_1 = 2$")
    axes.set_yscale("log")
    axes.set_yticks([0.25, 0.5, 1.0, 2.0, 4.0])
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xticks(_PI_TICKS, _PI_LABELS)
    axes.set_xlabel(r"$\alpha_1(0)$ [deg]")
    axes.set_ylabel(r"$\rho(0) / \rho_0$")
    return mesh


def draw_lyapunov(axes: Axes, found: Stability) -> None:
    """V1 along the run of the scenario's law, and the level up to which Prop. 1 is proved."""
    axes.axhline(PROVED_V1, color=PROVED, lw=1.2, ls="--", label="proved region")
    axes.semilogy(found.trajectory.t, np.maximum(found.V1, 1e-12), color=RUN, lw=1.4, label="$V_1$")
    axes.set_xlim(float(found.trajectory.t[0]), float(found.trajectory.t[-1]))
    axes.set_xlabel("t [s]")
    axes.set_ylabel("$V_1$")
    axes.grid(alpha=0.25)
    axes.legend(loc="upper right", frameon=False, fontsize=9)


def draw_gain(axes: Axes, gain: Gain, spacing: Spacing, lower: float, upper: float) -> None:
    """Range of distances that any steering within k_u can bring about, and those of constant turns."""
    rho_0, k_u = spacing.rho_0, np.degrees(gain.k_u)
    axes.fill_between(
        k_u,
        gain.rho_min / rho_0,
        gain.rho_max / rho_0,
        color=WORST,
        alpha=0.25,
        lw=0,
        label="any steering",
    )
    for distance, label in ((gain.rho_outward, r"constant $u_1 = \pm k_u$"), (gain.rho_inward, None)):
        axes.plot(k_u, distance / rho_0, color=TURN, lw=1.4, label=label)
    axes.axhline(1.0, color="#8a8a8a", lw=1.0, ls="--")
    axes.axvline(math.degrees(gain.end), color=PROVED, lw=1.4, label=r"$\mu_\rho v_1$: the gain ends")
    axes.axvspan(
        math.degrees(lower), math.degrees(upper), color=RUN, alpha=0.12, lw=0, label="$k_u^*$ lies here"
    )
    axes.set_ylim(0.0, 5.0)
    axes.set_xlim(0.0, 1.05 * math.degrees(gain.end))
    axes.set_xlabel("bound $k_u$ of the leader's turn rate [deg/s]")
    axes.set_ylabel(r"$\rho / \rho_0$ in the long run")
    axes.grid(alpha=0.25)
    axes.legend(loc="upper left", frameon=False, fontsize=9)
