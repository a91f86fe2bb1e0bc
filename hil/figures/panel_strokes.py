"""Strokes that the panels of a run's picture share: bounds, bands, and marks of violations."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from formation.angles import FloatArray
from hil.figures.plot_data import outside, with_gaps

BELIEVED, LIMIT = "#2a8f4c", "#b03030"


def draw_bounds(axes: Axes, t: FloatArray, low: FloatArray, high: FloatArray, label: str) -> None:
    """Draw both sides of a bound, which goes by that name in the legend."""
    for index, side in enumerate((low, high)):
        axes.plot(*with_gaps(t, side), color=LIMIT, lw=0.9, alpha=0.8, label=label if index == 0 else None)


def fill_band(axes: Axes, t: FloatArray, centre: FloatArray, reach: FloatArray) -> None:
    """Fill three standard deviations, the ``reach``, to both sides of an estimate."""
    moments, low = with_gaps(t, centre - reach)
    _, high = with_gaps(t, centre + reach)
    axes.fill_between(moments, low, high, color=BELIEVED, alpha=0.2, lw=0, label=r"$3\sigma$")


def mark_violations(
    axes: Axes, t: FloatArray, where: FloatArray, error: FloatArray, bound: FloatArray
) -> None:
    """Mark the samples whose error exceeds the bound, and count them in the legend."""
    broken = outside(error, bound)
    if np.any(broken):
        label = f"violated ({np.count_nonzero(broken)})"
        axes.plot(t[broken], where[broken], ls="none", marker="x", ms=5, mew=1.5, color=LIMIT, label=label)


def limit_to(axes: Axes, low: float, high: float) -> None:
    """Cut the axis where a quantity cannot sensibly be; what is drawn there belongs to the settling."""
    bottom, top = axes.get_ylim()
    axes.set_ylim(max(bottom, low), min(top, high))
