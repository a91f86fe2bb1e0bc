"""The picture of a run: tracks from above, shape, estimates with bounds, commands and latency."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from PIL import Image

from hil.figures.paper_figures import PaperFigure
from hil.figures.plot_data import PlotData
from hil.figures.robot_drawing import draw_pair
from hil.figures.run_panels import Panel, panels_for
from hil.judge.columns import inside
from hil.judge.made_by import made_by
from hil.log.written_aside import written_aside

DPI = 96
_HEIGHT = 8.4
_TRACKS_WIDTH, _STACK_WIDTH = 5.4, 3.85
# Margins in inches: fixed, since a layout engine would take longer than all the drawing.
_LEFT, _RIGHT, _TOP, _BOTTOM, _BETWEEN = 0.72, 0.14, 0.62, 0.48, 0.84
_RATIOS = (3.7, 1.0)
_LABEL_OFFSET = 0.54
_COLOURS = 255
_UNJUDGED = "#000000"


def draw_run(data: PlotData, summary: Mapping[str, Any], path: Path) -> None:
    """Write a PNG of a run or a replay; ``summary`` is what :func:`hil.judge.summary.summarise` says of it.

    What the run data does not hold is left out: without truth the tracks, without commands their panels.
    """
    figure = _figure(data)
    figure.suptitle(_title(summary), fontsize=11, y=1.0 - 0.1 / _HEIGHT)
    _save(figure, path)


def run_paper_figures(data: PlotData) -> list[PaperFigure]:
    """Each panel of the picture on its own, and the tracks; what there is."""
    run = data.columns.run
    first, last = data.seconds(np.array([run.from_ns, run.to_ns])).tolist()

    def from_above(axes: Axes) -> None:
        _draw_tracks(axes, data)
        axes.margins(0.14)

    tracks = PaperFigure("tracks", from_above, square=True)
    panels = [
        PaperFigure(panel.__name__.removeprefix("draw_"), _of(panel, data), (first, last))
        for stack in panels_for(data)
        for panel in stack
    ]
    return [tracks, *panels] if np.any(np.isfinite(data.columns.truth.rho)) else panels


def _of(panel: Panel, data: PlotData) -> Callable[[Axes], None]:
    return lambda axes: panel(axes, data)


def _figure(data: PlotData) -> Figure:
    """Tracks over the latency to the left, then two stacks of panels; what there is."""
    below, *stacks = panels_for(data)
    tracks = bool(np.any(np.isfinite(data.columns.truth.rho)))
    if not tracks:
        stacks, below = [[*stacks[0], *below], stacks[1]], []
    widths = ([_TRACKS_WIDTH] if tracks else []) + [_STACK_WIDTH for stack in stacks if stack]
    width = sum(widths) + _LEFT + _RIGHT + _BETWEEN * (len(widths) - 1)
    figure = Figure(
        figsize=(round(max(width, _TRACKS_WIDTH) * DPI) / DPI, round(_HEIGHT * DPI) / DPI), dpi=DPI
    )
    edges = {"bottom": _BOTTOM / _HEIGHT, "top": 1.0 - _TOP / _HEIGHT}
    left = _LEFT
    if tracks:
        across = {"left": left / width, "right": (left + _TRACKS_WIDTH) / width}
        grid = figure.add_gridspec(
            1 + len(below), 1, height_ratios=_RATIOS[: 1 + len(below)], hspace=0.2, **across, **edges
        )
        _draw_tracks(figure.add_subplot(grid[0]), data)
        _draw_stack([figure.add_subplot(grid[1 + row]) for row in range(len(below))], below, data)
        left += _TRACKS_WIDTH + _BETWEEN
    for stack in filter(None, stacks):
        right = left + _STACK_WIDTH
        grid = figure.add_gridspec(
            len(stack), 1, left=left / width, right=right / width, hspace=0.12, **edges
        )
        _draw_stack([figure.add_subplot(grid[row]) for row in range(len(stack))], stack, data)
        left = right + _BETWEEN
    return figure


def _draw_tracks(axes: Axes, data: PlotData) -> None:
    truth, run = data.columns.truth, data.columns.run
    during = inside(truth.capture_ns, run)
    draw_pair(
        axes,
        data.seconds(truth.capture_ns[during]),
        truth.leader[during],
        truth.follower[during],
    )


def _draw_stack(rows: list[Axes], stack: list[Panel], data: PlotData) -> None:
    """Panels below each other over the same time; shaded where the run is not judged."""
    if not stack:
        return
    run, span = data.columns.run, data.columns.span
    first, last = (float(data.seconds(np.array([moment]))[0]) for moment in (run.from_ns, run.to_ns))
    judged_from = float(data.seconds(np.array([span.from_ns]))[0])
    for axes, panel in zip(rows, stack, strict=True):
        panel(axes, data)
        axes.set_xlim(first, last)
        if judged_from > first:
            axes.axvspan(first, judged_from, color=_UNJUDGED, alpha=0.045, lw=0, zorder=0)
            if axes is rows[0]:
                axes.text(0.012, 0.04, "not judged", transform=axes.transAxes, fontsize=7.5, color="#666666")
        axes.grid(alpha=0.25)
        axes.tick_params(labelbottom=axes is rows[-1])
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.22 * (high - low))
        axes.legend(
            loc="upper right",
            ncols=5,
            fontsize=8,
            handlelength=1.4,
            borderpad=0.15,
            borderaxespad=0.25,
            framealpha=0.75,
            edgecolor="none",
        )
    rows[-1].set_xlabel("t [s]")
    for axes in rows:
        axes.xaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 5, 10]))
        axes.yaxis.set_label_coords(-_LABEL_OFFSET * DPI / axes.bbox.width, 0.5)
        axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))


def _save(figure: Figure, path: Path) -> None:
    """Write the figure with a palette: a third of the bytes, and no difference to the eye."""
    FigureCanvasAgg(figure)
    drawn = BytesIO()
    figure.savefig(drawn, format="rgba", dpi=DPI)
    size = (round(figure.bbox.width), round(figure.bbox.height))
    picture = Image.frombuffer("RGBA", size, drawn.getvalue()).convert("RGB")
    small = picture.quantize(_COLOURS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    with written_aside(path) as aside:
        small.save(aside, "PNG")


def _title(summary: Mapping[str, Any]) -> str:
    """Two lines: what was run, and how well it went."""
    run = [
        f"{summary['scenario']}",
        f"{summary['mode']}, {summary['duration_s']:.3g} s",
        *made_by(summary),
    ]
    if "seed" in summary:
        run.append(f"seed {summary['seed']}")
    return " · ".join(run) + "\n" + " · ".join(_findings(summary))


def _findings(summary: Mapping[str, Any]) -> list[str]:
    estimation = summary["estimation"]
    found = [f"from {estimation['evaluated_from_s']:.3g} s on"]
    rmse = estimation.get("rmse", {})
    if "v1" in rmse:
        found.append(f"$v_1$ RMSE {1e3 * rmse['v1']:.1f} mm/s")
    if "alpha1" in rmse:
        found.append(rf"$\alpha_1$ RMSE {math.degrees(rmse['alpha1']):.1f}°")
    formation = summary.get("formation", {})
    if "rho_min" in formation:
        found.append(rf"$\rho$ in [{formation['rho_min']:.3f}, {formation['rho_max']:.3f}] m")
    bounds = summary["bounds"]
    published = bounds.get("published", {})
    if "violations" in published:
        broken = sum(published["violations"].values())
        found.append(f"published bounds broken in {broken} of {published['checked']}")
    elif "violations" in bounds:
        broken = max(count for name, count in bounds["violations"].items() if name.endswith("_extended"))
        found.append(f"extended bounds broken in {broken} of {bounds['checked']}")
    latency = summary.get("latency_ms", {}).get("capture_to_command")
    if latency:
        found.append(f"latency p99 {latency['p99']:.0f} ms")
    return found
