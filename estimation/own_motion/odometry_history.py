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
    """Measured motion of the follower at its stamp: v2 [m/s], u2 [rad/s].

    ``answer_v``, ``answer_u``: what a lag between it and the motion has made of the signal until then; looked
    at only where there is one.
    """

    stamp_ns: int
    v2: float
    u2: float
    answer_v: float = 0.0
    answer_u: float = 0.0


History = tuple[MotionSample, ...]
"""Samples in the order of their stamps, as plain Python hands them on."""


class InputTrust(NamedTuple):
    """What is known of the follower's motion signal.

    sd_v2 [m/s], sd_u2 [rad/s]: its noise while the motion is steady. delay [s]: how long the motion comes
    after its signal, as the wheels follow a command. lag [s]: by how much more than that it may come later;
    while the signal changes it is trusted that much less. v_max [m/s], u_max [rad/s]: what a follower may do
    whose signal has not been heard; 0 for one that stands until then. slip_v, slip_u: share of v2 and u2 by
    which slip may falsify them. time_constant [s]: of the first-order lag by which the motion answers its
    signal; scale_v, scale_u: share of the signal that is reached.
    """

    sd_v2: float
    sd_u2: float
    delay: float = 0.0
    lag: float = 0.0
    v_max: float = 0.0
    u_max: float = 0.0
    slip_v: float = 0.0
    slip_u: float = 0.0
    time_constant: float = 0.0
    scale_v: float = 1.0
    scale_u: float = 1.0


AS_TOLD = -1.0
"""A time constant, or limit of what is left, that is the one of :class:`InputTrust`."""


class Correction(NamedTuple):
    """``motion(t) = scale * answer(t - delay)`` as it is applied to a signal that is trusted so far.

    delay [s] and scales come on top of those that are told; time_constant [s] of the lag, and left [s], by
    how much more than all that the motion may come later, take their place.
    """

    delay: float = 0.0
    scale_v: float = 1.0
    scale_u: float = 1.0
    time_constant: float = AS_TOLD
    left: float = AS_TOLD


IDEAL = Correction()


@kernel
def time_constant_of(trust: InputTrust, correction: Correction) -> float:
    """Time constant [s] by which the motion answers its signal."""
    return correction.time_constant if correction.time_constant >= 0.0 else trust.time_constant


@kernel
def left_of(trust: InputTrust, correction: Correction) -> float:
    """By how much [s] the motion may come later than is known."""
    return min(trust.lag, correction.left) if correction.left >= 0.0 else trust.lag


@kernel
def scaled_motion(sample: MotionSample, trust: InputTrust, correction: Correction) -> MotionSample:
    """Sample whose signal tells as much as the robot does of it."""
    return sample._replace(
        v2=trust.scale_v * correction.scale_v * sample.v2, u2=trust.scale_u * correction.scale_u * sample.u2
    )


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
        stamp_ns,
        before.v2 + share * (after.v2 - before.v2),
        before.u2 + share * (after.u2 - before.u2),
        0.0,
        0.0,
    )


@kernel
def answered(before: MotionSample, after: MotionSample, stamp_ns: int, time_constant: float) -> MotionSample:
    """Answer of a first-order lag between two samples, the signal being linear from one to the other.

    Exact whatever lies between them: off the line that it tends to, a time constant behind the signal, the
    answer decays. ``v2`` and ``u2`` are those of the signal.
    """
    if time_constant <= 0.0:
        return after._replace(answer_v=after.v2, answer_u=after.u2)
    whole, since = (after.stamp_ns - before.stamp_ns) * _NS, (stamp_ns - before.stamp_ns) * _NS
    rate_v, rate_u = 0.0, 0.0
    if whole > 0.0:
        rate_v, rate_u = (after.v2 - before.v2) / whole, (after.u2 - before.u2) / whole
    v, u = before.v2 + rate_v * since, before.u2 + rate_u * since
    left = math.exp(-since / time_constant)
    behind_v, behind_u = time_constant * rate_v, time_constant * rate_u
    return MotionSample(
        stamp_ns,
        v,
        u,
        v - behind_v + left * (before.answer_v - before.v2 + behind_v),
        u - behind_u + left * (before.answer_u - before.u2 + behind_u),
    )


@kernel(inline=False)
def answer_again(history: Rows[MotionSample], ring: Ring, since_ns: int, time_constant: float) -> None:
    """Put the answers of a lag to all samples from a time on into the history.

    The oldest one has been answered for long, if it is among these.
    """
    for k in range(sample_place(history, ring, since_ns), ring.length):
        sample = sample_at(history, ring, k)
        if k == 0:
            sample = sample._replace(answer_v=sample.v2, answer_u=sample.u2)
        else:
            sample = answered(sample_at(history, ring, k - 1), sample, sample.stamp_ns, time_constant)
        store(history, place(ring, history, k), sample)


@kernel
def answer_at(history: Rows[MotionSample], ring: Ring, stamp_ns: int, time_constant: float) -> MotionSample:
    """Motion at a time as the lag's answer; without a lag, and before the history, as the signal tells it."""
    if time_constant <= 0.0:
        return motion_at(history, ring, stamp_ns)
    k = sample_place(history, ring, stamp_ns)
    found = sample_at(history, ring, min(k, ring.length - 1))
    if k == ring.length:
        found = answered(found, found._replace(stamp_ns=stamp_ns), stamp_ns, time_constant)
    elif k > 0 and found.stamp_ns > stamp_ns:
        found = answered(sample_at(history, ring, k - 1), found, stamp_ns, time_constant)
    return MotionSample(stamp_ns, found.answer_v, found.answer_u, found.answer_v, found.answer_u)


@kernel(inline=False)
def follower_motion(
    history: Rows[MotionSample], ring: Ring, capture_ns: int, trust: InputTrust, correction: Correction
) -> FollowerMotion:
    """Motion of the follower at a capture time with its standard deviation.

    An input that may come later than is known, by up to a time, is wrong by up to its change over that time:
    sd^2 = sd_steady^2 + (largest change within it before the capture)^2. Without any history
    the follower is taken to stand, as before the start it does, give or take its limits.
    """
    if ring.length == 0:
        return FollowerMotion(0.0, 0.0, max(trust.sd_v2, trust.v_max), max(trust.sd_u2, trust.u_max))
    now_ns = capture_ns - delay_ns(trust, correction)
    time_constant, late = time_constant_of(trust, correction), left_of(trust, correction)
    now = answer_at(history, ring, now_ns, time_constant)
    sd_v2, sd_u2 = trust.sd_v2, trust.sd_u2
    if late > 0.0:
        since_ns = now_ns - math.floor(late / _NS + 0.5)
        past = answer_at(history, ring, since_ns, time_constant)
        change_v, change_u = abs(past.v2 - now.v2), abs(past.u2 - now.u2)
        k = sample_place(history, ring, now_ns) - 1
        while k >= 0 and sample_at(history, ring, k).stamp_ns > since_ns:
            past = sample_at(history, ring, k)
            if time_constant > 0.0:
                past = past._replace(v2=past.answer_v, u2=past.answer_u)
            change_v, change_u = max(change_v, abs(past.v2 - now.v2)), max(change_u, abs(past.u2 - now.u2))
            k -= 1
        sd_v2, sd_u2 = (
            math.sqrt(sd_v2 * sd_v2 + change_v * change_v),
            math.sqrt(sd_u2 * sd_u2 + change_u * change_u),
        )
    scaled = scaled_motion(now, trust, correction)
    v2, u2 = scaled.v2, scaled.u2
    if trust.slip_v > 0.0:
        sd_v2 = math.sqrt(sd_v2 * sd_v2 + trust.slip_v * v2 * trust.slip_v * v2)
    if trust.slip_u > 0.0:
        sd_u2 = math.sqrt(sd_u2 * sd_u2 + trust.slip_u * u2 * trust.slip_u * u2)
    return FollowerMotion(v2, u2, sd_v2, sd_u2)


@kernel
def delay_ns(trust: InputTrust, correction: Correction) -> int:
    """By how much the motion comes after its signal [ns]."""
    return math.floor((trust.delay + correction.delay) / _NS + 0.5)
