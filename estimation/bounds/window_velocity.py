"""The leader's velocity between two measured positions, and how far the estimate is from it.

A difference of positions over a window needs no filter: positions within eps and an acceleration within A
make it err by at most 2 eps / T + A T / 2 as the velocity at the window's end. So whatever filter flies, and
whatever process noise it has found, its velocity errs by no more than that and its distance from the
difference.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.tracking.track_point import RESTARTED, USED, TrackPoint
from estimation.tracking.tracker import point_at
from formation.kernel import kernel
from formation.records import Rows
from formation.ring import Ring

_NS = 1e-9


class WindowVelocity(NamedTuple):
    """What two measured positions of the leader say of a belief in the mocap frame.

    speed: of the difference [m/s]. gap: distance of the believed velocity from it [m/s]. place: distance of
    the believed position from where the difference leads [m]. span: between the two [s], 0 if there are not
    two. since: from the newer one to the belief [s]. jumped: whether the leader jumped between the two.
    """

    speed: float
    gap: float
    place: float
    span: float
    since: float
    jumped: bool


NO_WINDOW = WindowVelocity(0.0, 0.0, 0.0, 0.0, 0.0, False)


@kernel
def window_velocity(points: Rows[TrackPoint], ring: Ring, longest: float) -> WindowVelocity:
    """Difference over the longest window up to ``longest`` [s] that a track's points span.

    Only measurements that were used count. Along the follower's axes there is none: positions there turn
    with it.
    """
    nothing = WindowVelocity(0.0, 0.0, 0.0, 0.0, 0.0, False)
    last = ring.length - 1
    if last < 1:
        return nothing
    newest = point_at(points, ring, last)
    end = last
    while end > 0 and not _used(point_at(points, ring, end)):
        end -= 1
    ended = point_at(points, ring, end).measurement
    if not ended.in_world:
        return nothing
    for begin in range(end):
        point = point_at(points, ring, begin)
        began = point.measurement
        span = (ended.capture_ns - began.capture_ns) * _NS
        if span <= longest and _used(point):
            vx, vy = (ended.x - began.x) / span, (ended.y - began.y) / span
            since = (newest.measurement.capture_ns - ended.capture_ns) * _NS
            b = newest.belief
            gap = _length(b.vx - vx, b.vy - vy)
            place = _length(b.x - ended.x - since * vx, b.y - ended.y - since * vy)
            jumped = newest.jump.since_ns > began.capture_ns
            return WindowVelocity(_length(vx, vy), gap, place, span, since, jumped)
    return nothing


@kernel
def _used(point: TrackPoint) -> bool:
    return point.verdict == USED or point.verdict == RESTARTED


@kernel
def _length(x: float, y: float) -> float:
    return math.sqrt(x * x + y * y)
