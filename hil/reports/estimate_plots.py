"""Estimates over time with their three standard deviations, their errors, and the bounds of these."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.tracking.estimate import QUANTITIES
from formation.angles import FloatArray
from hil.figures.plot_data import PlotData, broken_at_jumps, outside
from hil.judge.columns import EstimateColumns, inside
from hil.judge.estimation import errors_at
from hil.reports.certified_lines import draw_certified, largest_radius
from hil.reports.colours import BELIEVED, BOUND, GREY, TRUE
from hil.reports.decimation import decimated_rows
from hil.reports.notation import SYMBOLS
from hil.reports.plot_models import Figure
from hil.reports.plots import (
    Key,
    Panel,
    TimeAxis,
    draw_band,
    draw_level,
    draw_line,
    draw_marks,
    hover,
    limits_around,
    marks,
    table,
)

_FARTHEST = 4.0
"""A bound so many times beyond what else is in the picture would flatten it, and is left to the words."""


@dataclass(frozen=True, slots=True)
class _Quantity:
    name: str
    symbol: str
    unit: str
    says: str

    @property
    def scale(self) -> float:
        """What a value in SI units is multiplied by for this unit."""
        return _DEGREES if self.unit.startswith("deg") else 1.0

    @property
    def error_unit(self) -> str:
        """Errors of speeds are small."""
        return "mm/s" if self.unit == "m/s" else self.unit

    @property
    def error_scale(self) -> float:
        """What an error in SI units is multiplied by for its unit."""
        return 1e3 if self.unit == "m/s" else self.scale


_DEGREES = math.degrees(1.0)
_SHOWN = (
    _Quantity("v1", "v₁", "m/s", "Leader's speed v₁"),
    _Quantity("alpha1", "α₁", "deg", "Leader's bearing α₁"),
    _Quantity("rho_dot", "ρ̇", "m/s", "Rate of the distance ρ̇"),
    _Quantity("alpha2_dot", "α̇₂", "deg/s", "Rate of the bearing α̇₂"),
    _Quantity("u1", "u₁", "deg/s", "Leader's turn rate u₁"),
)
_RATES = {"rho_dot": "M_rho", "alpha2_dot": "M_alpha2"}


def estimate_panels(data: PlotData, axis: TimeAxis) -> list[Panel]:
    """For every quantity its course, and where the truth is known its error; empty without estimates."""
    during = inside(data.tracked.capture_ns, data.columns.run)
    if not np.any(during):
        return []
    errors = errors_at(data.tracked, data.tracked_true)
    panels = []
    for quantity in _SHOWN:
        error = errors.get(quantity.name)
        panels.append(_course(data, axis, quantity, during, judged=error is None))
        if error is not None:
            panels.append(_error(data, axis, quantity, during, error))
    return panels


def _course(
    data: PlotData, axis: TimeAxis, quantity: _Quantity, during: NDArray[np.bool_], *, judged: bool
) -> Panel:
    """An estimate with three standard deviations and truth; with its bound if no error panel shows that."""
    t, scale = data.seconds(data.tracked.capture_ns)[during], quantity.scale
    value = scale * broken_at_jumps(_values(data.tracked, quantity.name)[during])
    reach = 3.0 * scale * data.tracked.sd[during, QUANTITIES.index(quantity.name)]
    source = table(t, value, {"y": value, "low": value - reach, "high": value + reach, "reach": reach})
    truth = data.columns.truth
    known = inside(truth.capture_ns, data.columns.run) & np.isfinite(getattr(truth, quantity.name))
    true = scale * broken_at_jumps(np.asarray(getattr(truth, quantity.name))[known])
    plot = axis.panel(f"{quantity.symbol} [{quantity.unit}]", _limits(data, quantity, value, true))
    keys = [Key("estimate", BELIEVED), Key("3 σ", BELIEVED, "band")]
    tips = {"t": "@t{0.00} s", "estimate": f"@y{{0.0000}} {quantity.unit}", "3 σ": "±@reach{0.0000}"}
    draw_band(plot, source, "low", "high", BELIEVED)
    hover(plot, draw_line(plot, source, "y", BELIEVED, width=1.1), tips)
    says = f"{quantity.says} as estimated"
    if len(true):
        truth_table = table(data.seconds(truth.capture_ns[known]), true, {"y": true})
        draw_line(plot, truth_table, "y", TRUE)
        keys.append(Key(data.truth_name, TRUE))
        says += ", and as it was"
    bound = _bound(data, quantity.name, scale) if judged else None
    if bound is not None:
        at, centre = _judged(data), scale * _values(data.columns.samples, quantity.name)
        sides = table(at, bound, {"low": centre - bound, "high": centre + bound})
        for side in ("low", "high"):
            draw_line(plot, sides, side, BOUND, width=1.0)
        keys.append(Key(_bound_words(data, quantity, "assumed bound"), BOUND))
        says += f"; its error is bounded by {_range(bound, quantity.unit)} if the scenario's noise holds"
    if judged and largest_radius(data, quantity.name, scale) is not None:
        keys.append(draw_certified(plot, data, quantity.name, scale, of_error=False))
    return Panel(quantity.says, says + ".", tuple(keys), plot)


def _error(
    data: PlotData, axis: TimeAxis, quantity: _Quantity, during: NDArray[np.bool_], error: FloatArray
) -> Panel:
    """Estimate minus truth between three standard deviations and the bound; samples outside are marked."""
    scale, unit = quantity.error_scale, quantity.error_unit
    t, error = data.seconds(data.tracked.capture_ns)[during], scale * error[during]
    reach = 3.0 * scale * data.tracked.sd[during, QUANTITIES.index(quantity.name)]
    largest = float(np.max(np.abs(error), where=np.isfinite(error), initial=0.0))
    height = min(
        max(1.1 * largest, 1.4 * float(np.median(reach))), 4.0 * float(np.median(reach)) + 1.1 * largest
    )
    keys = [Key("error", BELIEVED), Key("3 σ", BELIEVED, "band")]
    says = f"Error of {quantity.symbol}: estimate minus truth."
    bound = _bound(data, quantity.name, scale)
    limited = None if bound is None else bound[np.isfinite(bound)]
    drawn = limited is not None and len(limited) > 0 and float(np.min(limited)) < _FARTHEST * height
    if limited is not None and drawn:
        height = max(height, min(1.1 * float(np.max(limited)), _FARTHEST * height))
    radius = largest_radius(data, quantity.name, scale)
    certified = radius is not None and radius < _FARTHEST * height
    if radius is not None:
        height = max(height, 1.1 * radius) if certified else height
        where = "" if certified else ", outside the picture"
        says += f" Certified radius: up to {radius:.3g} {unit}{where}."
    plot = axis.panel(f"error [{unit}]", (-height, height))
    source = table(t, error, {"y": error, "low": -reach, "high": reach})
    draw_band(plot, source, "low", "high", BELIEVED)
    draw_level(plot, 0.0, GREY, "solid")
    tips = {
        "t": "@t{0.00} s",
        "error": f"@y{{0.000}} {unit}",
        "3 σ": f"±@high{{0.000}} {unit}",
    }
    hover(plot, draw_line(plot, source, "y", BELIEVED, width=1.1), tips)
    if certified:
        keys.append(draw_certified(plot, data, quantity.name, scale, of_error=True))
    if bound is not None:
        label = _bound_words(data, quantity, "largest judged error")
        says += f" {label[0].upper()}{label[1:]}: {_range(bound, unit)}"
        says += "." if drawn else ", outside the picture."
        if drawn:
            sides = table(_judged(data), bound, {"high": bound, "low": -bound})
            for side in ("low", "high"):
                draw_line(plot, sides, side, BOUND, width=1.0)
            keys.append(Key(label, BOUND))
        at_samples = errors_at(data.columns.samples, data.columns.true).get(quantity.name)
        broken = None if at_samples is None else outside(np.abs(at_samples), bound / scale)
        if at_samples is not None and broken is not None and np.any(broken):
            _mark(plot, _judged(data)[broken], scale * at_samples[broken], height)
            keys.append(Key(f"violated ({np.count_nonzero(broken)})", BOUND, "cross"))
            says += f" Violated in {np.count_nonzero(broken)} of {len(bound)} samples."
    return Panel(f"Error of {quantity.symbol}", says, tuple(keys), plot)


def _values(estimates: EstimateColumns, name: str) -> FloatArray:
    return estimates.u1 if name == "u1" else np.asarray(getattr(estimates.seen, name), dtype=np.float64)


def _judged(data: PlotData) -> FloatArray:
    return data.seconds(data.columns.samples.capture_ns)


def _bound_words(data: PlotData, quantity: _Quantity, of_rate: str) -> str:
    """What the bound of :func:`_bound` is called; ``of_rate``: what that of a rate is."""
    return f"{of_rate} {SYMBOLS[_RATES[quantity.name]]}" if quantity.name in _RATES else data.bound_words


def _bound(data: PlotData, name: str, scale: float) -> FloatArray | None:
    """Scaled bound of a quantity's error at every judged sample; of rates the largest error seen."""
    if name in _RATES and data.worst is not None:
        rate = np.asarray(getattr(data.worst.rates, _RATES[name]), dtype=np.float64)
        return np.broadcast_to(scale * rate, (len(data.columns.samples.capture_ns),))
    bound = data.bounds.get(name)
    return None if bound is None else scale * bound


def _limits(data: PlotData, quantity: _Quantity, value: FloatArray, true: FloatArray) -> tuple[float, float]:
    """Limits of a course; what no leader of the scenario can do belongs to the settling and is cut off."""
    leader = data.run_data.scenario.leader
    if quantity.name == "v1":
        return limits_around(value, true, floor=0.0, ceiling=1.8 * max(leader.k_v, float(np.median(value))))
    if quantity.name == "u1":
        most = 2.0 * quantity.scale * leader.k_u
        return limits_around(value, true, floor=-most, ceiling=most)
    return limits_around(value, true)


def _range(bound: FloatArray, unit: str) -> str:
    """The median, as the verdict tells it, and from where to where a bound goes."""
    low, middle, high = (f"{float(each):.3g}" for each in (np.min(bound), np.median(bound), np.max(bound)))
    return f"{low} {unit}" if low == high else f"{middle} {unit} (median; {low} to {high})"


def _mark(plot: Figure, t: FloatArray, error: FloatArray, height: float) -> None:
    """Crosses at samples that violate their bound; those beyond the picture at its edge."""
    rows = decimated_rows(error)
    drawn_at = np.clip(error[rows], -0.97 * height, 0.97 * height)
    draw_marks(plot, marks(t[rows], drawn_at), "x", BOUND, 8.0)
