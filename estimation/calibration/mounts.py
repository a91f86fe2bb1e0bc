"""Where a rigid body sits on its robot, found from how the body moves.

A robot on wheels moves along its heading only. Its body, at m on the robot and turned by yaw, therefore moves
along the robot's axes as ``(v - u m_y, u m_x)``: what is across the heading in proportion to the speed tells
the yaw, what is across in proportion to the turn rate tells m_x, and what is along in proportion to the turn
rate, beside the wheels' own speed, tells m_y. What slips in turns does so alike to the left and to the right.
Of a robot whose wheels tell nothing, the speed is taken to change slowly, or alike in left and right turns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.calibration.smoothed_track import LocalFit, fitted_rates
from estimation.models.measurement import PoseNoise
from estimation.tracking.mount_check import NO_MOUNT_CHECK, mount_checked, mount_left
from formation.angles import FloatArray, wrap
from formation.mount import Mount
from formation.pose import Pose
from formation.wrapping import wrapped

LEAST_S = 3.0
"""Seconds of motion that a mount rests on at least."""

VAGUE_YAW, VAGUE_PLACE = 0.035, 0.01
"""A yaw [rad] or place [m] that is less certain than this is as good as not known."""

_SLOWEST = 0.01  # [m/s]: by less than this nobody tells a direction
_LIKELY_PLACE = 0.15  # [m]: how far off the middle of the wheel axis bodies are put, as a standard deviation
_BLOCK_S = 1.0  # errors that are this far apart are taken to be independent
_FEWEST_BLOCKS = 3
_SPEED_PERIOD_S = 10.0  # a speed that is not known otherwise changes no faster than this
_TUNING = 4.685  # of Tukey's biweight: 95 % as good as least squares where errors are Gaussian
_ROUNDS = 30
_GRID_S = 0.01
_SHORTEST_FIT_S, _FIT_FRAMES = 0.5, 10
_LONGEST_GAP_S = 0.25
_LEAST_SIGNAL = 10.0  # of a direction of motion against what noise makes of it, as a ratio of powers
_AT_LEAST = 1e-12
_CONVERGED = 1e-10
_SHORT_ROUNDS = 3  # the second looks along the robot's axes, the third makes nothing of it any more


@dataclass(frozen=True, slots=True, eq=False)
class WheelSpeed:
    """What a robot's wheels tell of its speed: (n,) [m/s] at n increasing times (n,) [s]."""

    t: FloatArray
    v: FloatArray


@dataclass(frozen=True, slots=True)
class FoundMount:
    """A mount, in full: x, y [m] and yaw [rad] from the robot to its body, None where the motion is silent.

    ``sd``: their standard deviations, None alike.
    """

    x: float | None
    y: float | None
    yaw: float | None
    sd: tuple[float | None, float | None, float | None]

    def mount(self, otherwise: Mount) -> Mount:
        """The mount, with what is not known taken from another one."""
        found = (self.x, self.y, self.yaw)
        return Mount(
            *(other if known is None else known for known, other in zip(found, otherwise, strict=True))
        )


NOTHING_FOUND = FoundMount(None, None, None, (None, None, None))


@dataclass(frozen=True, slots=True, eq=False)
class _Moves:
    """How a body moves, n rows on an even grid: along and across its own x axis [m/s], turning [rad/s].

    ``noise``: half the differences (n, 3) of the same by every other pose and by those in between. These are
    as noisy as what all poses tell, and hold nothing of the motion.
    """

    t: FloatArray
    along: FloatArray
    across: FloatArray
    turn: FloatArray
    noise: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """What is regressed, and on what.

    ``seen`` (n,) on ``values`` (n, k), the noise in both, and how large (k,) coefficients are beforehand.
    """

    seen: FloatArray
    values: FloatArray
    seen_noise: FloatArray
    noise: FloatArray
    likely: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Coefficients (k,) and their covariance (k, k)."""

    values: FloatArray
    covariance: FloatArray

    def of(self, k: int) -> tuple[float, float]:
        """The k-th and its standard deviation."""
        return float(self.values[k]), math.sqrt(max(0.0, float(self.covariance[k, k])))


def find_mount(t: FloatArray, poses: FloatArray, wheels: WheelSpeed | None = None) -> FoundMount:
    """Mount of a body whose poses (n, 3) x [m], y [m], theta [rad] were seen at increasing times (n,) [s].

    The robot drives forwards for most of the way. Regressions by Tukey's biweight, so that steps and outliers
    of the motion capture do not count; the noise in what is regressed on is taken off. Standard deviations
    hold errors together that are less than a second apart, and what a place that is not known does to the
    rest.
    """
    moves = _moves(t, poses)
    yaw = _rough_yaw(moves)
    if yaw is None:
        return NOTHING_FOUND
    across = None
    for _ in range(_ROUNDS):
        across = _regression(moves.t, _by_speed_and_turn(moves, yaw))
        if across is None:
            return NOTHING_FOUND
        yaw = float(wrap(yaw + math.asin(max(-0.5, min(0.5, float(across.values[0]))))))
        if abs(across.values[0]) < _CONVERGED:
            break
    assert across is not None
    (_, sd_yaw), (x, sd_x) = across.of(0), across.of(1)
    y, sd_y = _sideways(moves, yaw, wheels)
    return _known(x, y, yaw, (sd_x, sd_y, sd_yaw))


def short_drive_mount(stamps_ns: list[int], poses: list[Pose], noise: PoseNoise) -> FoundMount:
    """What a drive tells that is too short for :func:`find_mount`, as of a robot stopped for its mount.

    ``poses``: of the body, at increasing times [ns], with their noise. It is what the live check of a mount
    has seen: yaw and x, by the chords of short arcs; y takes longer.
    """
    yaw = 0.0
    left = mount_left(NO_MOUNT_CHECK)
    for _ in range(_SHORT_ROUNDS):
        check = NO_MOUNT_CHECK
        for at_ns, pose in zip(stamps_ns, poses, strict=True):
            robot = pose._replace(theta=wrapped(pose.theta - yaw))
            check = mount_checked(check, at_ns, robot, noise, False)
        left = mount_left(check)
        if not left.known:
            return NOTHING_FOUND
        yaw = wrapped(yaw + left.yaw)
    return _known(left.place, 0.0, yaw, (left.sd_place, math.inf, left.sd_yaw))


def _known(x: float, y: float, yaw: float, sd: tuple[float, float, float]) -> FoundMount:
    limits = (VAGUE_PLACE, VAGUE_PLACE, VAGUE_YAW)
    sure = [each <= limit for each, limit in zip(sd, limits, strict=True)]
    found = [value if known else None for value, known in zip((x, y, yaw), sure, strict=True)]
    kept = [value if known else None for value, known in zip(sd, sure, strict=True)]
    return FoundMount(found[0], found[1], found[2], (kept[0], kept[1], kept[2]))


def _moves(t: FloatArray, poses: FloatArray) -> _Moves:
    """Motion of a body along its own axes, where it is known."""
    window = max(_SHORTEST_FIT_S, _FIT_FRAMES * float(np.median(np.diff(t)))) if len(t) > 1 else math.inf
    fit = LocalFit(_GRID_S, window, _LONGEST_GAP_S)
    grid, place, rate = fitted_rates(t, poses, fit)
    if len(grid) == 0:
        nothing = np.empty(0)
        return _Moves(nothing, nothing, nothing, nothing, np.empty((0, 3)))
    cos, sin = np.cos(place[:, 2]), np.sin(place[:, 2])

    def along_body(rates: FloatArray) -> FloatArray:
        x, y, turn = rates.T
        return np.column_stack([cos * x + sin * y, cos * y - sin * x, turn])

    halves = [fitted_rates(t[k::2], poses[k::2], fit) for k in (0, 1)]
    apart = [
        np.column_stack([np.interp(grid, half, column, math.nan, math.nan) for column in rates.T])
        for half, _, rates in halves
    ]
    moved, noise = along_body(rate), 0.5 * (along_body(apart[0]) - along_body(apart[1]))
    good = np.isfinite(moved).all(axis=1) & np.isfinite(noise).all(axis=1)
    along, across, turn = moved[good].T
    return _Moves(grid[good], along, across, turn, noise[good])


def _rough_yaw(moves: _Moves) -> float | None:
    """Yaw by the mean direction of travel, None where there is hardly any."""
    if len(moves.t) * _GRID_S < LEAST_S:
        return None
    speed = np.hypot(moves.along, moves.across)
    moving = speed > max(_SLOWEST, 0.3 * float(np.percentile(speed, 90)))
    if np.count_nonzero(moving) * _GRID_S < LEAST_S:
        return None
    angles = np.arctan2(moves.across[moving], moves.along[moving])
    middle = math.atan2(float(np.sin(angles).sum()), float(np.cos(angles).sum()))
    return -(middle + float(np.median(wrap(angles - middle))))


def _ahead(along: FloatArray, across: FloatArray, yaw: float) -> FloatArray:
    """What of a body's velocity is along the heading of a robot on which it is turned by a yaw."""
    return math.cos(yaw) * along - math.sin(yaw) * across


def _left(along: FloatArray, across: FloatArray, yaw: float) -> FloatArray:
    """What of it is across the heading, to the left."""
    return math.sin(yaw) * along + math.cos(yaw) * across


def _by_speed_and_turn(moves: _Moves, yaw: float) -> _Rows:
    """Velocity across the heading that a yaw stands for, and what tells by how much that is off, and m_x."""
    along_noise, across_noise, turn_noise = moves.noise.T
    return _Rows(
        _left(moves.along, moves.across, yaw),
        np.column_stack([-_ahead(moves.along, moves.across, yaw), moves.turn]),
        _left(along_noise, across_noise, yaw),
        np.column_stack([-_ahead(along_noise, across_noise, yaw), turn_noise]),
        np.array([math.inf, _LIKELY_PLACE]),
    )


def _sideways(moves: _Moves, yaw: float, wheels: WheelSpeed | None) -> tuple[float, float]:
    """Place m_y by the speed along the heading, and its standard deviation."""
    ahead, turn_noise = _ahead(moves.along, moves.across, yaw), -moves.noise[:, 2]
    if wheels is not None and (told := _told_speed(moves, wheels)) is not None:
        further = told
        good = np.isfinite(told).all(axis=1)
    else:
        further = _slow(moves.t)
        good = np.abs(ahead) > 0.5 * float(np.median(np.abs(ahead)))
    values = np.column_stack([-moves.turn, np.abs(moves.turn), further])[good]
    noise = np.zeros_like(values)
    noise[:, 0] = turn_noise[good]
    likely = np.array([_LIKELY_PLACE, *[math.inf] * (values.shape[1] - 1)])
    ahead_noise = _ahead(moves.noise[:, 0], moves.noise[:, 1], yaw)
    fit = _regression(moves.t[good], _Rows(ahead[good], values, ahead_noise[good], noise, likely))
    return (0.0, math.inf) if fit is None else fit.of(0)


def _told_speed(moves: _Moves, wheels: WheelSpeed) -> FloatArray | None:
    """Speed by the wheels and its rate (n, 2), smoothed as the body's is; None where that tells nothing.

    The rate stands for stamps that are a little early or late, the speed itself for wheels of another size.
    """
    if len(wheels.t) < 2:
        return None
    unused = np.zeros(len(wheels.t))
    fit = LocalFit(_GRID_S, _SHORTEST_FIT_S, _LONGEST_GAP_S)
    grid, place, rate = fitted_rates(wheels.t, np.column_stack([wheels.v, unused, unused]), fit)
    good = np.isfinite(place[:, 0])
    if np.count_nonzero(good) * _GRID_S < LEAST_S or not np.any(place[good, 0]):
        return None
    columns = (place[:, 0], rate[:, 0])
    told = np.column_stack([np.interp(moves.t, grid, column, math.nan, math.nan) for column in columns])
    enough = np.count_nonzero(np.isfinite(told).all(axis=1)) > 0.5 * len(moves.t)
    return told if enough else None


def _slow(t: FloatArray) -> FloatArray:
    """A constant and slow waves (n, k): what a speed may do by itself."""
    span = max(float(t[-1] - t[0]), _GRID_S)
    waves = range(int(2.0 * span / _SPEED_PERIOD_S) + 1)
    return np.column_stack([np.cos(math.pi * k * (t - t[0]) / span) for k in waves])


def _regression(t: FloatArray, rows: _Rows) -> _Fit | None:
    """Robust regression on rows that are noisy themselves; None for a span that is too short.

    A direction that stands out of the noise no better than noise does is left to what is likely beforehand.
    """
    blocks = np.floor((t - t[0]) / _BLOCK_S).astype(np.int64) if len(t) else np.empty(0, np.int64)
    known = rows.values.shape[1]
    if len(np.unique(blocks)) < known + _FEWEST_BLOCKS:
        return None
    scale = np.sqrt(np.mean(np.square(rows.values), axis=0)) + _AT_LEAST
    values, noise, seen = rows.values / scale, rows.noise / scale, rows.seen
    found, weights, prior = np.zeros(known), np.ones(len(t)), np.zeros((known, known))
    normal, kept = np.eye(known), np.eye(known)
    for _ in range(_ROUNDS):
        signal, kept = _without_noise(values, noise, weights)
        normal = signal + prior
        tied = values.T @ (weights * seen) - noise.T @ (weights * rows.seen_noise)
        before, found = found, np.linalg.lstsq(normal, kept @ tied, rcond=None)[0]
        rest = seen - values @ found
        reach = _TUNING * 1.4826 * float(np.median(np.abs(rest))) + _AT_LEAST
        weights = np.square(np.maximum(0.0, 1.0 - np.square(rest / reach)))
        variance = _lasting_variance(weights * rest, blocks)
        prior = np.diag(variance / np.square(rows.likely * scale))
        if np.max(np.abs(found - before)) < _CONVERGED:
            break
    inverse = np.linalg.pinv(normal)
    scores = values * (weights * rest)[:, np.newaxis]
    scores -= noise * (weights * (rows.seen_noise - noise @ found))[:, np.newaxis]
    scores = _summed(scores, blocks) @ kept.T
    # Few blocks make for a covariance that is itself uncertain, as few degrees of freedom do.
    free = len(scores) / max(len(scores) - known - 2.0, 1.0)
    covariance = inverse @ (free * scores.T @ scores + prior * variance) @ inverse
    return _Fit(found / scale, covariance / np.outer(scale, scale))


def _lasting_variance(rest: FloatArray, blocks: NDArray[np.int64]) -> float:
    """Variance of independent residuals whose sums over blocks would scatter as these do."""
    sums = np.bincount(blocks, rest)
    return max(float(sums @ sums) / len(rest), float(rest @ rest) / len(rest))


def _without_noise(
    values: FloatArray, noise: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Normal matrix of what the rows would be without their noise, as far as that stands out of it.

    With it the projection (k, k) of sums over rows on what stands out.
    """
    whole = (values * weights[:, np.newaxis]).T @ values
    of_noise = (noise * weights[:, np.newaxis]).T @ noise
    root = np.linalg.cholesky(of_noise + 1e-9 * np.diag(np.diag(whole) + _AT_LEAST))
    back = np.linalg.inv(root)
    signals, directions = np.linalg.eigh(back @ (whole - of_noise) @ back.T)
    clear = directions[:, signals > _LEAST_SIGNAL]
    kept = root @ clear @ clear.T
    return kept @ (back @ (whole - of_noise) @ back.T) @ (clear @ clear.T @ root.T), kept @ back


def _summed(scores: FloatArray, blocks: NDArray[np.int64]) -> FloatArray:
    """Sums over blocks of what would be zero on average if the coefficients were right."""
    there, place = np.unique(blocks, return_inverse=True)
    sums = np.zeros((len(there), scores.shape[1]))
    np.add.at(sums, place, scores)
    return sums
