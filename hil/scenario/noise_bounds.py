"""Bounds that certificates take for the errors of Gaussian sensors."""

from __future__ import annotations

from hil.scenario.schema import Scenario

NOISE_SIGMAS = 5.0
"""Standard deviations that are taken for the bound of a Gaussian error. A position in the plane leaves the
disc of this radius once in 270,000 frames, more than half an hour at 120 Hz."""


def position_bound(scenario: Scenario) -> float:
    """Bound of the error of a motion capture's position [m], in any direction."""
    return NOISE_SIGMAS * max(scenario.estimator.sigma_position, scenario.mocap.sigma_position)
