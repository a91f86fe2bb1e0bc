"""How a robot answers to its commands: after a pure delay, as a first-order lag.

The robot's own measurement of its speed and turn rate is taken for gain times the answer plus an offset, with
a gain and an offset for each of the two, and one delay and one lag for both, as one link and one motor driver
serve them. The answer to commands that hold until the next one is exact between any two times, so that
neither commands nor measurements need an even rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.models.motion import Matrix, Vector
from estimation.own_motion.block_errors import sandwich
from estimation.own_motion.input_alignment import Known
from estimation.own_motion.lagged_signal import LaggedSignal, Twists, columns_of
from formation.angles import FloatArray

EARLIEST, LATEST = -0.2, 0.6
"""Delays [s] that are tried. One below zero shows a measurement that is stamped too early, and is taken only
where it fits clearly better than any other."""

LONGEST_LAG = 1.0
"""Lags up to this [s] are tried."""

FEWEST = 60
"""Samples of a moving robot that a fit rests on at least."""

LARGEST_SD = 0.02
"""A sum of delay and lag that is less certain than this [s] counts as unknown."""

_GRID = 0.02  # of delays [s]
_LAGS = (0.005, 0.03, 0.06, 0.1, 0.15, 0.25, 0.4, 0.7)
_STEP = 1e-3  # for the slopes by delay and lag [s]
_JUMPY = 0.01  # a lag below this [s] answers in jumps, and no sample notices a short step
_STILL = 1.0  # a robot that was told to stand for longer [s] tells nothing
_LEAST_SCALE = 1e-5  # [m/s], [rad/s]: no odometry is finer
_BLOCK = 1.0  # [s] within which errors may be alike
_CLEARLY = 10.0  # by which the loss has to fall
_FAR = 4.0  # scales off the fit: an outlier


@dataclass(frozen=True, slots=True)
class ActuatorResponse:
    """``motion(t) = gain * answer(t - transport) + offset`` with ``lag * answer' = command - answer``.

    ``transport`` and ``lag`` [s]: how they share their sum is much less certain than ``delay``, the sum
    itself, since a lag acts on slow commands as a delay of the same length. ``gain_v``, ``gain_u``: share of
    the command that is reached. ``outliers`` of the ``samples`` lie far off.
    """

    transport: Known
    lag: Known
    delay: Known
    gain_v: Known
    gain_u: Known
    samples: int
    outliers: int


def fit_response(
    command_times: Vector, commands: Matrix, times: Vector, measured: Matrix
) -> ActuatorResponse | None:
    """Fit the answer to commands (m, 2) to measurements (n, 2), both v [m/s] and u [rad/s]; None if unknown.

    Times (m,), (n,) [s] increase and have one zero. A grid of delays and lags finds where the median residual
    is least; from there on least squares with a soft l1 loss, each channel scaled by the spread of its
    residuals, so that a saturated part or a broken sample bends the fit little. The standard deviations are
    the larger ones of what independent errors leave and what the sums over blocks of a second or more show
    (Huber's sandwich), as rounding and slip make neighbours err alike. Unknown is what too little motion, or
    motion at an even speed, leaves uncertain by more than :data:`LARGEST_SD`, and what lies at an end of the
    range that is tried.
    """
    if len(command_times) < 2 or len(times) < FEWEST:
        return None
    commanded = commands[:, 0] + 1j * commands[:, 1]
    chosen = _telling(command_times, commanded, times)
    times, measured = times[chosen], measured[chosen]
    if len(times) < FEWEST or np.any(np.ptp(measured, axis=0) == 0.0):
        return None
    answers = _Answers(LaggedSignal(command_times, commanded, held=True), times)
    start, scales = _nearest(answers, measured)
    coarse = _Fit(answers, measured, scales)
    p = coarse.solved(np.array([*start, 1.0, 0.0, 1.0, 0.0]), EARLIEST)
    # Off the grid residuals may spread far less, and what is far off is told by that.
    fine = _Fit(answers, measured, _spread(coarse.off(p).reshape(2, -1).T * scales))
    causal, free = fine.solved(np.maximum(p, [0.0, 0.0, *[-np.inf] * 4]), 0.0), fine.solved(p, EARLIEST)
    return fine.response(free if fine.loss(free) < fine.loss(causal) - _CLEARLY else causal)


@dataclass(frozen=True, slots=True, eq=False)
class _Answers:
    """Answers to commands at the times of the measurements."""

    commands: LaggedSignal
    times: Vector

    def states(self, lag: float) -> Twists:
        """Answer without delay at the very time of every command."""
        return self.commands.states(lag)

    def seen(self, states: Twists, delay: float, lag: float) -> FloatArray:
        """Answers (n, 2) at the measurements, by the states of the lag."""
        return columns_of(self.commands.answers(self.times - delay, lag, states))

    def of(self, delay: float, lag: float) -> FloatArray:
        """Answers (n, 2) at the measurements."""
        return self.seen(self.states(lag), delay, lag)


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Least squares over delay, lag, and gain and offset of either channel, in this order."""

    answers: _Answers
    measured: Matrix
    scales: Vector

    def solved(self, start: Vector, earliest: float) -> Vector:
        """The six that fit best, from a start near them, with no delay below the earliest one."""
        from scipy.optimize import least_squares  # a third of a second, for those only who fit

        found = least_squares(
            self.off,
            start,
            self._slopes,
            bounds=([earliest, 0.0, *[-np.inf] * 4], [LATEST, LONGEST_LAG, *[np.inf] * 4]),
            x_scale=[0.01, 0.01, 0.1, 0.01, 0.1, 0.01],
            loss="soft_l1",
        )
        p: FloatArray = found.x
        return p

    def response(self, p: Vector) -> ActuatorResponse | None:
        """What six that fit best mean, with their standard deviations; None if that is nothing."""
        off = self.off(p)
        covariance = self._covariance(p, off)
        inside = EARLIEST + _GRID < p[0] < LATEST - _GRID and p[1] < LONGEST_LAG - _GRID
        if covariance is None or not inside:
            return None
        ways = np.zeros((5, 6))
        ways[0, 0] = ways[1, 1] = ways[2, 0] = ways[2, 1] = ways[3, 2] = ways[4, 4] = 1.0
        sds = np.sqrt(np.max(np.einsum("ij,kjl,il->ki", ways, covariance, ways), axis=0))
        transport, lag, delay, gain_v, gain_u = map(Known, (ways @ p).tolist(), sds.tolist())
        if not delay.sd < LARGEST_SD:
            return None
        outliers = int(np.count_nonzero(np.any(np.abs(off.reshape(2, -1)) > _FAR, axis=0)))
        return ActuatorResponse(transport, lag, delay, gain_v, gain_u, len(self.measured), outliers)

    def loss(self, p: Vector) -> float:
        """What is made least."""
        return float(np.sum(np.sqrt(1.0 + self.off(p) ** 2) - 1.0))

    def off(self, p: Vector) -> FloatArray:
        """Residuals (2 n,) of v, then of u, in scales."""
        fitted = self.answers.of(p[0], p[1]) * p[[2, 4]] + p[[3, 5]]
        return ((fitted - self.measured) / self.scales).T.ravel()

    def _slopes(self, p: Vector) -> FloatArray:
        """Slopes (2 n, 6) of the residuals; those by delay and lag by differences."""
        delay, lag = float(p[0]), float(p[1])
        answers, states = self.answers, self.answers.states(lag)
        step = _STEP if lag > _JUMPY else _JUMPY
        late, early = (answers.seen(states, delay + side * step, lag) for side in (1.0, -1.0))
        least = max(lag - step, 0.0)
        slow, fast = answers.of(delay, lag + step), answers.of(delay, least)
        plain, ones, zeros = answers.seen(states, delay, lag), np.ones(len(late)), np.zeros(len(late))
        slopes = []
        for k, (gain, scale) in enumerate(zip((p[2], p[4]), self.scales.tolist(), strict=True)):
            by_delay = gain * (late - early)[:, k] / (2.0 * step)
            by_lag = gain * (slow - fast)[:, k] / (lag + step - least)
            own, other = [plain[:, k], ones], [zeros, zeros]
            columns = [by_delay, by_lag, *own, *other] if k == 0 else [by_delay, by_lag, *other, *own]
            slopes.append(np.column_stack(columns) / scale)
        return np.vstack(slopes)

    def _covariance(self, p: Vector, off: Vector) -> FloatArray | None:
        """Covariances (2, 6, 6) by independent errors and by blocks; None where they are not determined."""
        slopes = self._slopes(p)
        # The loss 2 (sqrt(1 + r^2) - 1) pulls by r / sqrt(1 + r^2), which grows by (1 + r^2)^(-3/2).
        pulls = slopes * (off / np.sqrt(1.0 + off**2))[:, np.newaxis]
        information = slopes.T @ (slopes * ((1.0 + off**2) ** -1.5)[:, np.newaxis])
        return sandwich(information, pulls, self.answers.times, _BLOCK)


def _telling(command_times: Vector, commanded: NDArray[np.complex128], times: Vector) -> NDArray[np.bool_]:
    """Which times lie within the commands, and not long after the last one that was not to stand."""
    ends = np.append(command_times[1:], command_times[-1])
    moving_until = np.maximum.accumulate(np.where(commanded != 0.0, ends, -np.inf))
    place = np.maximum(np.searchsorted(command_times, times, side="right") - 1, 0)
    within = (times > command_times[0] + LATEST) & (times < command_times[-1])
    telling: NDArray[np.bool_] = within & (times < moving_until[place] + _STILL)
    return telling


def _spread(off: Matrix) -> FloatArray:
    """Standard deviations (2,) of residuals (n, 2) by their median absolute deviations."""
    spread: FloatArray = 1.4826 * np.median(np.abs(off - np.median(off, axis=0)), axis=0)
    return np.maximum(spread, _LEAST_SCALE)


def _nearest(answers: _Answers, measured: Matrix) -> tuple[tuple[float, float], Vector]:
    """Delay and lag of the grid with the least median residuals, and the scales (2,) of these."""
    best, start, scales = math.inf, (0.0, 0.0), np.ones(2)
    for lag in _LAGS:
        states = answers.states(lag)
        for delay in np.arange(EARLIEST, LATEST + 0.5 * _GRID, _GRID).tolist():
            off = measured - answers.seen(states, delay, lag)
            spread = _spread(off)
            if (score := float(np.log(spread).sum())) < best:
                best, start, scales = score, (delay, lag), spread
    return start, scales
