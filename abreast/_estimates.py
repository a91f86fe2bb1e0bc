"""Estimates of a leader as arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation.tracking.estimate import QUANTITIES
from estimation.tracking.tracker import Status
from formation.angles import FloatArray
from hil.replay.pose_tracks import ToldEstimate

MISSING = "missing"
"""Status of a row that has no estimate."""

_SEEN = ("rho", "alpha2", *QUANTITIES)
_BOUNDS = ("bound_v1", "bound_alpha1", "bound_h")
_KNOWN = len(_SEEN) + len(QUANTITIES) + len(_BOUNDS)
_NAMES = {status: status.name.lower() for status in Status}


@dataclass(frozen=True, slots=True, eq=False)
class Estimates:
    """What a follower knows of its leader at n times: arrays of shape (n,), NaN where there is no estimate.

    ``t`` [s]: as given, in runs from when the leader set off. ``rho`` [m]: distance. ``alpha2`` [rad]:
    bearing of the leader from the follower's heading, and ``alpha1`` [rad] that of the follower from the
    leader's, both counter-clockwise in (-pi, pi]. ``rho_dot`` [m/s], ``alpha2_dot`` [rad/s]: rates.
    ``v1`` [m/s], ``u1`` [rad/s]: the leader's speed and turn rate. ``sd_...``: standard deviations.
    ``bound_v1`` [m/s], ``bound_alpha1`` [rad], ``bound_h`` [rad/s]: bounds on the errors of v1, alpha1 and
    the law's h.

    ``status``: texts. ``tracking`` is to be used; ``initialising``: v1 and alpha1 are not yet known well
    enough; ``coasting``: nothing measured for a while; ``rejecting``: the newest measurement did not pass the
    gate; ``lost``: the next measurement starts anew; ``missing``: there is no estimate.
    ``reason``: why it is not tracking, empty if it is.

    >>> import abreast, numpy as np
    >>> t = np.arange(0.0, 2.0, 0.01)
    >>> leader = np.column_stack([0.1 * t, np.full_like(t, 0.25)])
    >>> follower = np.column_stack([0.1 * t, 0.0 * t, 0.0 * t])
    >>> found = abreast.estimate(t, leader, follower)
    >>> good = found.status == "tracking"
    >>> len(found), bool(np.all(abs(found.v1[good] - 0.1) < 3.0 * found.sd_v1[good]))
    (200, True)
    """

    t: FloatArray
    rho: FloatArray
    alpha2: FloatArray
    rho_dot: FloatArray
    alpha2_dot: FloatArray
    v1: FloatArray
    alpha1: FloatArray
    u1: FloatArray
    sd_rho_dot: FloatArray
    sd_alpha2_dot: FloatArray
    sd_v1: FloatArray
    sd_alpha1: FloatArray
    sd_u1: FloatArray
    bound_v1: FloatArray
    bound_alpha1: FloatArray
    bound_h: FloatArray
    status: NDArray[np.str_]
    reason: NDArray[np.str_]

    def __len__(self) -> int:
        """How many rows there are."""
        return len(self.t)

    def as_dict(self) -> dict[str, NDArray[np.generic]]:
        """The arrays by their names, such as a table of pandas is made of."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def estimates_of(
    t: FloatArray, made: Sequence[ToldEstimate | None], reasons: Sequence[str] | None = None
) -> Estimates:
    """Estimates at times (n,) as arrays; ``reasons``: why there is none where there is none."""
    numbers = np.full((len(made), _KNOWN), math.nan)
    for row, estimate in zip(numbers, made, strict=True):
        if estimate is not None:
            row[:] = _numbers(estimate)
    refused = reasons or [""] * len(made)
    statuses = [MISSING if each is None else _NAMES[Status(each.status)] for each in made]
    why = [cause if each is None else each.reason for each, cause in zip(made, refused, strict=True)]
    names = [field.name for field in fields(Estimates)][1:]
    columns: dict[str, Any] = {
        name: np.ascontiguousarray(column) for name, column in zip(names, numbers.T, strict=False)
    }
    return Estimates(
        t=np.array(t, dtype=np.float64),
        status=np.array(statuses, dtype=np.str_),
        reason=np.array(why, dtype=np.str_),
        **columns,
    )


def _numbers(told: ToldEstimate) -> tuple[float, ...]:
    deviations = (math.sqrt(variance) if variance >= 0.0 else math.nan for variance in told.variances)
    return (*told.seen, *deviations, *told.bounds)
