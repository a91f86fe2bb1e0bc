"""How much of their bounds the errors used up."""

from __future__ import annotations

import math

import numpy as np

from hil.figures.plot_data import PlotData
from hil.reports.colours import BELIEVED, BOUND, PURPLE, TRUE
from hil.reports.plots import Key, Panel, TimeAxis, draw_level, draw_line, hover, limits_around, table

_LABELS = {"v1": "v₁", "alpha1": "α₁", "h": "h"}
_COLOURS = {"v1": BELIEVED, "alpha1": PURPLE, "h": TRUE}


def tightness_panel(data: PlotData, axis: TimeAxis) -> Panel | None:
    """Every error as a share of the bound that is drawn elsewhere [%]; None where no error is known."""
    t = data.seconds(data.columns.samples.capture_ns)
    used = {}
    for name, error in data.errors.items():
        bound = data.bounds[name]
        share = np.divide(error, bound, out=np.full(len(t), math.nan), where=bound > 0.0)
        if np.any(np.isfinite(share)):
            used[name] = 100.0 * share
    if not used:
        return None
    _, high = limits_around(*used.values(), np.array([110.0]))
    plot = axis.panel("error / bound [%]", (0.0, high))
    draw_level(plot, 100.0, BOUND, "dashed")
    for name, share in used.items():
        line = draw_line(plot, table(t, share, {"y": share}), "y", _COLOURS[name], width=1.0)
        hover(plot, line, {f"{_LABELS[name]} at": "@t{0.00} s", "used up": "@y{0.0} %"})
    keys = [Key(_LABELS[name], _COLOURS[name]) for name in used]
    says = f"Errors, each as a share of its {data.bound_words}; above 100 % that is violated."
    return Panel("Bounds used up", says, (*keys, Key(data.bound_words, BOUND, "dashed")), plot)
