"""The registry of estimators: one name, one way to build each."""

from __future__ import annotations

from collections.abc import Callable

from estimation.belief import Model
from estimation.difference import DifferenceEstimator
from estimation.imm import InteractingModels
from estimation.kalman import ExtendedFilter, UnscentedFilter
from estimation.shape_filter import ShapeFilter
from estimation.tracking import Estimator

ESTIMATORS: dict[str, Callable[[Model, float], Estimator]] = {
    "ekf": lambda model, cutoff: ExtendedFilter(model),
    "ukf": lambda model, cutoff: UnscentedFilter(model),
    "imm": lambda model, cutoff: InteractingModels(model, ExtendedFilter),
    "shape-ekf": lambda model, cutoff: ShapeFilter(model),
    "difference": DifferenceEstimator,
}


def make_estimator(name: str, model: Model, cutoff: float = 0.1) -> Estimator:
    """Build the estimator of a name in :data:`ESTIMATORS`; ``cutoff`` [s] is the low-pass of ``difference``.

    Raises KeyError for an unknown name.
    """
    return ESTIMATORS[name](model, cutoff)


def settling(name: str) -> tuple[float, float]:
    """Standard deviations of the leader's direction [rad] below which a track settles and above which not.

    Differences of a mocap heading of 0.2 deg know the direction to half a radian at 0.8 m. Who asks for them
    accepts this, and with it that they may take noise for motion while the leader still stands.
    """
    return (0.6, 1.2) if name == "difference" else (0.25, 0.6)
