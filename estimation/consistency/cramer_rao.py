"""The posterior Cramer-Rao bound: how well anybody could have estimated the leader on this path.

Coordinated turn with additive Gaussian process noise, observed through the leader's position in the mocap
frame. The information obeys the recursion of Tichavsky, Muravchik and Nehorai (IEEE Trans. Signal Processing
46(5), 1998), which for additive noise reads J' = (Q + F J^-1 F^T)^-1 + H^T R^-1 H with F and Q at the true
state. It is kept here as P = J^-1, which needs neither J nor Q to be inverted.

It bounds estimators that believe in the same process noise. A leader calmer than its noise (one that drives a
smooth program, say) can be estimated better than this on average, so that RMSE / bound may fall below 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.filters.belief import Model
from estimation.filters.gaussian import Gaussian
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import FrontEnd, Measurement, PoseNoise, measure_world
from estimation.models.motion import STATE_SIZE, Matrix, Vector
from estimation.tracking.estimate import QUANTITIES, estimate_of
from estimation.tracking.track_point import NO_JUMP
from estimation.tracking.tracker import Status
from formation.pose import Pose

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

    Each measurement has covariance sigma_position^2 I [m^2]. The recursion starts as the filters do, at the
    first measurement with what ``model`` knows in advance; before it there is no bound (NaN). Raises
    :class:`ValueError` for a model of another front end than the world's.
    """
    if model.front_end is not FrontEnd.WORLD:
        raise ValueError(f"front end is {model.front_end.value!r}, expected 'world'")
    still = FollowerMotion(0.0, 0.0, 0.0, 0.0)
    noise = sigma_position**2 * np.eye(2)
    bounds = np.full((len(path.capture_ns), STATE_SIZE, STATE_SIZE), math.nan)
    covariance: Matrix | None = None
    for k, (now_ns, mean, measured) in enumerate(
        zip(path.capture_ns, path.leader, path.measured, strict=True)
    ):
        if covariance is not None:
            dt = float(now_ns - path.capture_ns[k - 1]) * _NS
            before = path.leader[k - 1]
            move = model.transition(before, dt, still)
            covariance = move @ covariance @ move.T + model.process_noise(before, dt, still)
            if measured:
                covariance = _informed(covariance, noise)
        elif measured:
            covariance = model.start(Measurement.at(int(now_ns), mean[0:2], noise, still)).covariance
        if covariance is not None:
            bounds[k] = covariance
    return bounds


def cramer_rao(
    path: TruePath,
    model: Model,
    pose_noise: PoseNoise,
    sd_v2: float,
    sd_u2: float,
    wanted: NDArray[np.bool_] | None = None,
) -> dict[str, Vector]:
    """Least standard deviation, each (n,), of :data:`estimation.tracking.estimate.QUANTITIES` over the path.

    rho_dot and alpha2_dot [m/s, rad/s] also carry the noise of the follower's pose and of its measured motion
    (sd_v2 [m/s], sd_u2 [rad/s]), alpha1 [rad] that of its position: the bound is for estimators that take the
    follower's pose and motion as measured at that moment, unfiltered. Angles are mapped to first order, so
    that a bound of more than about 0.5 rad only says that nothing is known yet. For the RMS over many paths,
    average the squares. Infinite before the first measurement, and in rows that are not ``wanted`` (None: all
    are), for which the mapping is left out.
    """
    states = state_bound(path, model, pose_noise.position)
    deviations = np.full((len(states), len(QUANTITIES)), math.inf)
    known = np.isfinite(states[:, 0, 0])
    for k in np.flatnonzero(known if wanted is None else known & wanted):
        mean = path.leader[k]
        v2, u2 = path.follower_motion[k].tolist()
        motion, pose = FollowerMotion(v2, u2, sd_v2, sd_u2), Pose(*path.follower_pose[k].tolist())
        x, y = mean[0:2].tolist()
        here = measure_world(int(path.capture_ns[k]), (x, y), pose, pose_noise, motion)
        belief = Gaussian.of(mean, states[k])
        mapped = estimate_of(belief, here, Status.TRACKING, math.nan, here.capture_ns, NO_JUMP)
        deviations[k] = np.sqrt(np.diag(mapped.covariance))
    return {name: deviations[:, column] for column, name in enumerate(QUANTITIES)}


def _informed(covariance: Matrix, noise: Matrix) -> Matrix:
    """(P^-1 + H^T R^-1 H)^-1 for H that picks the position, by the Joseph form."""
    gain = covariance[:, 0:2] @ np.linalg.inv(covariance[0:2, 0:2] + noise)
    rest = np.eye(STATE_SIZE)
    rest[:, 0:2] -= gain
    updated: Matrix = rest @ covariance @ rest.T + gain @ noise @ gain.T
    return updated
