"""Covariance of a least-squares fit whose residuals may be alike for a while, as those by slip are."""

from __future__ import annotations

import numpy as np

from estimation.models.motion import Matrix, Vector
from formation.angles import FloatArray

FEWEST_BLOCKS = 8
"""Blocks there are at least."""

_ALIKE = 1e-12  # share of its own information that one must tell apart from others; sums round to some 1e-14


def sandwich(
    information: Matrix, pulls: Matrix, times: Vector, block: float, each: int = 1
) -> FloatArray | None:
    """Covariances (2, p, p) of p parameters: by independent errors, and by the sums over blocks (Huber).

    ``information`` (p, p): curvature of half the loss. ``pulls`` (c n, p): slope of half the loss by each of
    the n residuals of c channels at ``times`` (n,) [s], channel after channel. ``block`` [s]: errors less far
    apart may be alike. ``each``: of so many residuals that overlap only one counts. None where the parameters
    are not determined.
    """
    if not _is_determined(information):
        return None
    inverse = np.linalg.inv(information)
    span = times[-1] - times[0]
    count = max(FEWEST_BLOCKS, int(span / block))
    places = np.minimum((times - times[0]) / span * count, count - 1).astype(np.int64)
    sums = np.zeros((count, pulls.shape[1]))
    np.add.at(sums, np.tile(places, len(pulls) // len(times)), pulls)
    meat = np.stack([each * pulls.T @ pulls, sums.T @ sums * count / (count - 1)])
    covariance: FloatArray = inverse @ meat @ inverse
    return covariance if np.all(np.isfinite(covariance)) else None


def _is_determined(information: Matrix) -> bool:
    """Whether the parameters are told apart, in whatever units they are.

    Of a matrix that is singular up to rounding an inverse may be found, and variances below zero by that.
    """
    own = np.diag(information)
    if not np.all(np.isfinite(information)) or not np.all(own > 0.0):
        return False
    unit = np.sqrt(own)
    rank = np.linalg.matrix_rank(information / np.outer(unit, unit), tol=_ALIKE, hermitian=True)
    return bool(rank == len(own))
