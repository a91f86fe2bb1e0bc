"""The tracker and the filter that a scenario asks for, and what the filter knows of its sensor."""

from __future__ import annotations

import math

from estimation.filters.belief import Belief, Model
from estimation.filters.estimator import Estimator
from estimation.filters.estimators import make_estimator, settling
from estimation.filters.memory import SensorOffsets
from estimation.models.measurement import FrontEnd
from estimation.models.motion import LeaderLimits, ProcessNoise
from estimation.own_motion.own_track import ODOMETRY_CORRELATION, TRACK_CORRELATION
from estimation.tracking.tracker import Tracker, TrackSettings
from hil.errors import UsageError
from hil.scenario.schema import Scenario


def leader_tracker(scenario: Scenario) -> Tracker:
    """Tracker of a scenario. Raises :class:`UsageError` like :func:`leader_filter`."""
    given = scenario.estimator
    settings = TrackSettings(
        gate_probability=given.gate_probability,
        reacquire_frames=given.reacquire_frames,
        coast_after=given.coast_after_s,
        lost_after=given.lost_after_s,
        window=given.window_s,
        **settling(given.kind)._asdict(),
    )
    return Tracker(leader_filter(scenario), settings)


def leader_filter(scenario: Scenario) -> Estimator:
    """Estimator of a scenario with its noise by rule.

    Raises :class:`UsageError` if it is to have states for the sensor's offsets and cannot.
    """
    given, leader = scenario.estimator, scenario.leader
    limits = LeaderLimits(leader.v_eps, leader.k_v, leader.k_u)
    correlation = ODOMETRY_CORRELATION if given.own_motion == "odometry" else TRACK_CORRELATION
    noise = ProcessNoise.by_rule(limits, given.turn_bandwidth, given.speed_bandwidth)
    model = Model(FrontEnd(given.front_end), limits, noise, input_correlation=correlation)
    if not given.bias_states:
        return make_estimator(given.kind, model, given.difference_cutoff_s)
    refuse_bias_states(scenario)
    from estimation.filters.bias_filter import BiasedExtended

    return BiasedExtended(model, given.sigma_range_bias, given.sigma_bearing_bias)


def refuse_bias_states(scenario: Scenario) -> None:
    """Raise :class:`UsageError` if the scenario asks for states of offsets where there are none."""
    given = scenario.estimator
    if given.bias_states and (given.kind, given.front_end) != ("ekf", "body"):
        raise UsageError(
            f"estimator.bias_states: kind {given.kind!r} on the {given.front_end} front end has none, "
            "expected 'ekf' on the body front end; set it to false, or take the offsets of: abreast calibrate"
        )


def offsets_report(belief: Belief) -> dict[str, object]:
    """Diagnostics of a filter with states for the sensor's offsets; empty for any other."""
    known = belief.memory
    if not isinstance(known, SensorOffsets):
        return {}
    values = (*known.mean.tolist(), math.sqrt(known.covariance[0, 0]), math.sqrt(known.covariance[1, 1]))
    names = ("range_bias", "bearing_bias", "range_bias_sd", "bearing_bias_sd")
    report: dict[str, object] = {name: f"{value:.4f}" for name, value in zip(names, values, strict=True)}
    still = "off: the line of sight does not turn against the leader"
    steady = "off: the follower's velocity does not change against the leader's"
    report["range_bias_state"] = "estimated" if known.range_told else still
    report["bearing_bias_state"] = "estimated" if known.bearing_told else steady
    return report
