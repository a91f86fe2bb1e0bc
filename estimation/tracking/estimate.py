"""The estimate the follower acts on: shape, rates and leader motion, out of a belief in either frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from estimation.filters.belief import Belief
from estimation.models.measurement import Measurement
from estimation.models.motion import Matrix, Vector
from estimation.tracking.screening import NO_DOUBT, Doubt
from estimation.tracking.tracker import Status, TrackPoint
from formation.angles import wrap

QUANTITIES = ("rho_dot", "alpha2_dot", "v1", "alpha1", "u1")


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """What the follower believes at ``capture_ns``, seen from its own body.

    rho [m], alpha2 [rad]; rho_dot [m/s], alpha2_dot [rad/s]; the leader's v1 [m/s], alpha1 [rad] and
    u1 [rad/s]; the follower's v2 [m/s], u2 [rad/s] it rests on.
    covariance: (5, 5) of :data:`QUANTITIES`. nis: of the newest measurement, nan for a first one.
    measured_ns: capture time of the newest measurement that was used.
    doubt: jumps that may be errors of the mocap; they are in the covariance.
    """

    capture_ns: int
    measured_ns: int
    rho: float
    alpha2: float
    rho_dot: float
    alpha2_dot: float
    v1: float
    alpha1: float
    u1: float
    v2: float
    u2: float
    covariance: Matrix
    nis: float
    status: Status
    doubt: Doubt = NO_DOUBT


def estimate_at(point: TrackPoint, status: Status) -> Estimate:
    """Estimate at a point of a track.

    A follower's pose that was not believed gives way to the one that its own motion led to.
    """
    measurement = point.measurement
    if measurement.pose is not None and point.watch is not None:
        measurement = replace(measurement, pose=point.watch.pose)
    return estimate_of(point.belief, measurement, status, point.nis, point.used_ns, point.doubt)


def estimate_of(
    belief: Belief,
    measurement: Measurement,
    status: Status,
    nis: float,
    measured_ns: int,
    doubt: Doubt = NO_DOUBT,
) -> Estimate:
    """Estimate at a measurement's capture time from the belief at that time.

    With e the unit vector to the leader, n its left normal, x the follower's heading and w the leader's
    velocity: rho_dot = e (w - v2 x), alpha2_dot = n (w - v2 x) / rho - u2, v1 = |w|, alpha1 the angle from
    w to -e. Inserted into Eq. (7) these give v1 and alpha1 again, whatever v2 and u2 are.
    """
    mean, covariance = _in_body_frame(belief, measurement)
    if doubt is not NO_DOUBT:
        covariance = _doubted(mean, covariance, doubt)
    px, py, wx, wy, u1 = mean.tolist()
    v2, u2 = measurement.motion.v2, measurement.motion.u2
    rho = math.hypot(px, py)
    ex, ey = (px / rho, py / rho) if rho > 0.0 else (1.0, 0.0)
    safe = max(rho, 1e-9)
    along, across = ex * (wx - v2) + ey * wy, ex * wy - ey * (wx - v2)
    v1 = math.hypot(wx, wy)
    jacobian, inputs = _jacobians((ex, ey), (wx, wy), safe, along, across)
    spread = np.array([measurement.motion.sd_v2, measurement.motion.sd_u2]) * inputs
    full = jacobian @ covariance @ jacobian.T + spread @ spread.T
    return Estimate(
        capture_ns=measurement.capture_ns,
        measured_ns=measured_ns,
        rho=rho,
        alpha2=math.atan2(py, px),
        rho_dot=along,
        alpha2_dot=across / safe - u2,
        v1=v1,
        alpha1=float(wrap(math.atan2(-ey, -ex) - math.atan2(wy, wx))),
        u1=u1,
        v2=v2,
        u2=u2,
        covariance=0.5 * (full + full.T),
        nis=nis,
        status=status,
        doubt=doubt,
    )


def _doubted(mean: Vector, covariance: Matrix, doubt: Doubt) -> Matrix:
    """Covariance with a doubt about the leader's place, in every direction, and about the own heading."""
    px, py, wx, wy, _ = mean.tolist()
    by_heading = np.array([py, -px, wy, -wx, 0.0]) * doubt.heading
    place = np.array([doubt.position**2, doubt.position**2, 0.0, 0.0, 0.0])
    return covariance + by_heading[:, None] * by_heading + np.diag(place)


def _in_body_frame(belief: Belief, measurement: Measurement) -> tuple[Vector, Matrix]:
    """Mean and covariance along the follower's axes; a mocap pose brings its own noise into both."""
    pose, noise = measurement.pose, measurement.pose_noise
    if pose is None or noise is None:
        return belief.mean, belief.covariance
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    rotation = np.array(
        [
            [c, s, 0.0, 0.0, 0.0],
            [-s, c, 0.0, 0.0, 0.0],
            [0.0, 0.0, c, s, 0.0],
            [0.0, 0.0, -s, c, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0],
        ]
    )
    x, y, wx, wy, u1 = belief.mean.tolist()
    dx, dy = x - pose.x, y - pose.y
    mean = np.array([c * dx + s * dy, c * dy - s * dx, c * wx + s * wy, c * wy - s * wx, u1])
    by_heading = np.array([mean[1], -mean[0], mean[3], -mean[2], 0.0]) * noise.heading
    covariance = rotation @ belief.covariance @ rotation.T + by_heading[:, None] * by_heading
    covariance[0, 0] += noise.position**2
    covariance[1, 1] += noise.position**2
    return mean, covariance


def _jacobians(
    e: tuple[float, float], w: tuple[float, float], rho: float, along: float, across: float
) -> tuple[Matrix, Matrix]:
    """Differentiate :data:`QUANTITIES` by the body-frame state (5, 5) and by (v2, u2) (5, 2)."""
    (ex, ey), (wx, wy) = e, w
    nx, ny = -ey, ex
    speed = max(math.hypot(wx, wy), 1e-9)
    jacobian = np.array(
        [
            [nx * across / rho, ny * across / rho, ex, ey, 0.0],
            [
                -(nx * along + ex * across) / rho**2,
                -(ny * along + ey * across) / rho**2,
                nx / rho,
                ny / rho,
                0.0,
            ],
            [0.0, 0.0, wx / speed, wy / speed, 0.0],
            [nx / rho, ny / rho, wy / speed**2, -wx / speed**2, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0],
        ]
    )
    inputs = np.array([[-ex, 0.0], [-nx / rho, -1.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    return jacobian, inputs
