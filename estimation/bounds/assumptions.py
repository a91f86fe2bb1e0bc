"""What a certificate starts from, and the first thing that follows: how wrong a velocity can be."""

from __future__ import annotations

from dataclasses import dataclass

from estimation.bounds.guarantees import leader_acceleration
from estimation.bounds.window_difference import WindowDifference, best_difference, best_line
from formation.spacing import Spacing
from formation.speed_range import SpeedRange
from formation.station import Side


@dataclass(frozen=True, slots=True)
class Assumptions:
    """What a certificate starts from.

    ``eps``: bound of the error of each measured leader position, in any direction [m]. ``step``: time between
    two measurements [s]. Of the leader v_eps <= v1 <= k_v [m/s] and |u1| <= k_u [rad/s]; ``speeds``: the
    speeds that it will really drive, for the formation. Of the law mu1, mu2 [rad/s] and the spacing.
    ``noise``: in words, where eps comes from. ``side`` that the follower drives on. ``unproved``: why the
    theory of the formation does not speak of this pair, empty if it does; ``unknown_steering``: why that of
    its steering does not. ``filter_error``: largest error of the velocity [m/s] that the filter which flies
    makes under the same bounds once it has settled, None where that is not known.
    """

    eps: float
    step: float
    v_eps: float
    k_v: float
    k_u: float
    speeds: SpeedRange
    mu1: float
    mu2: float
    spacing: Spacing
    noise: str
    side: Side = Side.RIGHT
    unproved: str = ""
    unknown_steering: str = ""
    filter_error: float | None = None

    @property
    def acceleration(self) -> float:
        """Bound A of the leader's acceleration [m/s^2]."""
        return float(leader_acceleration(self.k_v, self.k_u))

    @property
    def velocity_error(self) -> float:
        """Guaranteed error W of the leader's velocity [m/s], by the best difference over a window."""
        return best_difference(self.eps, self.acceleration, self.step).error

    @property
    def line(self) -> WindowDifference:
        """The best straight line through positions of independent noise, by eps = 5 of its deviations."""
        return best_line(self.eps, self.acceleration, self.step)
