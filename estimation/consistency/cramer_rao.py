"""The posterior Cramer-Rao bound: how well anybody could have estimated the leader on this path.

Coordinated turn with additive Gaussian process noise, observed through the leader's position in the mocap
frame. The information obeys the recursion of Tichavsky, Muravchik and Nehorai (IEEE Trans. Signal Processing
46(5), 1998), which for additive noise reads J' = (Q + F J^-1 F^T)^-1 + H^T R^-1 H with F and Q at the true
state. It is kept here as P = J^-1, which needs neither J nor Q to be inverted: these are the very steps of
the EKF, taken at the truth.

It is a bound for random leaders, pushed about as the process noise says. A leader calmer than that (one that
drives a smooth program, say) can be estimated better than this, so that RMSE / bound may fall below 1 without
anybody having beaten a bound: that of a leader without process noise goes to zero with the length of the run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.consistency.information import Least, Terms
from estimation.filters.belief import Model
from estimation.models.measurement import FrontEnd, PoseNoise
from estimation.models.motion import STATE_SIZE, Matrix, Vector
from estimation.tracking.estimate import QUANTITIES
from formation.records import Rows, columns_of, load, row_of, rows_of

_NS = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class TruePath:
    """What really happened at n capture times, in the mocap frame.

    capture_ns: (n,) int64, not decreasing. leader: (n, 5), states of :mod:`estimation.models.motion`.
    follower_pose: (n, 3), x [m], y [m], theta [rad]. follower_motion: (n, 2), v2 [m/s], u2 [rad/s].
    measured: (n,) bool, False where the leader's position of that moment never arrived.
    Raises :class:`ValueError` for other shapes and for times that run backwards.
    """

    capture_ns: NDArray[np.int64]
    leader: Matrix
    follower_pose: Matrix
    follower_motion: Matrix
    measured: NDArray[np.bool_]

    def __post_init__(self) -> None:
        n = len(self.capture_ns)
        for name, columns in (("leader", STATE_SIZE), ("follower_pose", 3), ("follower_motion", 2)):
            shape = getattr(self, name).shape
            if shape != (n, columns):
                raise ValueError(f"{name} has shape {shape}, expected ({n}, {columns})")
        if self.measured.shape != (n,):
            raise ValueError(f"measured has shape {self.measured.shape}, expected ({n},)")
        if np.any(np.diff(self.capture_ns) < 0):
            raise ValueError("capture_ns runs backwards, expected times that do not decrease")


def state_bound(path: TruePath, model: Model, sigma_position: float) -> NDArray[np.float64]:
    """Bound (n, 5, 5) of the covariance of the leader's state after each capture time.

    Each measurement has covariance sigma_position^2 I [m^2]; before the first there is no bound (NaN).
    Raises :class:`ValueError` for a model of another front end than the world's.
    """
    wanted = np.ones(len(path.capture_ns), dtype=np.bool_)
    found = _bounds(path, model, PoseNoise(sigma_position, 0.0), (0.0, 0.0), wanted)
    bounds = np.full((len(wanted), STATE_SIZE, STATE_SIZE), math.nan)
    rows = columns_of(found)
    for k in np.flatnonzero(rows["known"]):
        bounds[k] = load(Least, found, int(k)).state.covariance
    return bounds


def cramer_rao(
    path: TruePath,
    model: Model,
    pose_noise: PoseNoise,
    sd_v2: float,
    sd_u2: float,
    wanted: NDArray[np.bool_] | None = None,
) -> dict[str, Vector]:
    """Least standard deviation of :data:`estimation.tracking.estimate.QUANTITIES` at ``wanted`` captures.

    rho_dot and alpha2_dot [m/s, rad/s] also carry the noise of the follower's pose and of its measured motion
    (sd_v2 [m/s], sd_u2 [rad/s]), alpha1 [rad] that of its position: the bound is for estimators that take the
    follower's pose and motion as measured at that moment, unfiltered. Angles are mapped to first order, so
    that a bound of more than about 0.5 rad only says that nothing is known yet. For the RMS over many paths,
    average the squares. Infinite before the first measurement. ``wanted``: (n,) bool, None for all.
    """
    asked = np.ones(len(path.capture_ns), dtype=np.bool_) if wanted is None else wanted
    rows = columns_of(_bounds(path, model, pose_noise, (sd_v2, sd_u2), asked))
    return {name: np.sqrt(rows[name]) for name in QUANTITIES}


def _bounds(
    path: TruePath,
    model: Model,
    pose_noise: PoseNoise,
    sd_motion: tuple[float, float],
    wanted: NDArray[np.bool_],
) -> Rows[Least]:
    from estimation.consistency.entries import carry_bounds  # compiles, which most who judge do without

    if model.front_end is not FrontEnd.WORLD:
        raise ValueError(f"front end is {model.front_end.value!r}, expected 'world'")
    bounds = rows_of(Least, int(np.count_nonzero(wanted)))
    terms = Terms(model.limits, model.noise, pose_noise, *sd_motion)
    if len(path.capture_ns):
        states = (path.leader, path.follower_pose, path.follower_motion)
        leader, pose, motion = (np.ascontiguousarray(each, dtype=np.float64) for each in states)
        carry_bounds(
            np.ascontiguousarray(path.capture_ns, dtype=np.int64), leader, pose, motion,
            np.ascontiguousarray(path.measured), np.ascontiguousarray(wanted), row_of(terms), bounds,
        )  # fmt: skip
    return bounds
