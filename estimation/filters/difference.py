"""The paper's literal estimator: difference range and bearing, smooth, then Eq. (7). Kept to compare with."""

from __future__ import annotations

import math

import numpy as np

from estimation.filters.belief import Belief, Model, Rates
from estimation.filters.estimator import Estimator
from estimation.models.measurement import FrontEnd, Measurement
from estimation.models.motion import FollowerMotion, Matrix, Vector
from formation.angles import wrap
from formation.pose import Motion
from formation.shape import leader_velocity, polar_velocity


class DifferenceEstimator(Estimator):
    """Rates by differences through a first-order low-pass of time constant ``cutoff`` [s].

    rho_dot and alpha2_dot give X and Y of the paper, these give w; u1 is the low-passed turn of w. The
    covariance is that of white measurement noise through the same low-pass, of the follower's own motion as
    measured, and of the lag behind a leader that turns at k_u.
    """

    def __init__(self, model: Model, cutoff: float) -> None:
        self.model = model
        self.cutoff = cutoff

    def start(self, measurement: Measurement) -> Belief:
        """Belief from the first measurement alone: no rates yet."""
        base = self.model.start(measurement)
        rho, alpha2 = _range_and_bearing(measurement)
        return Belief(base.mean, base.covariance, Rates(rho, alpha2, 0.0, 0.0, 0.0, 0))

    def predict(self, belief: Belief, dt: float, follower: FollowerMotion) -> Belief:
        """Belief after dt [s]: the position moves with the velocity estimated last; the rates stay."""
        mean = self.model.propagate(belief.mean, dt, follower)
        transition = self.model.transition(belief.mean, dt, follower)
        noise = self.model.process_noise(belief.mean, dt, follower)
        covariance = transition @ belief.covariance @ transition.T + noise
        return Belief(mean, 0.5 * (covariance + covariance.T), belief.rates, belief.elapsed + dt)

    def update(self, belief: Belief, measurement: Measurement) -> Belief:
        """Belief after a measurement: difference it against the last one and smooth."""
        last, dt = belief.rates, belief.elapsed
        if last is None or dt <= 0.0:
            return belief
        rho, alpha2 = _range_and_bearing(measurement)
        gain = max(dt / (self.cutoff + dt), 1.0 / (last.samples + 1))
        rho_dot = last.rho_dot + gain * ((rho - last.rho) / dt - last.rho_dot)
        alpha2_dot = last.alpha2_dot + gain * (float(wrap(alpha2 - last.alpha2)) / dt - last.alpha2_dot)
        own = Motion(measurement.motion.v2, measurement.motion.u2)
        v1, alpha1 = polar_velocity(*leader_velocity(rho, alpha2, rho_dot, alpha2_dot, own))
        sight = alpha2 + (measurement.pose.theta if measurement.pose is not None else 0.0)
        heading = sight + math.pi - alpha1
        turn = float(wrap(heading - last.heading)) / dt
        if self.model.front_end is FrontEnd.BODY:
            turn += own.u
        u1 = float(belief.mean[4]) + gain * (turn - float(belief.mean[4])) if last.samples else 0.0
        mean = np.array([*measurement.position, v1 * math.cos(heading), v1 * math.sin(heading), u1])
        rates = Rates(rho, alpha2, rho_dot, alpha2_dot, heading, last.samples + 1)
        return Belief(mean, self._covariance(measurement, gain, dt, v1), rates)

    def _covariance(self, measurement: Measurement, gain: float, dt: float, v1: float) -> Matrix:
        """Covariance (5, 5) of the state right after an update of the given gain.

        A smoothed difference of white noise has the variance sigma^2 (gain/dt)^2 2/(2 - gain). The motion of
        the follower enters unsmoothed: v2 ahead of it, rho u2 across the line of sight.
        """
        smoothed = (gain / dt) ** 2 * 2.0 / (2.0 - gain)
        limits, motion = self.model.limits, measurement.motion
        ahead, across = _axes(measurement)
        lag = self.cutoff * limits.k_u * max(v1, limits.v_eps)
        velocity = smoothed * _relative_covariance(measurement, across) + lag**2 * np.eye(2)
        velocity += motion.sd_v2**2 * np.outer(ahead, ahead) + motion.sd_u2**2 * np.outer(across, across)
        covariance = np.zeros((5, 5))
        covariance[0:2, 0:2] = measurement.covariance
        # The newest position is one end of the newest difference.
        covariance[0:2, 2:4] = covariance[2:4, 0:2] = gain / dt * measurement.covariance
        covariance[2:4, 2:4] = velocity
        sideways = float(np.trace(velocity)) / 2.0 / max(v1, limits.v_eps) ** 2
        covariance[4, 4] = min(sideways * smoothed, limits.k_u**2)
        return covariance


def _axes(measurement: Measurement) -> tuple[Vector, Vector]:
    """Heading of the follower, and the left normal of the line to the leader times its length rho."""
    pose = measurement.pose
    if pose is None:
        x, y = measurement.position.tolist()
        return np.array([1.0, 0.0]), np.array([-y, x])
    dx, dy = (measurement.position - [pose.x, pose.y]).tolist()
    return np.array([math.cos(pose.theta), math.sin(pose.theta)]), np.array([-dy, dx])


def _relative_covariance(measurement: Measurement, across: Vector) -> Matrix:
    """Covariance (2, 2) of the leader's position as the follower sees it; a mocap pose adds its noise."""
    noise = measurement.pose_noise
    if noise is None:
        return measurement.covariance
    turned: Matrix = noise.heading**2 * np.outer(across, across)
    return measurement.covariance + noise.position**2 * np.eye(2) + turned


def _range_and_bearing(measurement: Measurement) -> tuple[float, float]:
    """Range [m] and bearing [rad] of the leader seen from the follower."""
    x, y = measurement.position.tolist()
    if measurement.pose is None:
        return math.hypot(x, y), math.atan2(y, x)
    dx, dy = x - measurement.pose.x, y - measurement.pose.y
    return math.hypot(dx, dy), float(wrap(math.atan2(dy, dx) - measurement.pose.theta))
