"""The follower's own motion by its odometry, matched to the capture time of what it is used with."""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.models.coordinated_turn import FollowerMotion
from formation.kernel import kernel
from formation.records import Rows, load, size, store
from formation.ring import Ring, place

_NS = 1e-9


class MotionSample(NamedTuple):
    """Measured motion of the follower at its stamp: v2 [m/s], u2 [rad/s]."""

    stamp_ns: int
    v2: float
    u2: float


History = tuple[MotionSample, ...]
"""Samples in the order of their stamps, as plain Python hands them on."""


class InputTrust(NamedTuple):
    """What is known of the follower's motion signal.

    sd_v2 [m/s], sd_u2 [rad/s]: its noise while the motion is steady. delay [s]: how long the motion comes
    after its signal, as the wheels follow a command. lag [s]: by how much more than that it may come later;
    while the signal changes it is trusted that much less. v_max [m/s], u_max [rad/s]: what a follower may do
    whose signal has not been heard; 0 for one that stands until then. slip_v, slip_u: share of v2 and u2 by
    which slip may falsify them.
    """

    sd_v2: float
    sd_u2: float
    delay: float = 0.0
    lag: float = 0.0
    v_max: float = 0.0
    u_max: float = 0.0
    slip_v: float = 0.0
    slip_u: float = 0.0


class Correction(NamedTuple):
    """``motion(t) = scale * odometry(t - delay)`` as it is applied; delay in [s]."""

    delay: float = 0.0
    scale_v: float = 1.0
    scale_u: float = 1.0


IDEAL = Correction()


@kernel
def sample_at(history: Rows[MotionSample], ring: Ring, k: int) -> MotionSample:
    """The ring's k-th sample, the oldest being the 0th."""
    return load(MotionSample, history, place(ring, history, k))


@kernel
def sample_place(history: Rows[MotionSample], ring: Ring, stamp_ns: int) -> int:
    """Number of the samples stamped before a time."""
    k = ring.length
    while k > 0 and sample_at(history, ring, k - 1).stamp_ns >= stamp_ns:
        k -= 1
    return k


@kernel(inline=False)
def remember(history: Rows[MotionSample], ring: Ring, sample: MotionSample, span: float) -> Ring:
    """Ring with the sample in its place by stamp; of equal stamps the newer arrival wins.

    Samples more than ``span`` [s] older than the newest are forgotten, and the oldest where there is no room.
    """
    k = sample_place(history, ring, sample.stamp_ns)
    if k < ring.length and sample_at(history, ring, k).stamp_ns == sample.stamp_ns:
        store(history, place(ring, history, k), sample)
        return ring
    if ring.length == size(history):
        if k == 0:
            return ring
        ring, k = Ring(place(ring, history, 1), ring.length - 1), k - 1
    for at in range(ring.length, k, -1):
        store(history, place(ring, history, at), sample_at(history, ring, at - 1))
    store(history, place(ring, history, k), sample)
    ring = Ring(ring.first, ring.length + 1)
    oldest_ns = sample_at(history, ring, ring.length - 1).stamp_ns - math.floor(span / _NS + 0.5)
    while sample_at(history, ring, 0).stamp_ns < oldest_ns:
        ring = Ring(place(ring, history, 1), ring.length - 1)
    return ring


@kernel
def motion_at(history: Rows[MotionSample], ring: Ring, stamp_ns: int) -> MotionSample:
    """Motion at a time: linear between samples, held outside them. Not to be asked of an empty history."""
    k = sample_place(history, ring, stamp_ns)
    if k == ring.length:
        return sample_at(history, ring, k - 1)
    after = sample_at(history, ring, k)
    if k == 0:
        return after
    before = sample_at(history, ring, k - 1)
    share = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
    return MotionSample(
        stamp_ns, before.v2 + share * (after.v2 - before.v2), before.u2 + share * (after.u2 - before.u2)
    )


@kernel(inline=False)
def follower_motion(
    history: Rows[MotionSample], ring: Ring, capture_ns: int, trust: InputTrust, correction: Correction
) -> FollowerMotion:
    """Motion of the follower at a capture time with its standard deviation.

    An input that is up to ``lag`` late is wrong by up to its change over that time, so
    sd^2 = sd_steady^2 + (largest change within lag before the capture)^2. Without any history the follower
    is taken to stand, as before the start it does, give or take its limits.
    """
    if ring.length == 0:
        return FollowerMotion(0.0, 0.0, max(trust.sd_v2, trust.v_max), max(trust.sd_u2, trust.u_max))
    now_ns = capture_ns - delay_ns(trust, correction)
    now = motion_at(history, ring, now_ns)
    sd_v2, sd_u2 = trust.sd_v2, trust.sd_u2
    if trust.lag > 0.0:
        since_ns = now_ns - math.floor(trust.lag / _NS + 0.5)
        past = motion_at(history, ring, since_ns)
        change_v, change_u = abs(past.v2 - now.v2), abs(past.u2 - now.u2)
        k = sample_place(history, ring, now_ns) - 1
        while k >= 0 and sample_at(history, ring, k).stamp_ns > since_ns:
            past = sample_at(history, ring, k)
            change_v, change_u = max(change_v, abs(past.v2 - now.v2)), max(change_u, abs(past.u2 - now.u2))
            k -= 1
        sd_v2, sd_u2 = (
            math.sqrt(sd_v2 * sd_v2 + change_v * change_v),
            math.sqrt(sd_u2 * sd_u2 + change_u * change_u),
        )
    v2, u2 = correction.scale_v * now.v2, correction.scale_u * now.u2
    if trust.slip_v > 0.0:
        sd_v2 = math.sqrt(sd_v2 * sd_v2 + trust.slip_v * v2 * trust.slip_v * v2)
    if trust.slip_u > 0.0:
        sd_u2 = math.sqrt(sd_u2 * sd_u2 + trust.slip_u * u2 * trust.slip_u * u2)
    return FollowerMotion(v2, u2, sd_v2, sd_u2)


@kernel
def delay_ns(trust: InputTrust, correction: Correction) -> int:
    """By how much the motion comes after its signal [ns]."""
    return math.floor((trust.delay + correction.delay) / _NS + 0.5)
