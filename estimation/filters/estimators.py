"""The registry of estimators: one name, one way to build each.

EKF, UKF and differences are records that compiled code has by value; all others are written in matrices and
stay plain Python. Their modules are loaded when one is built, since filterpy takes a second to load.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from estimation.filters.belief import Model
from estimation.filters.estimator import Estimator, RecordFilter
from estimation.filters.filter import Filter, Kind, filter_of


def _ekf(model: Model, _cutoff: float) -> Filter:
    return filter_of(Kind.EKF, model)


def _ukf(model: Model, _cutoff: float) -> Filter:
    return filter_of(Kind.UKF, model)


def _ekf_filterpy(model: Model, _cutoff: float) -> Estimator:
    from estimation.filters.kalman import ExtendedFilter

    return ExtendedFilter(model)


def _ukf_filterpy(model: Model, _cutoff: float) -> Estimator:
    from estimation.filters.kalman import UnscentedFilter

    return UnscentedFilter(model)


def _imm(model: Model, _cutoff: float) -> Estimator:
    from estimation.filters.imm import InteractingModels

    return InteractingModels(model, make_filter=RecordFilter)


def _shape_ekf(model: Model, _cutoff: float) -> Estimator:
    from estimation.filters.shape_filter import ShapeFilter

    return ShapeFilter(model)


def _mhe(model: Model, _cutoff: float) -> Estimator:
    from estimation.filters.moving_horizon import MovingHorizon

    return MovingHorizon(model)


def _difference(model: Model, cutoff: float) -> Filter:
    return filter_of(Kind.DIFFERENCE, model, cutoff)


ESTIMATORS: dict[str, Callable[[Model, float], Filter | Estimator]] = {
    "ekf": _ekf,
    "ukf": _ukf,
    "ekf-filterpy": _ekf_filterpy,
    "ukf-filterpy": _ukf_filterpy,
    "imm": _imm,
    "shape-ekf": _shape_ekf,
    "mhe": _mhe,
    "difference": _difference,
}


def make_estimator(name: str, model: Model, cutoff: float = 0.1) -> Filter | Estimator:
    """Build the estimator of a name in :data:`ESTIMATORS`; ``cutoff`` [s] is the low-pass of ``difference``.

    Raises KeyError for an unknown name.
    """
    return ESTIMATORS[name](model, cutoff)


class Settling(NamedTuple):
    """What a tracker's settings of these names are to be: three angles [rad] and a choice."""

    settled_heading: float
    unsettled_heading: float
    followed_turn: float
    capped_speed: bool


def settling(name: str) -> Settling:
    """How well an estimator of this name must know the leader's direction to be trusted with it.

    Up to about 0.4 rad the filters' standard deviations are honest; above, errors of more than a right angle
    are some ten times as frequent, since the model is linearised along the direction. A coarse sensor (25 mm
    at 10 Hz) hardly ever knows a leader at half of its speed limit to 0.25 rad.

    Differences of a mocap heading of 0.2 deg know the direction to half a radian at 0.8 m. Who asks for them
    accepts this, and with it that they may take noise for motion while the leader still stands. So would
    ``shape-ekf`` at 0.35 rad: it cannot hold a speed of zero.
    """
    if name == "difference":
        return Settling(0.6, 1.2, 0.6, capped_speed=False)
    return Settling(0.25 if name == "shape-ekf" else 0.35, 0.6, 0.25, capped_speed=True)
