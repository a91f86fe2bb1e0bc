"""Velocities from a window of noisy positions, and how wrong they can be: a difference, and a straight line.

Positions at -k step are known within eps, the acceleration within A (balls in the plane, or intervals on a
line). The newest position less the one k samples before, over T = k step, errs by at most
2 eps / T + A T / 2. The least of these, W, is all that a weighted sum of positions can do in windows up to
2 W / A, twice the best one: there the motion x(t) = eps + W t + A t^2 / 2 stays within eps of zero at every
sample, and looks like rest.

That noise leans to one side for as long as it likes. Where it is independent from sample to sample it
averages out: the slope of the straight line through the N = k + 1 newest positions, by least squares, has the
standard deviation sigma / (step sqrt(N (N^2 - 1) / 12)) along any direction. What it makes of acceleration is
the same A T / 2, as its weights on velocities are nowhere negative and have their middle at T / 2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.bounds.guarantees import guaranteed_window


class WindowDifference(NamedTuple):
    """Estimate over ``samples`` steps; ``error``: what it errs by at most [m/s] as the newest velocity."""

    samples: int
    error: float


def best_difference(eps: float, A: float, step: float) -> WindowDifference:
    """Window of least guaranteed error, for samples every ``step`` [s]; eps [m] and A [m/s^2] are > 0.

    With dense samples the error comes down to 2 sqrt(eps A), which nothing that knows the past only can beat.
    Raises :class:`ValueError` for numbers that are not positive.

    >>> best_difference(1.5e-3, 0.07, 1.0 / 120.0)
    WindowDifference(samples=35, error=0.02049404761904762)
    """
    _check(eps, A, step)
    # The error is convex in the window: the best number of samples is one of the two beside the best window.
    fewer = max(1, math.floor(float(guaranteed_window(eps, A)) / step))
    return min((_over(eps, A, step, samples) for samples in (fewer, fewer + 1)), key=lambda each: each.error)


def best_line(eps: float, A: float, step: float) -> WindowDifference:
    """Window over which a straight line errs least, noise being independent from sample to sample.

    ``eps``: how many standard deviations of a position along any direction [m] are allowed for; the error is
    so many of the line's. Raises :class:`ValueError` as :func:`best_difference`.

    >>> best_line(1.5e-3, 0.07, 1.0 / 120.0)
    WindowDifference(samples=24, error=0.011992301766027062)
    """
    _check(eps, A, step)
    found, longer = _line_over(eps, A, step, 1), _line_over(eps, A, step, 2)
    while longer.error < found.error:
        found, longer = longer, _line_over(eps, A, step, longer.samples + 1)
    return found


def _check(eps: float, A: float, step: float) -> None:
    if not (eps > 0.0 and A > 0.0 and step > 0.0):
        raise ValueError(f"eps {eps}, A {A}, step {step}: expected positive numbers")


def _line_over(eps: float, A: float, step: float, samples: int) -> WindowDifference:
    count = samples + 1
    slope = eps / (step * math.sqrt(count * (count * count - 1) / 12.0))
    return WindowDifference(samples, slope + 0.5 * A * samples * step)


def _over(eps: float, A: float, step: float, samples: int) -> WindowDifference:
    window = samples * step
    return WindowDifference(samples, 2.0 * eps / window + 0.5 * A * window)
