"""How far odometry is off, found: its white noise by its own samples, what lasts by the follower's track.

Third differences of four even samples have 20 times the variance of a sample's white noise and next to
nothing of a robot's motion. What lasts longer, as slip or a scale, shows in windows: the mean of odometry
against that of the track, less the noise of the poses and the white noise that is left of a mean. Both begin
as they are told.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.models.coordinated_turn import FollowerMotion
from estimation.own_motion.odometry_check import OdometrySample, WayEntry, mean_ways
from estimation.own_motion.odometry_history import InputTrust
from estimation.own_motion.own_track import OwnNoise
from formation.kernel import kernel

_NS = 1e-9
_SAMPLES, _WINDOWS = 256.0, 32.0  # reached back by means; windows of half a second
_BEGIN_SAMPLES, _BEGIN_WINDOWS = 2.0, 1.0  # that what is told counts as
_CUT = 9.0  # of a mean, above which a square is cut: steps and outliers are few
_LEAST, _MOST = 0.01, 4.0  # of the variance that is told, what lasts is taken for
_MOVES = 0.05  # of the limits; a robot that stands shows no noise at all
_UNEVEN = 0.2  # of a period
_BETWEEN = 2.0 / 3.0  # of its variance has noise that is linear between two samples, in the mean
_THIRD = 1.0 / 20.0


class Differences(NamedTuple):
    """A channel's newest sample, and its first and second difference."""

    last: float
    first: float
    second: float


class ChannelNoise(NamedTuple):
    """One channel: differences of its samples; variance of its white noise; share of the told that lasts."""

    differences: Differences
    white: float
    lasting: float


class OdometryNoise(NamedTuple):
    """Both channels; ``even``: how many samples in a row have come evenly. samples, windows: in the means."""

    v: ChannelNoise
    u: ChannelNoise
    even: int
    dt: float
    samples: float
    windows: float


_NO_CHANNEL = ChannelNoise(Differences(0.0, 0.0, 0.0), 0.0, 1.0)
ODOMETRY_AS_TOLD = OdometryNoise(_NO_CHANNEL, _NO_CHANNEL, 0, 0.0, _BEGIN_SAMPLES, _BEGIN_WINDOWS)


@kernel(inline=False)
def noise_with_sample(
    noise: OdometryNoise, before: OdometrySample, sample: OdometrySample, trust: InputTrust, limits: OwnNoise
) -> OdometryNoise:
    """Noise with a sample that follows on another."""
    dt = (sample.stamp_ns - before.stamp_ns) * _NS
    if dt <= 0.0:
        return noise
    even = noise.even + 1 if abs(dt - noise.dt) <= _UNEVEN * dt else 1
    moves = abs(sample.v2) > _MOVES * limits.v_max or abs(sample.u2) > _MOVES * limits.u_max
    samples = min(noise.samples + 1.0, _SAMPLES) if moves and even > 3 else noise.samples
    by = 1.0 / samples if moves and even > 3 else 0.0
    v = _with_value(noise.v, sample.v2, by, trust.sd_v2 * trust.sd_v2)
    u = _with_value(noise.u, sample.u2, by, trust.sd_u2 * trust.sd_u2)
    return noise._replace(v=v, u=u, even=even, dt=dt, samples=samples)


@kernel
def _with_value(channel: ChannelNoise, value: float, by: float, told: float) -> ChannelNoise:
    """Channel with one more value, which counts in the mean by a share."""
    was = channel.differences
    first = value - was.last
    second = first - was.first
    third = second - was.second
    white = channel.white if channel.white > 0.0 else told
    square = min(third * third * _THIRD, _CUT * white)
    return ChannelNoise(Differences(value, first, second), white + by * (square - white), channel.lasting)


@kernel(inline=False)
def noise_with_window(
    noise: OdometryNoise, before: WayEntry, after: WayEntry, trust: InputTrust, limits: OwnNoise
) -> OdometryNoise:
    """Noise with a window between two entries of which the track's ways are known."""
    dt = (after.stamp_ns - before.stamp_ns) * _NS
    if dt <= 0.0 or noise.dt <= 0.0:
        return noise
    told, track = mean_ways(after.twist, before.twist, dt), mean_ways(after.track, before.track, dt)
    if abs(track.v) <= _MOVES * limits.v_max and abs(track.u) <= _MOVES * limits.u_max:
        return noise
    place, heading = limits.pose.position / dt, limits.pose.heading / dt
    slip_v, slip_u, mean = trust.slip_v * told.v, trust.slip_u * told.u, noise.dt / dt
    windows = min(noise.windows + 1.0, _WINDOWS)
    v = _with_rest(
        noise.v,
        told.v - track.v,
        2.0 * place * place + mean * noise.v.white,
        trust.sd_v2 * trust.sd_v2 + slip_v * slip_v,
        windows,
    )
    u = _with_rest(
        noise.u,
        told.u - track.u,
        2.0 * heading * heading + mean * noise.u.white,
        trust.sd_u2 * trust.sd_u2 + slip_u * slip_u,
        windows,
    )
    return noise._replace(v=v, u=u, windows=windows)


@kernel
def _with_rest(
    channel: ChannelNoise, rest: float, explained: float, told: float, windows: float
) -> ChannelNoise:
    """Channel with what a window leaves, of which some is explained by other noise."""
    share = min((rest * rest - explained) / told, _CUT)
    return channel._replace(lasting=channel.lasting + (share - channel.lasting) / windows)


@kernel
def with_found_noise(motion: FollowerMotion, noise: OdometryNoise) -> FollowerMotion:
    """Motion by odometry with the deviations that were found, in the place of those that are told."""
    if noise.samples <= _BEGIN_SAMPLES:
        return motion
    return motion._replace(sd_v2=_found(motion.sd_v2, noise.v), sd_u2=_found(motion.sd_u2, noise.u))


@kernel
def _found(told: float, channel: ChannelNoise) -> float:
    lasting = min(max(channel.lasting, _LEAST), _MOST)
    return math.sqrt(lasting * told * told + _BETWEEN * channel.white)
