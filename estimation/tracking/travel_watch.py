"""Whether the leader turned back: the one thing that no track of positions follows without a break.

At a cusp its speed goes through zero, and the direction of travel turns round. alpha1 jumps by pi there while
nothing else does. One that stands, turns on the spot and drives off is the same to who sees positions.
"""

from __future__ import annotations

from typing import NamedTuple

from estimation.filters.gaussian import Gaussian, speed_of
from estimation.models.coordinated_turn import LeaderLimits
from estimation.tracking.track_point import GATED, RESTARTED, TrackPoint
from formation.kernel import kernel

_NS = 1e-9
_FREELY = 1.0  # a leader that may have turned so far [rad] at speed has not turned back for all that we know

TOLD_FOR_NS = 2_000_000_000
"""For how long a leader is said to have turned back."""


class TravelWatch(NamedTuple):
    """The leader's last sure direction of travel, and when it turned back.

    ``known``: whether there is one; ``vx``, ``vy``: its velocity then [m/s]; ``at_ns``: capture time.
    ``slowed``: it was slower than v_eps since. ``turned_ns``: capture at which it was last found to have
    turned back, 0 for never.
    """

    known: bool
    vx: float
    vy: float
    at_ns: int
    slowed: bool
    turned_ns: int


NO_TRAVEL = TravelWatch(False, 0.0, 0.0, 0, False, 0)


@kernel
def direction_watched(
    watch: TravelWatch, belief: Gaussian, capture_ns: int, settled: bool, limits: LeaderLimits
) -> TravelWatch:
    """Watch with the belief after one more measurement, in a frame that does not turn; in their order.

    ``settled``: whether the track counts the leader's direction as known.
    """
    if speed_of(belief) < limits.v_eps:
        return watch._replace(slowed=True)
    if not settled:
        return watch
    turned_ns = watch.turned_ns
    may_have_turned = limits.k_u * (capture_ns - watch.at_ns) * _NS > _FREELY
    against = watch.vx * belief.vx + watch.vy * belief.vy < 0.0
    if watch.known and against and (watch.slowed or not may_have_turned):
        turned_ns = capture_ns
    return TravelWatch(True, belief.vx, belief.vy, capture_ns, False, turned_ns)


@kernel
def travel_watched(
    watch: TravelWatch, point: TrackPoint, lost_after: float, limits: LeaderLimits
) -> TravelWatch:
    """Watch with the newest point of a track; one that begins anew after ``lost_after`` [s] knows nothing."""
    if point.verdict == GATED:
        return watch
    capture_ns, unsure = point.measurement.capture_ns, point.verdict == RESTARTED and not point.settled
    if unsure and (capture_ns - watch.at_ns) * _NS > lost_after:
        return TravelWatch(False, 0.0, 0.0, 0, False, watch.turned_ns)
    return direction_watched(watch, point.belief, capture_ns, point.settled, limits)
