"""EKF and UKF on the coordinated-turn model, carried by the compiled kernels."""

from __future__ import annotations

import numpy as np

from estimation.filters import kernels
from estimation.filters.belief import Belief, Model
from estimation.models.measurement import FrontEnd, Measurement
from estimation.models.motion import STATE_SIZE, FollowerMotion

_SQUARE = (STATE_SIZE, STATE_SIZE)
_AT_REST = FollowerMotion(0.0, 0.0, 0.0, 0.0)


class _CompiledFilter:
    """What both filters share. Building one runs its kernels once: no later call waits for a compiler."""

    _predict = staticmethod(kernels.extended_predict)
    _step = staticmethod(kernels.extended_step)

    def __init__(self, model: Model) -> None:
        self.model = model
        noise, correlation = model.noise, model.input_correlation
        self._noise = np.array([noise.q_v, noise.q_u, noise.v_eps, noise.q_start, correlation])
        self._fixed = model.front_end is FrontEnd.WORLD
        seen = Measurement(0, np.ones(2), np.eye(2), FollowerMotion(0.1, 0.1, 0.1, 0.1))
        self.update(self.predict(self.start(seen), 0.01, seen.motion), seen)
        self.step(self.start(seen), 0.01, seen.motion, seen, 0.0)

    def start(self, measurement: Measurement) -> Belief:
        """Belief from the first measurement alone."""
        return self.model.start(measurement)

    def predict(self, belief: Belief, dt: float, follower: FollowerMotion) -> Belief:
        """Belief after dt [s], the follower having moved as given."""
        own = _AT_REST if self._fixed else follower
        before, spread, noise = belief.mean, belief.covariance, self._noise
        mean, covariance = np.empty(STATE_SIZE), np.empty(_SQUARE)
        self._predict(before, spread, dt, own.v2, own.u2, own.sd_v2, own.sd_u2, noise, mean, covariance)
        return Belief(mean, covariance)

    def update(self, belief: Belief, measurement: Measurement) -> Belief:
        """Belief after a measurement of the leader's position (Joseph form)."""
        mean, covariance = np.empty(STATE_SIZE), np.empty(_SQUARE)
        z, spread = measurement.position, measurement.covariance
        kernels.update(belief.mean, belief.covariance, z, spread, mean, covariance)
        return Belief(mean, covariance)

    def step(
        self, belief: Belief, dt: float, follower: FollowerMotion, measurement: Measurement, gate: float
    ) -> tuple[Belief, float]:
        """Prediction, gate and update in one call, as :meth:`estimation.filters.estimator.Estimator.step`."""
        own = _AT_REST if self._fixed else follower
        mean, covariance = np.empty(STATE_SIZE), np.empty(_SQUARE)
        nis = self._step(
            belief.mean,
            belief.covariance,
            dt,
            own.v2,
            own.u2,
            own.sd_v2,
            own.sd_u2,
            self._noise,
            measurement.position,
            measurement.covariance,
            gate,
            mean,
            covariance,
        )
        return Belief._make((mean, covariance, None, 0.0, None)), nis


class CompiledExtended(_CompiledFilter):
    """First-order filter: the covariance moves by the Jacobian of the motion at the mean."""


class CompiledUnscented(_CompiledFilter):
    """Sigma-point filter: ten equally weighted points carry mean and covariance through the exact motion."""

    _predict = staticmethod(kernels.unscented_predict)
    _step = staticmethod(kernels.unscented_step)
