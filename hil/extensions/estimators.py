"""Estimators of one's own, by reference."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation.filters.belief import Belief, Model
from estimation.filters.estimator import Estimator, MatrixStep
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import Measurement
from hil.errors import CheckFailedError, UsageError
from hil.extensions.reference import found, loaded, short, told

GROUP = "abreast.estimators"
"""Entry points by which packages bring estimators."""
NOUN = "estimator.kind"

_STATES = 5
_NEEDED = ("start", "predict", "update", "step")


class NamedEstimator(Estimator):
    """An estimator of one's own, whose failures bear its name: they raise :class:`CheckFailedError`.

    That is what it raises itself, and a belief that is not one of the model's state in finite numbers.
    """

    def __init__(self, estimator: Estimator, model: Model, name: str) -> None:
        self.model = model
        self._estimator, self._name = estimator, name

    def start(self, measurement: Measurement) -> Belief:
        """Belief from the first measurement alone."""
        return self._sound(self._done(self._estimator.start, measurement))

    def predict(self, belief: Belief, dt: float, follower: FollowerMotion) -> Belief:
        """Belief after dt [s], the follower having moved as given."""
        return self._sound(self._done(self._estimator.predict, belief, dt, follower))

    def update(self, belief: Belief, measurement: Measurement) -> Belief:
        """Belief after a measurement at the belief's time."""
        return self._sound(self._done(self._estimator.update, belief, measurement))

    def step(
        self, belief: Belief, dt: float, follower: FollowerMotion, measurement: Measurement, gate: float
    ) -> MatrixStep:
        """Belief after dt [s] and a measurement at the end of it, and the NIS of this measurement."""
        stepped = self._done(self._estimator.step, belief, dt, follower, measurement, gate)
        try:
            after, nis = stepped
            return MatrixStep(self._sound(after), float(nis))
        except (TypeError, ValueError):
            raise self._failed(f"step gave {stepped!r}, expected a belief and a NIS") from None

    def _done(self, step: Callable[..., Any], *given: Any) -> Any:
        try:
            return step(*given)
        except (Exception, SystemExit) as error:  # whatever somebody's estimator may raise
            name = getattr(step, "__name__", type(step).__name__)
            raise self._failed(f"{name} raised {told(error)}") from error

    def _sound(self, belief: Any) -> Belief:
        if not isinstance(belief, Belief):
            raise self._failed(f"it gave {type(belief).__name__}, expected a Belief")
        mean = self._kept(belief.mean, "mean", (_STATES,))
        covariance = self._kept(belief.covariance, "covariance", (_STATES, _STATES))
        if not (np.all(np.isfinite(mean)) and np.all(np.isfinite(covariance))):
            raise self._failed(f"its belief is not finite: mean {mean.tolist()}")
        return belief._replace(mean=mean, covariance=covariance)

    def _kept(self, given: Any, name: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """Numbers of a belief for good: who keeps or gets them cannot change what is gone back to."""
        try:
            numbers = np.array(given, dtype=np.float64)
        except (TypeError, ValueError):
            raise self._failed(f"its {name} is {given!r}, expected numbers") from None
        if numbers.shape != shape:
            raise self._failed(f"its {name} has shape {numbers.shape}, expected {shape}")
        numbers.flags.writeable = False
        return numbers

    def _failed(self, why: str) -> CheckFailedError:
        return CheckFailedError(f"estimator {self._name} failed: {why}")


def own_estimator(text: str, model: Model) -> Estimator:
    """Estimator that the factory of a settled reference makes of a model.

    Raises :class:`UsageError` as :func:`hil.extensions.reference.found` and
    :func:`~hil.extensions.reference.loaded`, or if the factory makes none.
    """
    factory = loaded(found(text, NOUN))
    try:
        made = factory(model)
    except (Exception, SystemExit) as error:  # whatever somebody's factory may raise
        raise UsageError(f"{NOUN} {text}: its factory failed ({told(error)}); correct it") from None
    missing = [name for name in _NEEDED if not callable(getattr(made, name, None))]
    if missing:
        raise UsageError(
            f"{NOUN} {text}: its factory gave {type(made).__name__}, which lacks {', '.join(missing)}; "
            "derive it from abreast.Estimator"
        )
    return NamedEstimator(made, model, short(text))
