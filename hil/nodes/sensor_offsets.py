"""What a filter with states for its sensor's offsets has found out, for diagnostics."""

from __future__ import annotations

import math

from estimation.filters.estimator import whole_of
from estimation.filters.filter_states import SensorOffsets
from estimation.filters.gaussian import Gaussian


def offsets_report(belief: Gaussian) -> dict[str, object]:
    """Diagnostics of a filter with states for the sensor's offsets; empty for any other."""
    known = whole_of(belief).filter_state
    if not isinstance(known, SensorOffsets):
        return {}
    values = (*known.mean.tolist(), math.sqrt(known.covariance[0, 0]), math.sqrt(known.covariance[1, 1]))
    names = ("range_bias", "bearing_bias", "range_bias_sd", "bearing_bias_sd")
    report: dict[str, object] = {name: f"{value:.4f}" for name, value in zip(names, values, strict=True)}
    still = "off: the line of sight does not turn against the leader"
    steady = "off: the follower's velocity does not change against the leader's"
    report["range_bias_state"] = "estimated" if known.range_observable else still
    report["bearing_bias_state"] = "estimated" if known.bearing_observable else steady
    return report
