"""How odometry relates to the motion that mocap saw: how late and how fast the robot answers, by what share.

Both are averaged over the same windows, odometry as the integral of its samples, mocap as the way between two
poses, so that no filter comes between them. Motion is then taken for scale times what a first-order lag makes
of odometry ``delay`` earlier: commands that stand in for odometry are answered so, by one link and one motor
driver for both v and u. Wheel odometry has no lag, and a delay alone is told where it does as well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.models.motion import Matrix, Vector
from estimation.own_motion.block_errors import sandwich
from estimation.own_motion.lagged_signal import LaggedSignal, columns_of
from formation.angles import FloatArray, wrap

WINDOW = 0.5
"""Length [s] over which motion is averaged: mocap noise is then far below what a driven robot does."""

LONGEST_DELAY = 1.0
"""Delays and lags that add up to this [s] are tried, and delays of either sign."""

_STEPS = 5  # windows that begin in one; they overlap, so that only one of these counts as independent
_STEP = WINDOW / _STEPS  # between windows [s]
_GRID = 0.02  # of delays [s]
_IN_STEP = round(_STEP / _GRID)
_LAGS = (0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7)
_APART = 0.3  # delays further than this [s] from the best one must be worse by _DROP
_DROP = 4.5  # of log-likelihood: three standard deviations
_SDS = 3.0  # that it stands for
_LARGEST_SD_SCALE = 0.2
_LARGEST_SD_LAG = 0.05  # [s]
_FEWEST = 10  # independent windows
_LONGEST_GAP = 0.2  # between two poses or two samples of odometry for a window to count [s]
_SLOPE = 1e-3  # [s] by which a lag is changed for its slope
_LEAST_LAG = 1e-3  # [s]; a shorter one is a delay to any measurement
_ROUNDS, _HALVINGS = 8, 4
_SETTLED = 0.01  # of log-likelihood that a step gains at least
_BLOCK = 4.0  # [s]; slip is alike for longer than a manoeuvre


@dataclass(frozen=True, slots=True)
class Known:
    """A value with its standard deviation."""

    value: float
    sd: float


@dataclass(frozen=True, slots=True)
class Alignment:
    """``motion(t) = scale * answer(t - delay)`` with ``lag * answer' = odometry - answer``; None: not known.

    ``delay`` [s] is positive for odometry that runs ahead of the robot, as commands do. ``lag`` [s] is 0
    where a delay alone does as well, with what it may be at most as three standard deviations. ``late``: both
    together, which are better known than how they share it.
    """

    delay: Known | None
    scale_v: Known | None
    scale_u: Known | None
    lag: Known | None = None
    late: Known | None = None


UNKNOWN = Alignment(None, None, None)


class _Answer(NamedTuple):
    """Delay and lag [s], the log-likelihood of the windows by them, the covariance with scales, if any."""

    delay: float
    lag: float
    likelihood: float
    covariance: FloatArray | None = None

    @property
    def sds(self) -> FloatArray:
        """Standard deviations in the order of the covariance; infinite without one."""
        if self.covariance is None:
            return np.full(4, np.inf)
        sds: FloatArray = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2).max(axis=0).clip(0.0))
        return sds


def align_odometry(times: Vector, poses: Matrix, odometry_times: Vector, odometry: Matrix) -> Alignment:
    """Delay, lag and scales of odometry (m, 2) against a track (n, 3).

    Odometry: v [m/s], u [rad/s]; track: x, y [m], theta [rad]. Times (n,), (m,) [s] increase and have one
    zero. Every delay and lag of a grid gets its scales by least squares; the profile likelihood, n/2 log of
    the residuals of both channels, tells the best, from which on the fit goes by Gauss-Newton steps. The lag
    is 0 unless one makes the windows likelier by what stands for three standard deviations. Those are the
    larger ones of what independent windows leave and what sums over blocks show. A delay is unknown if
    another one far from it does about as well, as where the robot hardly changes its motion; a lag if 0.15 s
    of it would do too; a scale if its standard deviation is above 0.2.
    """
    if len(times) < 2 or len(odometry_times) < 2:
        return UNKNOWN
    half, reach = 0.5 * WINDOW, 0.5 * WINDOW + LONGEST_DELAY
    first = max(times[0] + half, odometry_times[0] + reach)
    last = min(times[-1] - half, odometry_times[-1] - reach)
    count = max(0, math.ceil((last - first) / _STEP))
    places = np.arange(count)
    centres = first + _STEP * places
    covered = _covered(times, centres, half) & _covered(odometry_times, centres, reach)
    places, centres = places[covered], centres[covered]
    if len(centres) / _STEPS < _FEWEST:
        return UNKNOWN
    signal = LaggedSignal(odometry_times, odometry[:, 0] + 1j * odometry[:, 1], held=False)
    return _Windows(signal, first, places, centres, _mean_motion(times, poses, centres)).alignment()


@dataclass(frozen=True, slots=True, eq=False)
class _Windows:
    """Mean motions ``seen`` (k, 2) over windows around the centres, ``places`` steps from the first."""

    signal: LaggedSignal
    first: float
    places: NDArray[np.int64]
    centres: Vector
    seen: Matrix

    def alignment(self) -> Alignment:
        """What the windows tell."""
        lates = np.arange(-LONGEST_DELAY, LONGEST_DELAY + 0.5 * _GRID, _GRID)
        table = np.array([self._likelihoods(lates, lag) for lag in _LAGS])
        row, column = np.unravel_index(np.argmax(table), table.shape)
        alone = int(np.argmax(table[0]))
        pure = self._refined(_Answer(float(lates[alone]), 0.0, float(table[0, alone])))
        found, profile, best = pure, table[0], alone
        if row > 0:
            lag = _LAGS[row]
            start = _Answer(float(lates[column]) - lag, lag, float(table[row, column]))
            lagged = self._refined(start)
            if lagged.likelihood - pure.likelihood > _DROP and lagged.sds[1] < _LARGEST_SD_LAG:
                found, profile, best = lagged, table.max(axis=0), int(column)
        scales = self._scales(found)
        if not _stands_alone(lates, profile, best) or found.covariance is None:
            return Alignment(None, *scales)
        delay = Known(found.delay, float(found.sds[0]))
        if found.lag == 0.0:
            return Alignment(delay, *scales, _at_most(table), delay)
        both = found.covariance[:, :2, :2].sum(axis=(1, 2))
        late = Known(found.delay + found.lag, math.sqrt(float(np.max(both))))
        return Alignment(delay, *scales, Known(found.lag, float(found.sds[1])), late)

    def means(self, delay: float, lag: float) -> Matrix:
        """Mean v and u (k, 2) of the lag's answer to odometry, so much earlier, over the windows."""
        return self._means(self.centres - delay, lag)

    def _means(self, centres: Vector, lag: float) -> Matrix:
        states = self.signal.states(lag)
        begins, ends = (
            self.signal.answered_ways(centres + side, lag, states) for side in (-0.5 * WINDOW, 0.5 * WINDOW)
        )
        return columns_of(ends - begins) / WINDOW

    def _likelihoods(self, lates: Vector, lag: float) -> Vector:
        """Log-likelihoods of all sums of delay and lag; of a delay beyond what is tried that is no chance."""
        whole, span = len(lates), int(self.places[-1]) * _IN_STEP
        grid: FloatArray = (
            self.first + lag - LONGEST_DELAY + _GRID * np.arange(span + whole, dtype=np.float64)
        )
        by_odometry = self._means(grid, lag)
        chosen = (self.places * _IN_STEP)[np.newaxis, :] + np.arange(whole)[::-1, np.newaxis]
        means = by_odometry[chosen]  # (lates, windows, 2)
        _, rests = _fit(self.seen, means)
        likelihoods = self._likelihood(rests)
        return np.where(lates - lag < -LONGEST_DELAY, -np.inf, likelihoods)

    def _likelihood(self, rests: FloatArray) -> FloatArray:
        independent = len(self.places) / _STEPS
        likelihood: FloatArray = -0.5 * independent * np.log(np.maximum(rests, 1e-12)).sum(axis=-1)
        return likelihood

    def _refined(self, start: _Answer) -> _Answer:
        """The answer that fits best near a start: with a lag, or without one if it has none."""
        here = self._judged(start.delay, start.lag)
        for _ in range(_ROUNDS):
            step = self._step(here)
            if step is None:
                break
            ahead = here
            for _ in range(_HALVINGS):
                lag = max(_LEAST_LAG, here.lag + step[1]) if here.lag > 0.0 else 0.0
                ahead = self._judged(here.delay + step[0], lag)
                if ahead.likelihood > here.likelihood - _SETTLED:
                    break
                step = 0.5 * step
            if not ahead.likelihood > here.likelihood + _SETTLED:
                break
            here = ahead
        slopes, off = self._slopes(here)
        covariance = sandwich(slopes.T @ slopes, slopes * off[:, np.newaxis], self.centres, _BLOCK, _STEPS)
        return here._replace(covariance=covariance)

    def _judged(self, delay: float, lag: float) -> _Answer:
        if abs(delay) > LONGEST_DELAY or lag > LONGEST_DELAY:
            return _Answer(delay, lag, -math.inf)
        _, rests = _fit(self.seen, self.means(delay, lag))
        return _Answer(float(delay), float(lag), float(self._likelihood(rests)))

    def _step(self, here: _Answer) -> Vector | None:
        """Gauss-Newton step of delay and lag, the latter 0 where there is none."""
        slopes, off = self._slopes(here)
        if not np.all(np.isfinite(slopes)):
            return None
        step = np.linalg.lstsq(slopes, -off, rcond=None)[0]
        return np.array([step[0], step[1] if here.lag > 0.0 else 0.0])

    def _slopes(self, here: _Answer) -> tuple[Matrix, Vector]:
        """Slopes (2 k, p) of the residuals by delay, lag if there is one, and scales; the residuals (2 k,).

        All in standard deviations of what the channel leaves, channel after channel.
        """
        delay, lag = here.delay, here.lag
        states = self.signal.states(lag)
        at = [self.centres - delay + side for side in (-0.5 * WINDOW, 0.5 * WINDOW)]
        answers = [columns_of(self.signal.answers(each, lag, states)) for each in at]
        ways = [columns_of(self.signal.ways(each)) for each in at]
        means = (ways[1] - ways[0] - lag * (answers[1] - answers[0])) / WINDOW
        scales, rests = _fit(self.seen, means)
        by_delay = -(answers[1] - answers[0]) / WINDOW
        by_lag = (self.means(delay, lag + _SLOPE) - means) / _SLOPE if lag > 0.0 else by_delay
        columns = []
        for k in range(2):
            own = np.zeros((len(means), 2))
            own[:, k] = means[:, k]
            shapes = [scales[k] * by_delay[:, k], scales[k] * by_lag[:, k]][: 2 if lag > 0.0 else 1]
            columns.append(np.column_stack([*shapes, own]))
        sds = np.sqrt(np.maximum(rests, 1e-12))
        off = (scales * means - self.seen) / sds
        return np.vstack([columns[0] / sds[0], columns[1] / sds[1]]), off.T.ravel()

    def _scales(self, found: _Answer) -> tuple[Known | None, Known | None]:
        """Both scales by an answer, None for what is too uncertain."""
        by_odometry = self.means(found.delay, found.lag)
        scales, rest = _fit(self.seen, by_odometry)
        power = np.mean(by_odometry**2, axis=0)
        sds = np.sqrt(rest / np.maximum(power, 1e-12) / (len(self.places) / _STEPS))
        if found.covariance is not None:
            sds = np.maximum(sds, found.sds[-2:])
        scale_v, scale_u = (
            Known(scale, sd) if sd < _LARGEST_SD_SCALE else None
            for scale, sd in zip(scales.tolist(), sds.tolist(), strict=True)
        )
        return scale_v, scale_u


def _fit(seen: Matrix, by_odometry: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Scales (..., 2) through the origin by least squares, and the mean squares of what they leave."""
    power = np.maximum(np.einsum("...kc,...kc->...c", by_odometry, by_odometry), 1e-12)
    both = np.einsum("...kc,kc->...c", by_odometry, seen)
    left = np.einsum("kc,kc->c", seen, seen) - both * both / power
    return both / power, np.maximum(left, 0.0) / len(seen)


def _stands_alone(lates: Vector, profile: Vector, best: int) -> bool:
    """Whether no other delay far from the best one does about as well, nor one beyond those tried."""
    if not 0 < best < len(lates) - 1:
        return False
    apart = np.abs(lates - lates[best]) > _APART
    return bool(profile[best] - np.max(profile[apart]) > _DROP)


def _at_most(table: Matrix) -> Known | None:
    """A lag of 0, three standard deviations off what the windows no longer bear; None if they bear any."""
    bears = table.max(axis=1) > table[0].max() - _DROP
    if bears[-1]:
        return None
    sd = _LAGS[int(np.flatnonzero(bears)[-1]) + 1] / _SDS
    return Known(0.0, sd) if sd < _LARGEST_SD_LAG else None


def _mean_motion(times: Vector, poses: Matrix, centres: Vector) -> Matrix:
    """Mean v and u (k, 2) over the windows around the centres, from the poses at their ends."""
    turned = np.unwrap(poses[:, 2])
    ends = [
        np.column_stack([np.interp(centres + side, times, column) for column in (*poses[:, :2].T, turned)])
        for side in (-0.5 * WINDOW, 0.5 * WINDOW)
    ]
    way = ends[1] - ends[0]
    middle = ends[0][:, 2] + 0.5 * way[:, 2]
    chord = way[:, 0] * np.cos(middle) + way[:, 1] * np.sin(middle)
    return np.column_stack([chord / np.sinc(wrap(way[:, 2]) / (2.0 * np.pi)), way[:, 2]]) / WINDOW


def _covered(times: Vector, centres: Vector, reach: float) -> NDArray[np.bool_]:
    """Which centres have no gap of the times within reach."""
    gaps = np.flatnonzero(np.diff(times) > _LONGEST_GAP)
    covered = np.ones(len(centres), dtype=np.bool_)
    for gap in gaps:
        covered &= (centres + reach < times[gap]) | (centres - reach > times[gap + 1])
    return covered
