"""The follower's own motion, matched to the capture time of what it is used with."""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass, replace

from estimation.models.motion import FollowerMotion

_NS = 1e-9


@dataclass(frozen=True, slots=True)
class MotionSample:
    """Measured motion of the follower at its stamp: v2 [m/s], u2 [rad/s]."""

    stamp_ns: int
    v2: float
    u2: float


History = tuple[MotionSample, ...]


def remember(history: History, sample: MotionSample, span: float) -> History:
    """History with the sample in its place by stamp; of equal stamps the newer arrival wins.

    Samples more than ``span`` [s] older than the newest are forgotten.
    """
    if not history or sample.stamp_ns > history[-1].stamp_ns:
        samples = [*history, sample]
    else:
        place = bisect.bisect_left(history, sample.stamp_ns, key=lambda kept: kept.stamp_ns)
        same = place < len(history) and history[place].stamp_ns == sample.stamp_ns
        samples = [*history[:place], sample, *history[place + same :]]
    oldest_ns = samples[-1].stamp_ns - round(span / _NS)
    first = bisect.bisect_left(samples, oldest_ns, key=lambda kept: kept.stamp_ns)
    return tuple(samples[first:])


def motion_at(history: History, stamp_ns: int) -> MotionSample | None:
    """Motion at a time: linear between samples, held outside them; None without any."""
    if not history:
        return None
    place = bisect.bisect_left(history, stamp_ns, key=lambda kept: kept.stamp_ns)
    if place == len(history):
        return history[-1]
    if place == 0:
        return history[0]
    before, after = history[place - 1], history[place]
    share = (stamp_ns - before.stamp_ns) / (after.stamp_ns - before.stamp_ns)
    return MotionSample(
        stamp_ns, before.v2 + share * (after.v2 - before.v2), before.u2 + share * (after.u2 - before.u2)
    )


@dataclass(frozen=True, slots=True)
class InputTrust:
    """What is known of the follower's motion signal.

    sd_v2 [m/s], sd_u2 [rad/s]: its noise while the motion is steady. delay [s]: how long the motion comes
    after its signal, as the wheels follow a command. lag [s]: by how much more than that it may come later;
    while the signal changes it is trusted that much less. v_max [m/s], u_max [rad/s]: what a follower may do
    whose signal has not been heard; 0 for one that stands until then.
    """

    sd_v2: float
    sd_u2: float
    delay: float = 0.0
    lag: float = 0.0
    v_max: float = 0.0
    u_max: float = 0.0


def follower_motion(history: History, capture_ns: int, trust: InputTrust) -> FollowerMotion:
    """Motion of the follower at a capture time with its standard deviation.

    An input that is up to ``lag`` late is wrong by up to its change over that time, so
    sd^2 = sd_steady^2 + (largest change within lag before the capture)^2. Without any history the follower
    is taken to stand, as before the start it does, give or take its limits.
    """
    now_ns = capture_ns - round(trust.delay / _NS)
    now = motion_at(history, now_ns)
    if now is None:
        return FollowerMotion(0.0, 0.0, max(trust.sd_v2, trust.v_max), max(trust.sd_u2, trust.u_max))
    change_v, change_u = 0.0, 0.0
    if trust.lag > 0.0:
        since_ns = now_ns - round(trust.lag / _NS)
        past = [kept for kept in history if since_ns < kept.stamp_ns < now_ns]
        past.append(motion_at(history, since_ns) or now)
        change_v = max(abs(kept.v2 - now.v2) for kept in past)
        change_u = max(abs(kept.u2 - now.u2) for kept in past)
    sd_v2, sd_u2 = math.hypot(trust.sd_v2, change_v), math.hypot(trust.sd_u2, change_u)
    return FollowerMotion(now.v2, now.u2, sd_v2, sd_u2)


def mean_motion(a: FollowerMotion, b: FollowerMotion) -> FollowerMotion:
    """Mean motion over an interval, from the motions at its ends (trapezoid)."""
    return replace(b, v2=0.5 * (a.v2 + b.v2), u2=0.5 * (a.u2 + b.u2))
