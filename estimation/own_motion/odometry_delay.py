"""Whether odometry tells the motion of another moment: late by its way through the robot, early as commands.

Over the last seconds the mean motion of every window of the track is compared with that of odometry at the
same time and at shifted ones. Only where the robot changes its motion is there anything to be seen.
"""

from __future__ import annotations

from estimation.own_motion.odometry_check import WINDOW, WayEntry, Ways, mean_ways, way_entry
from estimation.own_motion.odometry_history import InputTrust
from estimation.own_motion.own_track import ODOMETRY_CORRELATION, OwnNoise
from formation.kernel import kernel
from formation.records import Rows
from formation.ring import Ring

REACH = 0.6
"""Delays of either sign up to this [s] are tried."""

LEAST = 0.1
"""A delay [s] below this is not named."""

_GRID = 0.05
_STEPS = round(REACH / _GRID)
_SPAN = 3.0  # [s] of windows
_FEWEST = 4  # windows
_CLEAR = 27.63  # of the sum of squares; the chi-square quantile of 0.9999999 with one degree of freedom or so
_FITS = 9.21  # mean misfit of a window that is left at most, the chi-square quantile of 0.99
_SHARE = 0.25  # of the misfit that may be left by a delay that explains it
_SCALE = 0.02
_LEVER = 0.01
_NS = 1e-9
_REACH_NS, _SPAN_NS, _GRID_NS = round(REACH / _NS), round(_SPAN / _NS), round(_GRID / _NS)


@kernel
def _twist_at(entries: Rows[WayEntry], ring: Ring, at_ns: int) -> Ways:
    """Way by the twist at a time, linear between entries."""
    k = ring.length
    while k > 0 and way_entry(entries, ring, k - 1).stamp_ns >= at_ns:
        k -= 1
    if k == ring.length:
        return way_entry(entries, ring, k - 1).twist
    after = way_entry(entries, ring, k)
    if k == 0:
        return after.twist
    before = way_entry(entries, ring, k - 1)
    share = (at_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
    a, b = before.twist, after.twist
    return Ways(a.v + share * (b.v - a.v), a.u + share * (b.u - a.u))


@kernel
def tight_variances(track: Ways, dt: float, noise: OwnNoise, trust: InputTrust) -> Ways:
    """Variances of a window's misfit, the errors of odometry being short-lived."""
    place, heading = noise.pose.position / dt, noise.pose.heading / dt
    share = min(1.0, 2.0 * ODOMETRY_CORRELATION / dt)
    v, u, lever = _SCALE * track.v, _SCALE * track.u, _LEVER * track.u
    return Ways(
        2.0 * place * place + share * trust.sd_v2 * trust.sd_v2 + v * v + lever * lever,
        2.0 * heading * heading + share * trust.sd_u2 * trust.sd_u2 + u * u,
    )


@kernel
def misfit_of(told: Ways, track: Ways, variance: Ways) -> float:
    """Chi-square, of two degrees of freedom, of what is told of a window."""
    v, u = told.v - track.v, told.u - track.u
    return v * v / variance.v + u * u / variance.u


@kernel
def _misfit_at(
    entries: Rows[WayEntry], ring: Ring, paired: int, shift_ns: int, noise: OwnNoise, trust: InputTrust
) -> tuple[float, int]:
    """Misfits of all windows if motion(t) = odometry(t + shift), and their number."""
    newest_ns = way_entry(entries, ring, ring.length - 1).stamp_ns
    last_ns = newest_ns - _REACH_NS
    first_ns = last_ns - _SPAN_NS
    total, count, k = 0.0, 0, paired - 1
    while k >= 0 and way_entry(entries, ring, k).stamp_ns > last_ns:
        k -= 1
    after_at = k
    k -= 1
    while k >= 0:
        before, after = way_entry(entries, ring, k), way_entry(entries, ring, after_at)
        if before.stamp_ns < first_ns:
            break
        dt = (after.stamp_ns - before.stamp_ns) * _NS
        if dt >= WINDOW:
            track = mean_ways(after.track, before.track, dt)
            told = mean_ways(
                _twist_at(entries, ring, after.stamp_ns + shift_ns),
                _twist_at(entries, ring, before.stamp_ns + shift_ns),
                dt,
            )
            total += misfit_of(told, track, tight_variances(track, dt, noise, trust))
            count += 1
            after_at = k
        k -= 1
    return total, count


@kernel(inline=False)
def delay_of(entries: Rows[WayEntry], ring: Ring, paired: int, noise: OwnNoise, trust: InputTrust) -> float:
    """How much later [s] than the motion odometry is, negative if earlier; 0 if that is not clear.

    A delay explains the misfits if it leaves less than a quarter of them, and they fit then.
    """
    if paired < 2:
        return 0.0
    at_once, count = _misfit_at(entries, ring, paired, 0, noise, trust)
    if count < _FEWEST:
        return 0.0
    best, least = 0, at_once
    for k in range(-_STEPS, _STEPS + 1):
        total, _ = _misfit_at(entries, ring, paired, k * _GRID_NS, noise, trust)
        if total < least:
            best, least = k, total
    delay = best * _GRID
    clear = at_once - least > _CLEAR and least < _SHARE * at_once and least < _FITS * count
    return delay if clear and abs(delay) > LEAST - 0.5 * _GRID else 0.0
