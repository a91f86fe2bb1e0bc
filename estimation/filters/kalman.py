"""EKF and UKF on the coordinated-turn model, carried by filterpy."""

from __future__ import annotations

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

from estimation.filters.belief import Belief, Model
from estimation.filters.estimator import Estimator
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import Measurement
from estimation.models.motion import STATE_SIZE, Matrix, Vector

_POSITION = np.eye(2, STATE_SIZE)


class _Carrier(ExtendedKalmanFilter):  # type: ignore[misc]
    """filterpy's EKF with the exact nonlinear motion of the mean in place of F x."""

    moved: Vector

    def predict_x(self, u: float = 0.0) -> None:
        self.x = self.moved


class ExtendedFilter(Estimator):
    """First-order filter: the covariance moves by the Jacobian of the motion at the mean."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self._carrier = _Carrier(dim_x=STATE_SIZE, dim_z=2)

    def start(self, measurement: Measurement) -> Belief:
        """Belief from the first measurement alone."""
        return self.model.start(measurement)

    def predict(self, belief: Belief, dt: float, follower: FollowerMotion) -> Belief:
        """Belief after dt [s], the follower having moved as given."""
        carrier = self._carrier
        carrier.x, carrier.P = belief.mean, belief.covariance
        carrier.moved = self.model.propagate(belief.mean, dt, follower)
        carrier.F = self.model.transition(belief.mean, dt, follower)
        carrier.Q = self.model.behind(belief).process_noise(belief.mean, dt, follower)
        carrier.predict()
        return self.model.within_limits(Belief(carrier.x, _symmetric(carrier.P)), dt)

    def update(self, belief: Belief, measurement: Measurement) -> Belief:
        """Belief after a measurement of the leader's position (Joseph form)."""
        carrier = self._carrier
        carrier.x, carrier.P = belief.mean, belief.covariance
        carrier.update(measurement.position, _position_jacobian, _position_of, R=measurement.covariance)
        return Belief(carrier.x, _symmetric(carrier.P))


class UnscentedFilter(Estimator):
    """Sigma-point filter: ten points carry mean and covariance through the exact motion.

    With alpha = 1, beta = 0, kappa = 0 the centre has no weight and the others are equal: the cubature rule,
    whose covariance is a sum of squares and so never loses its positive definiteness.
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        points = MerweScaledSigmaPoints(STATE_SIZE, alpha=1.0, beta=0.0, kappa=0.0)
        self._carrier = UnscentedKalmanFilter(
            dim_x=STATE_SIZE, dim_z=2, dt=0.0, hx=_position_of, fx=model.propagate, points=points
        )

    def start(self, measurement: Measurement) -> Belief:
        """Belief from the first measurement alone."""
        return self.model.start(measurement)

    def predict(self, belief: Belief, dt: float, follower: FollowerMotion) -> Belief:
        """Belief after dt [s], the follower having moved as given."""
        carrier = self._carrier
        carrier.x, carrier.P = belief.mean, belief.covariance
        carrier.Q = self.model.behind(belief).process_noise(belief.mean, dt, follower)
        carrier.predict(dt=dt, follower=follower)
        return self.model.within_limits(Belief(carrier.x, _symmetric(carrier.P)), dt)

    def update(self, belief: Belief, measurement: Measurement) -> Belief:
        """Belief after a measurement of the leader's position."""
        carrier = self._carrier
        carrier.x, carrier.P = belief.mean, belief.covariance
        carrier.sigmas_f = carrier.points_fn.sigma_points(belief.mean, belief.covariance)
        carrier.update(measurement.position, R=measurement.covariance)
        # The measurement is linear, so the Joseph form is the same covariance as filterpy's P - K S K', and
        # unlike that difference it cannot lose its positive definiteness.
        rest = np.eye(STATE_SIZE) - carrier.K @ _POSITION
        covariance = rest @ belief.covariance @ rest.T + carrier.K @ measurement.covariance @ carrier.K.T
        return Belief(carrier.x, _symmetric(covariance))


def _position_jacobian(_mean: Vector) -> Matrix:
    return _POSITION


def _position_of(mean: Vector) -> Vector:
    return mean[0:2]


def _symmetric(covariance: Matrix) -> Matrix:
    symmetric: Matrix = 0.5 * (covariance + covariance.T)
    return symmetric
