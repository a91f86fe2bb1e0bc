"""The filters' step as compiled code, for who works from Python."""

from __future__ import annotations

from estimation.filters.filter import Filter
from estimation.filters.gaussian import Gaussian
from estimation.models.measurement import Measurement
from formation.kernel import entry
from formation.records import Rows, load, store


@entry
def step(
    beliefs: Rows[Gaussian], measurements: Rows[Measurement], filters: Rows[Filter], dt: float, gate: float
) -> float:
    """Move the belief in the first row through dt [s] and take in the first measurement; return its NIS.

    The follower moves as the measurement says. See :meth:`estimation.filters.filter.Filter.step`.
    """
    measurement = load(Measurement, measurements, 0)
    belief, estimator = load(Gaussian, beliefs, 0), load(Filter, filters, 0)
    stepped = estimator.step(belief, dt, measurement.motion, measurement, gate)
    store(beliefs, 0, stepped.belief)
    return stepped.nis
