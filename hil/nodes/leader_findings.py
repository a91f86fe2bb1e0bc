"""What the estimator finds of the leader that nobody told it."""

from __future__ import annotations

import math

from estimation.filters.gaussian import Gaussian, speed_of, variance_along
from estimation.models.coordinated_turn import LeaderLimits
from estimation.tracking.track_point import USED, TrackPoint
from estimation.tracking.travel_watch import TOLD_FOR_NS, TravelWatch
from hil.nodes.findings import Findings

LIMITS_BROKEN = "leader_limits"
"""Name of the finding that a leader is faster, or turns harder, than it is told to be."""

_SURE = 5.0  # standard deviations by which it must be
_BEYOND = 1.1  # times the limit, which who keeps to it may pass by a little


def limits_findings(point: TrackPoint, limits: LeaderLimits) -> Findings:
    """That the leader surely goes beyond its limits, by the newest point of its track."""
    if point.verdict != USED or not point.settled:
        return {}
    belief = point.belief
    speed, turn = speed_of(belief), abs(belief.u)
    fastest, seen = _BEYOND * limits.k_v, []
    if speed > fastest and speed - _SURE * _sd_speed(belief) > fastest:
        seen.append(f"it drives at {speed:.2g} m/s, expected up to leader.k_v = {limits.k_v:g}")
    if turn - _SURE * math.sqrt(belief.u_u) > _BEYOND * limits.k_u:
        seen.append(f"it turns at {turn:.2g} rad/s, expected up to leader.k_u = {limits.k_u:g}")
    return {LIMITS_BROKEN: "; ".join(seen)} if seen else {}


def _sd_speed(belief: Gaussian) -> float:
    """Standard deviation of the speed [m/s] of one who moves."""
    speed = speed_of(belief)
    return math.sqrt(variance_along(belief, belief.vx / speed, belief.vy / speed))


def leader_findings(watch: TravelWatch, now_ns: int) -> Findings:
    """That the leader has turned back of late."""
    if not watch.turned_ns or abs(now_ns - watch.turned_ns) > TOLD_FOR_NS:
        return {}
    text = (
        "the leader's speed went through zero and its direction of travel turned by more than a right angle, "
        "expected v1 >= v_eps: alpha1 is that of the new direction"
    )
    return {"cusp": text}
