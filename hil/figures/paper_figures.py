"""Single figures for a two-column paper: one file each, PDF or SVG, as wide as a column, fonts embedded."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from hil.errors import UsageError
from hil.log.written_aside import written_aside

Kind = Literal["pdf", "svg"]
KINDS: tuple[Kind, ...] = ("pdf", "svg")

WIDTH = 3.4
"""Of a column [in]."""
_FLAT, _SQUARE = 1.75, 3.1
_TEXT, _SMALL = 8.0, 7.0
_STYLE: Any = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": _TEXT,
    "axes.labelsize": _TEXT,
    "axes.titlesize": _TEXT,
    "xtick.labelsize": _SMALL,
    "ytick.labelsize": _SMALL,
    "legend.fontsize": _SMALL,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "axes.unicode_minus": True,
    "pdf.fonttype": 42,
    "ps.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "abreast",
}
_UNDATED = {"pdf": {"CreationDate": None, "Producer": None, "Creator": None}, "svg": {"Date": None}}
_MOST_COLUMNS, _SHORT_COLUMNS, _SHORT = 4, 5, 9
"""Of a legend with long labels, with short ones, and how many letters are short."""


@dataclass(frozen=True, slots=True)
class PaperFigure:
    """One figure: the name of its file, and what draws it; ``square``: as high as it is wide, else flat.

    ``over``: from when to when its time goes [s], where it is one over time; ``polar``: on polar axes.
    """

    name: str
    draw: Callable[[Axes], object]
    over: tuple[float, float] | None = None
    square: bool = False
    polar: bool = False


def write_paper_figures(figures: Sequence[PaperFigure], folder: Path, kind: Kind) -> None:
    """Write each figure into the folder, which is made; the same figures give the same bytes.

    Raises :class:`UsageError` where it cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for each in figures:
            with rc_context(_STYLE):
                figure = _drawn(each)
                with written_aside(folder / f"{each.name}.{kind}") as aside:
                    figure.savefig(aside, format=kind, metadata=_UNDATED[kind])
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written ({error.strerror}); choose another --out") from error


def _drawn(each: PaperFigure) -> Figure:
    figure = Figure(figsize=(WIDTH, _SQUARE if each.square or each.polar else _FLAT), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(projection="polar" if each.polar else None)
    each.draw(axes)
    if each.over is not None:
        axes.set_xlim(*each.over)
        axes.set_xlabel("$t$ [s]")
        axes.xaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 5, 10]))
    if not each.polar:
        axes.grid(alpha=0.25, lw=0.5)
    for text in axes.texts:
        text.set_fontsize(_SMALL)
    axes.tick_params(labelsize=_SMALL)
    _put_legend_above(axes)
    return figure


def _put_legend_above(axes: Axes) -> None:
    """What each line is, above the picture: no data are hidden there."""
    handles, labels = axes.get_legend_handles_labels()
    if (drawn := axes.get_legend()) is not None:
        drawn.remove()
    if handles:
        columns = min(len(handles), _SHORT_COLUMNS if max(map(len, labels)) < _SHORT else _MOST_COLUMNS)
        axes.figure.legend(
            handles,
            labels,
            loc="outside upper center",
            ncols=columns,
            frameon=False,
            handlelength=1.5,
            columnspacing=1.0,
            borderaxespad=0.1,
        )
