"""Normalised estimation error squared: whether errors are as large as the estimator's deviations say.

NEES of a scalar is the mean of e^2 / var; 1 for an estimator that knows its errors, less for one that is too
modest, more for one that is too confident (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to
Tracking and Navigation, 2001, Sec. 5.4). Of n independent Gaussian errors n times the mean is chi-square with
n degrees of freedom. Errors of a filter are alike for as long as it remembers, so that they count for fewer:
of a Gaussian sequence with autocorrelation r_k, its squares have r_k^2, and the mean of N of them varies as
that of N / (1 + 2 sum_k (1 - k/N) r_k^2) independent ones.
"""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

CONFIDENCE = 0.999
"""Of a thousand sound estimators one lies outside its limits, half of these on either side."""

_LONG_ENOUGH = 5.0
"""A window of so many of the correlation times that are found within it (Sokal's rule)."""

_QUANTILE = NormalDist().inv_cdf(0.5 + 0.5 * CONFIDENCE)
_AT_ONCE = 1 << 13
"""Samples whose correlation is looked at together, first: most errors are forgotten long before."""

_FEWEST = 1.0
"""Less than one independent sample says nothing."""

Floats = NDArray[np.float64]


def normalised(error: Floats, sd: Floats) -> Floats:
    """Errors in standard deviations, both (n,), where both are known and the deviation is not zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = error / sd
    known = np.isfinite(ratio)
    return ratio if known.all() else ratio[known]


def squared_sum(error: Floats, sd: Floats) -> tuple[float, int]:
    """Sum of the squares of what :func:`normalised` gives, and of how many; the same bits at any address."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = error / sd
        total = float(np.sum(ratio * ratio))
    if math.isfinite(total):
        return total, len(ratio)
    ratio = normalised(error, sd)
    return float(np.sum(ratio * ratio)), len(ratio)


def effective_samples(errors: Floats) -> float:
    """How many independent samples a sequence (n,) of errors in standard deviations counts for; 0 for none.

    Correlation is taken about zero, as an error that stays the same is one error, not none.
    """
    count = len(errors)
    if count == 0 or not np.any(errors):
        return 0.0
    pieces = count // _AT_ONCE
    if pieces > 1:
        parts = errors[: pieces * _AT_ONCE].reshape(pieces, _AT_ONCE)
        if (length := _correlation_length(parts)) is not None:
            return count / length
    length = _correlation_length(errors.reshape(1, count))
    return 1.0 if length is None else count / length


def _correlation_length(parts: Floats) -> float | None:
    """How many samples make up for one, from pieces (m, n) of a sequence; None if n is too short to tell."""
    count = parts.shape[1]
    size = 1 << (2 * count - 1).bit_length()
    spectrum = np.fft.rfft(parts, size)
    power = np.sum(spectrum.real * spectrum.real + spectrum.imag * spectrum.imag, axis=0)
    products = np.fft.irfft(power, size)[:count]
    lags = np.arange(count)
    # Of a lag there are n - k products only; what little there is at the far end the window leaves out.
    correlation = products / products[0] * (count / (count - lags))
    squares = np.minimum(correlation * correlation, 1.0) * (1.0 - lags / count)
    lengths = 2.0 * np.cumsum(squares) - 1.0
    enough = np.flatnonzero(lags >= _LONG_ENOUGH * lengths)
    return float(lengths[enough[0]]) if len(enough) else None


def samples_of_runs(means: Floats) -> float:
    """How many independent samples the mean over independent runs counts for, by their means (n,).

    That is by how these scatter. Of few runs it is not known well: as much is taken off as Student's t is
    wider than the normal distribution. 0 for fewer than two runs, or runs that do not differ.
    """
    runs = len(means)
    if runs < 2:
        return 0.0
    mean, scatter = float(means.mean()), float(means.var(ddof=1)) / runs
    if scatter <= 0.0:
        return 0.0
    from scipy.special import stdtrit  # the one who asks has many runs; who judges one can do without

    wider = float(stdtrit(runs - 1, 0.5 + 0.5 * CONFIDENCE)) / _QUANTILE
    return 2.0 * mean * mean / (scatter * wider * wider)


def nees_limits(samples: float) -> tuple[float, float] | None:
    """Limits of the NEES over so many independent samples at :data:`CONFIDENCE`, None for less than one.

    Chi-square quantiles by Wilson and Hilferty (1931), within 5 % from one sample on, and 1 % from three.
    """
    if samples < _FEWEST:
        return None
    spread = 2.0 / (9.0 * samples)
    low, high = (1.0 - spread + sign * _QUANTILE * math.sqrt(spread) for sign in (-1.0, 1.0))
    return max(low, 0.0) ** 3, high**3
