"""The follower's motion from one measurement to the next: odometry added up over all samples in between.

Between slow sightings the motion at both ends tells little of what came in between. The signal, linear
between samples, is integrated over the very interval, shifted by its delay; of a first-order lag that comes
after it the integral is exact, too. Of what comes later still only a limit is known: every delay up to it is
as likely as any other, so that the mean over some of them is taken, and what they differ by is what it may
do.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.models.coordinated_turn import FollowerMotion
from estimation.own_motion.odometry_history import (
    Correction,
    InputTrust,
    MotionSample,
    answer_at,
    delay_ns,
    left_of,
    motion_at,
    sample_at,
    sample_place,
    time_constant_of,
)
from estimation.own_motion.own_track import ODOMETRY_CORRELATION
from formation.kernel import kernel
from formation.records import Rows
from formation.ring import Ring

LASTING = 0.5
"""Correlation time [s] of what a changing motion does to odometry: slip, and wheels that lag behind, last for
about as long as a manoeuvre does."""

_DELAYS = 5  # that a lag is tried with
_NS = 1e-9


class Travelled(NamedTuple):
    """Way along the heading [m] and turned angle [rad]."""

    v: float
    u: float


@kernel
def travelled(history: Rows[MotionSample], ring: Ring, from_ns: int, to_ns: int) -> Travelled:
    """Integral of the signal from one time to another, linear between samples and held outside them."""
    before, v, u = motion_at(history, ring, from_ns), 0.0, 0.0
    stamp_ns, k = from_ns, sample_place(history, ring, from_ns + 1)
    while stamp_ns < to_ns:
        after = motion_at(history, ring, to_ns)
        next_ns = to_ns
        if k < ring.length and sample_at(history, ring, k).stamp_ns < to_ns:
            after = sample_at(history, ring, k)
            next_ns = after.stamp_ns
        half = 0.5 * ((next_ns - stamp_ns) * _NS)
        v, u = v + half * (before.v2 + after.v2), u + half * (before.u2 + after.u2)
        before, stamp_ns, k = after, next_ns, k + 1
    return Travelled(v, u)


@kernel
def answer_travelled(
    history: Rows[MotionSample], ring: Ring, from_ns: int, to_ns: int, time_constant: float
) -> Travelled:
    """The same of a lag's answer: the signal's, less its time constant times what the answer has gained."""
    way = travelled(history, ring, from_ns, to_ns)
    if time_constant <= 0.0:
        return way
    before = answer_at(history, ring, from_ns, time_constant)
    after = answer_at(history, ring, to_ns, time_constant)
    return Travelled(
        way.v - time_constant * (after.v2 - before.v2), way.u - time_constant * (after.u2 - before.u2)
    )


@kernel(inline=False)
def motion_between(
    history: Rows[MotionSample],
    ring: Ring,
    interval_ns: tuple[int, int],
    trust: InputTrust,
    correction: Correction,
) -> FollowerMotion:
    """Mean motion from one capture to a later one, with standard deviations for :data:`ODOMETRY_CORRELATION`.

    Without any history the follower stands, give or take its limits.
    """
    if ring.length == 0:
        return FollowerMotion(0.0, 0.0, max(trust.sd_v2, trust.v_max), max(trust.sd_u2, trust.u_max))
    later_ns = delay_ns(trust, correction)
    from_ns, to_ns = interval_ns[0] - later_ns, interval_ns[1] - later_ns
    by = 1.0 / ((to_ns - from_ns) * _NS)
    time_constant, late = time_constant_of(trust, correction), left_of(trust, correction)
    delays = _DELAYS if late > 0.0 else 1
    v, u, vv, uu = 0.0, 0.0, 0.0, 0.0
    for k in range(delays):
        shift_ns = math.floor(late * k / (_DELAYS - 1) / _NS + 0.5)
        way = answer_travelled(history, ring, from_ns - shift_ns, to_ns - shift_ns, time_constant)
        v, u, vv, uu = (
            v + way.v * by,
            u + way.u * by,
            vv + way.v * by * way.v * by,
            uu + way.u * by * way.u * by,
        )
    v, u = v / delays, u / delays
    late_v, late_u = max(0.0, vv / delays - v * v), max(0.0, uu / delays - u * u)
    v, u = trust.scale_v * correction.scale_v * v, trust.scale_u * correction.scale_u * u
    slip_v, slip_u = trust.slip_v * v, trust.slip_u * u
    lasting = LASTING / ODOMETRY_CORRELATION
    return FollowerMotion(
        v,
        u,
        math.sqrt(trust.sd_v2 * trust.sd_v2 + lasting * (late_v + slip_v * slip_v)),
        math.sqrt(trust.sd_u2 * trust.sd_u2 + lasting * (late_u + slip_u * slip_u)),
    )
