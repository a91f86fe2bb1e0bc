"""The best linear estimate of a velocity from a window of noisy positions, and its guaranteed error.

Positions at -k step are known within eps, the acceleration within A (balls in the plane, or intervals on a
line). The newest position less the one k samples before, over T = k step, errs by at most
2 eps / T + A T / 2. The least of these, W, is all that a weighted sum of positions can do in windows up to
2 W / A, twice the best one: there the motion x(t) = eps + W t + A t^2 / 2 stays within eps of zero at every
sample, and looks like rest.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from estimation.bounds.guarantees import guaranteed_window


class WindowDifference(NamedTuple):
    """Difference over ``samples`` steps; ``error``: its guaranteed error [m/s] as the newest velocity."""

    samples: int
    error: float


def best_difference(eps: float, A: float, step: float) -> WindowDifference:
    """Window of least guaranteed error, for samples every ``step`` [s]; eps [m] and A [m/s^2] are > 0.

    With dense samples the error comes down to 2 sqrt(eps A), which nothing that knows the past only can beat.
    Raises :class:`ValueError` for numbers that are not positive.

    >>> best_difference(1.5e-3, 0.07, 1.0 / 120.0)
    WindowDifference(samples=35, error=0.02049404761904762)
    """
    if not (eps > 0.0 and A > 0.0 and step > 0.0):
        raise ValueError(f"eps {eps}, A {A}, step {step}: expected positive numbers")
    # The error is convex in the window: the best number of samples is one of the two beside the best window.
    fewer = max(1, math.floor(float(guaranteed_window(eps, A)) / step))
    return min((_over(eps, A, step, samples) for samples in (fewer, fewer + 1)), key=lambda each: each.error)


def _over(eps: float, A: float, step: float, samples: int) -> WindowDifference:
    window = samples * step
    return WindowDifference(samples, 2.0 * eps / window + 0.5 * A * window)
