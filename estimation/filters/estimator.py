"""What every estimator offers to those who fold measurements into beliefs."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

from estimation.filters.belief import Belief, Model, innovation
from estimation.filters.filter import Kind, Stepped, filter_of
from estimation.filters.gaussian import Gaussian
from estimation.filters.leader_prior import SpeedTold
from estimation.models.coordinated_turn import FollowerMotion, LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, Measurement


class MatrixStep(NamedTuple):
    """Belief in matrices after a step, and the NIS of its measurement."""

    belief: Belief
    nis: float


class Estimator(Protocol):
    """A recursive estimator in matrices: pure, its whole state is the belief.

    Those that derive from it have ``step`` out of their ``predict`` and ``update``.

    >>> import abreast, numpy as np
    >>> class Plain(abreast.Estimator):
    ...     def __init__(self, model):
    ...         self.model = model
    ...     def start(self, measurement):
    ...         return self.model.start(measurement)
    ...     def predict(self, belief, dt, follower):
    ...         F = self.model.transition(belief.mean, dt, follower)
    ...         Q = self.model.process_noise(belief.mean, dt, follower)
    ...         mean = self.model.propagate(belief.mean, dt, follower)
    ...         return belief._replace(mean=mean, covariance=F @ belief.covariance @ F.T + Q)
    ...     def update(self, belief, measurement):
    ...         P = belief.covariance
    ...         K = P[:, :2] @ np.linalg.inv(P[:2, :2] + measurement.covariance)
    ...         mean = belief.mean + K @ (measurement.position - belief.mean[:2])
    ...         return belief._replace(mean=mean, covariance=P - K @ P[:2])
    >>> t = np.arange(0.0, 2.0, 0.01)
    >>> leader = np.column_stack([0.1 * t, np.full_like(t, 0.25)])
    >>> follower = np.column_stack([0.1 * t, 0.0 * t, 0.0 * t])
    >>> found = abreast.estimate(t, leader, follower, estimator=Plain)
    >>> print(f"{found.v1[-1]:.3f} m/s")
    0.100 m/s
    """

    model: Model

    def start(self, measurement: Measurement) -> Belief:
        """Belief from the first measurement alone."""

    def predict(self, belief: Belief, dt: float, follower: FollowerMotion) -> Belief:
        """Belief after dt [s], the follower having moved as given."""

    def update(self, belief: Belief, measurement: Measurement) -> Belief:
        """Belief after a measurement at the belief's time."""

    def step(
        self, belief: Belief, dt: float, follower: FollowerMotion, measurement: Measurement, gate: float
    ) -> MatrixStep:
        """Belief after dt [s] and a measurement at the end of it, and the NIS of this measurement.

        One whose NIS is above ``gate`` is left out: the belief is then the prediction.
        """
        prior = self.predict(belief, dt, follower)
        nis = innovation(prior, measurement).nis
        return MatrixStep(self.update(prior, measurement) if nis <= gate else prior, nis)


class RecordFilter(Estimator):
    """The EKF in the place of an estimator in matrices, for those that are made of several."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self._filter = filter_of(Kind.EKF, model)

    def start(self, measurement: Measurement) -> Belief:
        """Belief from the first measurement alone."""
        return whole_of(self._filter.start(measurement))

    def predict(self, belief: Belief, dt: float, follower: FollowerMotion) -> Belief:
        """Belief after dt [s], the follower having moved as given."""
        return whole_of(self._filter.predict(belief.gaussian, dt, follower))

    def update(self, belief: Belief, measurement: Measurement) -> Belief:
        """Belief after a measurement at the belief's time."""
        return whole_of(self._filter.update(belief.gaussian, measurement))


class Remembering(Gaussian):
    """Mean and covariance as the loop has them, with the whole belief that they are of."""

    whole: Belief


class Interpreted:
    """An estimator in matrices in the place of a :class:`~estimation.filters.filter.Filter`.

    The functions of the loop take it as they are, in plain Python.
    """

    def __init__(self, estimator: Estimator) -> None:
        self.estimator = estimator
        self.limits: LeaderLimits = estimator.model.limits
        self.in_world = estimator.model.front_end is FrontEnd.WORLD
        self.noise: ProcessNoise = estimator.model.noise

    def driven_by(self, noise: ProcessNoise) -> Interpreted:
        """Itself: what drives the leader is part of its model."""
        return self

    @property
    def model(self) -> Model:
        """Model of the estimator."""
        return self.estimator.model

    def start(self, measurement: Measurement) -> Gaussian:
        """See :meth:`Estimator.start`."""
        return _remembering(self.estimator.start(measurement))

    def begun_moving(self, measurement: Measurement, ahead: Gaussian, dt: float) -> Gaussian:
        """As :meth:`start`; see :meth:`~estimation.filters.filter.Filter.begun_moving`."""
        return self.start(measurement)

    def predict(self, belief: Gaussian, dt: float, follower: FollowerMotion) -> Gaussian:
        """See :meth:`Estimator.predict`."""
        return _remembering(self.estimator.predict(whole_of(belief), dt, follower))

    def update(self, belief: Gaussian, measurement: Measurement) -> Gaussian:
        """See :meth:`Estimator.update`."""
        return _remembering(self.estimator.update(whole_of(belief), measurement))

    def widened(self, belief: Gaussian, by: float) -> Gaussian:
        """Itself; see :meth:`~estimation.filters.filter.Filter.widened`."""
        return belief

    def leader(self, belief: Gaussian, measurement: Measurement) -> Gaussian:
        """See :meth:`~estimation.filters.filter.Filter.leader`; no lever arm is known of here."""
        return belief

    def told_speed(self, belief: Gaussian) -> SpeedTold:
        """Itself; see :meth:`~estimation.filters.filter.Filter.told_speed`."""
        return SpeedTold(belief, 0.0)

    def step(
        self, belief: Gaussian, dt: float, follower: FollowerMotion, measurement: Measurement, gate: float
    ) -> Stepped:
        """See :meth:`Estimator.step`."""
        stepped = self.estimator.step(whole_of(belief), dt, follower, measurement, gate)
        return Stepped(_remembering(stepped.belief), stepped.nis)


def whole_of(belief: Any) -> Belief:
    """The belief in matrices behind a record, with its filter state if it has one."""
    if isinstance(belief, Remembering):
        return belief.whole
    return Belief(belief.mean, belief.covariance)


def _remembering(belief: Belief) -> Remembering:
    record = Remembering(*belief.gaussian)
    record.whole = belief
    return record
