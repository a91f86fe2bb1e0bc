"""Covariance of a least-squares fit whose residuals may be alike for a while, as those by slip are."""

from __future__ import annotations

import numpy as np

from estimation.models.motion import Matrix, Vector
from formation.angles import FloatArray

FEWEST_BLOCKS = 8
"""Blocks there are at least."""


def sandwich(
    information: Matrix, pulls: Matrix, times: Vector, block: float, each: int = 1
) -> FloatArray | None:
    """Covariances (2, p, p) of p parameters: by independent errors, and by the sums over blocks (Huber).

    ``information`` (p, p): curvature of half the loss. ``pulls`` (c n, p): slope of half the loss by each of
    the n residuals of c channels at ``times`` (n,) [s], channel after channel. ``block`` [s]: errors less far
    apart may be alike. ``each``: of so many residuals
    that overlap only one counts. None where the parameters are not determined.
    """
    try:
        inverse = np.linalg.inv(information)
    except np.linalg.LinAlgError:
        return None
    span = times[-1] - times[0]
    count = max(FEWEST_BLOCKS, int(span / block))
    places = np.minimum((times - times[0]) / span * count, count - 1).astype(np.int64)
    sums = np.zeros((count, pulls.shape[1]))
    np.add.at(sums, np.tile(places, len(pulls) // len(times)), pulls)
    meat = np.stack([each * pulls.T @ pulls, sums.T @ sums * count / (count - 1)])
    covariance: FloatArray = inverse @ meat @ inverse
    return covariance if np.all(np.isfinite(covariance)) else None
