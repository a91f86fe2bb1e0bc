"""Guaranteed radii in the plots of estimates and of their errors."""

from __future__ import annotations

import numpy as np

from hil.figures.plot_data import PlotData
from hil.reports.colours import PURPLE
from hil.reports.plot_models import Figure
from hil.reports.plots import Key, draw_line, table

_CERTIFIED = ("v1", "alpha1")


def largest_radius(data: PlotData, quantity: str, scale: float) -> float | None:
    """Largest scaled certified radius of a quantity; None where it has none."""
    if quantity not in _CERTIFIED:
        return None
    radius = getattr(data.certified, f"radius_{quantity}")
    known = radius[np.isfinite(radius)]
    return scale * float(np.max(known)) if len(known) else None


def draw_certified(plot: Figure, data: PlotData, quantity: str, scale: float, *, of_error: bool) -> Key:
    """Dashed lines at the radius to both sides of the estimate, or of zero in a plot of its error."""
    columns = data.certified
    radius = scale * getattr(columns, f"radius_{quantity}")
    centre = np.zeros_like(radius) if of_error else scale * getattr(columns, quantity)
    sides = {"low": centre - radius, "high": centre + radius}
    source = table(data.seconds(columns.capture_ns), radius, sides)
    for side in sides:
        draw_line(plot, source, side, PURPLE, dash="dashed", width=1.0)
    return Key("certified", PURPLE, "dashed")
