"""Two robots from above: their tracks, and the robots themselves in their true size at chosen moments."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from formation.angles import FloatArray
from hil.scene.robot_size import BODY_DIAMETER, WHEEL_DIAMETER, WHEEL_OFFSET, WHEEL_WIDTH

LEADER, FOLLOWER, LINE = "#1f5fa8", "#d9741a", "#8a8a8a"

_BODY_RADIUS = 0.5 * BODY_DIAMETER
_NOSE = ((0.05, 0.0), (-0.034, 0.036), (-0.016, 0.0), (-0.034, -0.036))
_STEPS = tuple(base * 10.0**power for power in range(-1, 5) for base in (1.0, 2.0, 5.0))
_MOST_MOMENTS = 7
_SMALLEST_SHARE = 0.05
"""Where the tracks are so long that a robot would be smaller than this share of them, it is drawn larger."""


def draw_pair(axes: Axes, t: FloatArray, leader: FloatArray, follower: FloatArray) -> None:
    """Tracks of both robots, rows x, y, theta at the times t [s], and the robots at a few round moments.

    A line joins the two at each moment; the moment is written beside the follower. Rows with NaN are gaps.
    """
    scale = _scale(leader, follower)
    for poses, colour, label in ((leader, LEADER, "leader"), (follower, FOLLOWER, "follower")):
        axes.plot(poses[:, 0], poses[:, 1], color=colour, lw=1.3, alpha=0.75, label=label, zorder=2)
    moments = _moments(t, np.all(np.isfinite(leader), axis=1) & np.all(np.isfinite(follower), axis=1))
    opacities = np.linspace(0.35, 1.0, len(moments)).tolist()
    for (row, moment), opacity in zip(moments.items(), opacities, strict=True):
        ends = np.stack([leader[row, :2], follower[row, :2]])
        axes.plot(ends[:, 0], ends[:, 1], color=LINE, lw=0.8, alpha=opacity, zorder=1)
        draw_robot(axes, leader[row], scale, LEADER, opacity)
        draw_robot(axes, follower[row], scale, FOLLOWER, opacity)
        _write_moment(axes, f"{moment:.3g} s", leader[row], follower[row], scale)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.09)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.grid(alpha=0.25)
    axes.legend(loc="best", frameon=False, fontsize=9)


def draw_robot(axes: Axes, pose: FloatArray, scale: float, colour: str, opacity: float) -> None:
    """One robot at a pose x, y, theta: wheels, body, nose ahead. ``scale`` 1 is true size."""
    x, y, theta = (float(value) for value in pose)
    place = Affine2D().scale(scale).rotate(theta).translate(x, y)
    for side in (WHEEL_OFFSET, -WHEEL_OFFSET):
        half_length, half_width = 0.5 * WHEEL_DIAMETER, 0.5 * WHEEL_WIDTH
        corners = [
            (-half_length, side - half_width),
            (half_length, side - half_width),
            (half_length, side + half_width),
            (-half_length, side + half_width),
        ]
        wheel = place.transform(corners)
        axes.add_patch(Polygon(wheel, closed=True, facecolor="#333333", lw=0, alpha=opacity, zorder=3))
    axes.add_patch(
        Circle(
            (x, y),
            scale * _BODY_RADIUS,
            facecolor=colour,
            edgecolor="white",
            lw=0.7,
            alpha=opacity,
            zorder=3.5,
        )
    )
    nose = place.transform(_NOSE)
    axes.add_patch(Polygon(nose, closed=True, facecolor="white", lw=0, alpha=opacity, zorder=4))


def _scale(leader: FloatArray, follower: FloatArray) -> float:
    places = np.concatenate([leader[:, :2], follower[:, :2]])
    extent = float(np.max(np.nanmax(places, axis=0) - np.nanmin(places, axis=0)))
    return max(1.0, _SMALLEST_SHARE * extent / (2.0 * _BODY_RADIUS))


def _moments(t: FloatArray, known: NDArray[np.bool_]) -> dict[int, float]:
    """Rows at which the robots are drawn, with their times: multiples of a round step, not too many."""
    rows = np.flatnonzero(known)
    first, last = float(t[rows[0]]), float(t[rows[-1]])
    step = next((step for step in _STEPS if (last - first) / step <= _MOST_MOMENTS), last - first)
    if step <= 0.0:
        return {int(rows[0]): first}
    # A recording that begins or ends a little off a multiple still shows its first and last moment.
    whole = range(math.ceil(first / step - 0.1), math.floor(last / step + 0.1) + 1)
    return {int(rows[np.abs(t[rows] - count * step).argmin()]): count * step for count in whole}


def _write_moment(axes: Axes, text: str, leader: FloatArray, follower: FloatArray, scale: float) -> None:
    """Write on the side of the follower that faces away from the leader."""
    away = math.atan2(follower[1] - leader[1], follower[0] - leader[0])
    reach = scale * (_BODY_RADIUS + 0.07)
    place = (float(follower[0]) + reach * math.cos(away), float(follower[1]) + reach * math.sin(away))
    axes.annotate(text, place, ha="center", va="center", fontsize=8, color="#555555", zorder=5)
