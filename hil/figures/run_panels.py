"""The panels of a run's picture, each a plot over time; none is drawn that has nothing to show."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes

from estimation.bounds.error_bounds import Values
from estimation.tracking.estimate import QUANTITIES
from formation.angles import FloatArray, wrap
from hil.figures.panel_strokes import (
    BELIEVED,
    LIMIT,
    draw_bounds,
    fill_band,
    limit_to,
    mark_violations,
)
from hil.figures.plot_data import PlotData, broken_at_jumps, with_gaps
from hil.figures.robot_drawing import FOLLOWER
from hil.judge.columns import inside
from hil.judge.summary import percentile

_DEGREES = math.degrees(1.0)
_WIDE = 8.0
"""Of latencies, from where on a linear axis would hide all but the longest."""
TRUE, ORBIT = "#3c3c3c", "#7a5fa8"
_FARTHEST = 4.0
"""A bound that is so many times out of the picture is left out: it would flatten the rest."""


def draw_distance(axes: Axes, data: PlotData) -> None:
    """Distance: true (estimated where the truth is not known), on the noise-free orbit, and desired."""
    _draw_desired(axes, data, 0, r"$\rho_0$")
    _draw_shape(axes, data, data.columns.truth.rho, data.tracked.seen.rho, 0)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel(r"$\rho$ [m]")


def draw_alpha1(axes: Axes, data: PlotData) -> None:
    """Bearing of the follower from the leader, as :func:`draw_distance`."""
    _draw_desired(axes, data, 1, "desired")
    _draw_shape(axes, data, data.columns.truth.alpha1, data.tracked.seen.alpha1, 1)
    axes.set_ylabel(r"$\alpha_1$ [deg]")


def draw_alpha2(axes: Axes, data: PlotData) -> None:
    """Bearing of the leader from the follower, as :func:`draw_distance`."""
    _draw_desired(axes, data, 2, "desired")
    _draw_shape(axes, data, data.columns.truth.alpha2, data.tracked.seen.alpha2, 2)
    axes.set_ylabel(r"$\alpha_2$ [deg]")


def draw_v1(axes: Axes, data: PlotData) -> None:
    """Leader's speed: estimate with three standard deviations, truth, and bound where it is judged."""
    columns, seen = data.columns, data.tracked.seen
    t, v1, sd = data.seconds(data.tracked.capture_ns), np.asarray(seen.v1), data.tracked.sd[:, 2]
    fill_band(axes, t, v1, 3.0 * sd)
    axes.plot(*with_gaps(t, v1), color=BELIEVED, lw=0.9, label="estimate")
    if np.any(np.isfinite(columns.truth.v1)):
        t_true = data.seconds(columns.truth.capture_ns)
        axes.plot(t_true, columns.truth.v1, color=TRUE, lw=1.2, label=data.truth_name)
    reach = max(data.run_data.scenario.leader.k_v, float(np.median(v1)))
    judged = data.seconds(columns.samples.capture_ns)
    if "v1" in data.bounds:
        bound, centre = data.bounds["v1"], np.asarray(columns.samples.seen.v1)
        if np.min(bound) < reach:
            draw_bounds(axes, judged, centre - bound, centre + bound, data.bound_words)
        mark_violations(axes, judged, centre, np.abs(centre - columns.true.v1), bound)
    limit_to(axes, 0.0, 1.8 * reach)
    axes.set_ylabel("$v_1$ [m/s]")


def draw_alpha1_error(axes: Axes, data: PlotData) -> None:
    """Error of the leader's bearing: estimate minus truth, three standard deviations, and bound."""
    columns = data.columns
    t, sd = data.seconds(data.tracked.capture_ns), _DEGREES * data.tracked.sd[:, QUANTITIES.index("alpha1")]
    error = _DEGREES * wrap(np.asarray(data.tracked.seen.alpha1) - data.tracked_true.alpha1)
    fill_band(axes, t, np.zeros(len(t)), 3.0 * sd)
    axes.plot(*with_gaps(t, error), color=BELIEVED, lw=0.9, label="error")
    reach = 4.0 * float(np.median(sd))
    judged = data.seconds(columns.samples.capture_ns)
    if "alpha1" in data.bounds:
        bound = _DEGREES * data.bounds["alpha1"]
        at_samples = _DEGREES * wrap(np.asarray(columns.samples.seen.alpha1) - columns.true.alpha1)
        largest = float(np.max(np.abs(at_samples), where=np.isfinite(at_samples), initial=0.0))
        reach = max(reach, 1.5 * largest)
        if np.max(bound) < _FARTHEST * reach:
            reach = max(reach, 1.15 * float(np.max(bound)))
            draw_bounds(axes, judged, -bound, bound, data.bound_words)
        mark_violations(axes, judged, at_samples, np.abs(at_samples) / _DEGREES, bound / _DEGREES)
    axes.set_ylim(-min(reach, 180.0), min(reach, 180.0))
    axes.set_ylabel(r"$\hat\alpha_1 - \alpha_1$ [deg]")


def draw_u1(axes: Axes, data: PlotData) -> None:
    """Leader's turn rate: estimate with three standard deviations, and truth."""
    t, u1 = data.seconds(data.tracked.capture_ns), _DEGREES * data.tracked.u1
    sd = _DEGREES * data.tracked.sd[:, 4]
    fill_band(axes, t, u1, 3.0 * sd)
    axes.plot(*with_gaps(t, u1), color=BELIEVED, lw=0.9, label="estimate")
    truth = data.columns.truth
    if np.any(np.isfinite(truth.u1)):
        axes.plot(
            data.seconds(truth.capture_ns), _DEGREES * truth.u1, color=TRUE, lw=1.2, label=data.truth_name
        )
    reach = 2.0 * _DEGREES * data.run_data.scenario.leader.k_u
    limit_to(axes, -reach, reach)
    axes.set_ylabel("$u_1$ [deg/s]")


def draw_v2(axes: Axes, data: PlotData) -> None:
    """Follower's speed as commanded, against its limit."""
    _draw_command(axes, data, data.columns.commands.v2, data.run_data.scenario.controller.v_max)
    axes.set_ylabel("$v_2$ [m/s]")


def draw_u2(axes: Axes, data: PlotData) -> None:
    """Follower's turn rate as commanded, against its limit."""
    u_max = _DEGREES * data.run_data.scenario.controller.u_max
    _draw_command(axes, data, _DEGREES * data.columns.commands.u2, u_max)
    axes.set_ylabel("$u_2$ [deg/s]")


def draw_latency(axes: Axes, data: PlotData) -> None:
    """From every capture to the first command that rests on an estimate of it, none of them cut off.

    The axis is logarithmic where the longest is many times the median.
    """
    commands = data.columns.commands
    first = commands.fresh & inside(commands.issued_ns, data.columns.run)
    waits_ms: FloatArray = (commands.issued_ns - commands.capture_ns)[first] * np.float64(1e-6)
    t, median, largest = data.seconds(commands.issued_ns[first]), percentile(waits_ms, 50.0), np.max(waits_ms)
    axes.plot(t, waits_ms, ls="none", marker=".", ms=2.0, color=FOLLOWER, label="capture to command")
    for name, level, style in (("median", 50.0, "--"), ("99 %", 99.0, ":")):
        value = percentile(waits_ms, level)
        axes.axhline(value, color=LIMIT, lw=0.9, ls=style, label=f"{name} {value:.3g}")
    if np.min(waits_ms) > 0.0 and largest > _WIDE * median:
        axes.set_yscale("log")
        axes.set_ylim(0.7 * float(np.min(waits_ms)), 2.0 * float(largest))
    else:
        axes.set_ylim(0.0, 1.3 * float(largest))
    axes.set_ylabel("latency [ms]")


Panel = Callable[[Axes, PlotData], None]
"""What draws a panel; the name of its function without ``draw_`` is what it is called."""


def panels_for(data: PlotData) -> tuple[list[Panel], list[Panel], list[Panel]]:
    """Panels that have something to show: of the wire, of the shape, of the leader's motion and commands."""
    columns, estimated = data.columns, len(data.tracked.capture_ns) > 0
    wire: list[Panel] = [draw_latency] if _waited(data) else []
    shape: list[Panel] = []
    motion: list[Panel] = []
    if estimated or np.any(np.isfinite(columns.truth.rho)):
        shape += [draw_distance, draw_alpha1, draw_alpha2]
    if estimated:
        motion += [draw_v1, draw_alpha1_error] if np.any(np.isfinite(data.tracked_true.alpha1)) else [draw_v1]
    if len(columns.commands.issued_ns):
        motion += [draw_v2, draw_u2]
    if estimated:
        (shape if len(shape) < 4 and len(motion) == 4 else motion).append(draw_u1)
    return wire, shape, motion


def _waited(data: PlotData) -> bool:
    """Whether any command of the run rests on a capture."""
    commands = data.columns.commands
    return bool(np.any(commands.fresh & inside(commands.issued_ns, data.columns.run)))


def _draw_desired(axes: Axes, data: PlotData, column: int, label: str) -> None:
    """Where the formation wants a quantity; other labs' robots were not told."""
    if data.run_data.motion_since_ns is not None:
        t, courses = data.desired()
        axes.plot(t, _shown(courses[column], column), color=LIMIT, lw=1.0, ls=":", label=label)


def _draw_shape(axes: Axes, data: PlotData, true: FloatArray, seen: Values, column: int) -> None:
    """True and noise-free course of a quantity; what was estimated where one of them is missing."""
    moments = data.columns.truth.capture_ns
    known = bool(np.any(np.isfinite(true)))
    if data.orbit is not None:
        wanted = moments[moments >= data.orbit.from_ns]
        ideal = with_gaps(
            data.seconds(wanted), _shown(broken_at_jumps(data.orbit.at(wanted)[column]), column)
        )
        axes.plot(*ideal, color=ORBIT, lw=1.1, ls="--", label="noise-free", zorder=3)
    if known:
        truth = with_gaps(data.seconds(moments), _shown(broken_at_jumps(true), column))
        axes.plot(*truth, color=TRUE, lw=1.4, label=data.truth_name)
    if data.orbit is None or not known:
        t = data.seconds(data.tracked.capture_ns)
        estimate = with_gaps(t, _shown(broken_at_jumps(np.asarray(seen)), column))
        axes.plot(*estimate, color=BELIEVED, lw=1.1, label="estimate")


def _shown(course: FloatArray, column: int) -> FloatArray:
    """Distances as they are, bearings in degrees."""
    return course if column == 0 else np.asarray(_DEGREES * course)


def _draw_command(axes: Axes, data: PlotData, sent: FloatArray, limit: float) -> None:
    t = data.seconds(data.columns.commands.issued_ns)
    axes.plot(t, sent, color=FOLLOWER, lw=1.0, drawstyle="steps-post", label="command")
    low, high = min(float(np.min(sent)), 0.0), float(np.max(sent))
    # A limit far outside what is driven would only flatten the curve.
    near = [side for side in (limit, -limit) if 1.6 * low <= side <= 1.6 * high]
    for index, side in enumerate(near):
        axes.axhline(side, color=LIMIT, lw=1.0, ls=":", label="limit" if index == 0 else None)
