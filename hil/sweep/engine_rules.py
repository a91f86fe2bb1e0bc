"""What is fixed in the runs of a scenario, as the compiled loop takes it, and which scenarios it refuses."""

from __future__ import annotations

import math

import msgspec

from estimation.filters.estimators import settling
from estimation.tracking.tracker import TrackSettings
from hil.errors import UsageError
from hil.lockstep.run import STOPPING_NS
from hil.scenario.leader_model import process_noise
from hil.scenario.parts import foresight
from hil.scenario.schema import ConstantProgram, ImpulseProgram, Scenario, SinusoidProgram
from hil.sweep import engine_kernels as kernels

KINDS = {"ekf": kernels.EKF, "ukf": kernels.UKF, "difference": kernels.DIFFERENCE}
LAWS = {
    "independent": kernels.INDEPENDENT,
    "ideal": kernels.IDEAL,
    "feedforward": kernels.FEEDFORWARD,
    "faded": kernels.FADED,
}
LONGEST_LATENCY = 1.0
"""Seconds of latency that the history of odometry surely covers."""

_KNOWN = {
    "formation": {"rho_0"},
    "controller": {
        *("law", "mu1", "mu2", "mu_rho", "v_max", "u_max", "max_age_s", "lag_s", "transport_s", "tick_hz"),
        *("v_resolution", "u_resolution", "command_type"),
    },
    "robot": {
        *("lag_s", "v_max", "u_max", "v_resolution", "u_resolution"),
        *("odometry_rate_hz", "odometry_sigma_v", "odometry_sigma_u"),
    },
    "mocap": {"rate_hz", "sigma_position", "sigma_heading", "static_fraction", "latency_s", "loss"},
    "estimator": {
        *("kind", "sigma_position", "sigma_heading", "sigma_range", "sigma_bearing", "sigma_v2", "sigma_u2"),
        *("turn_bandwidth", "speed_bandwidth", "gate_probability", "reacquire_frames", "coast_after_s"),
        *("lost_after_s", "window_s", "difference_cutoff_s", "range_bias", "bearing_bias"),
        *("sensor_x", "sensor_y"),
    },
}
"""Keys that the compiled loop knows, or may ignore as they concern no world front end."""

_NS = 1e-9


def refuse_unknown(scenario: Scenario) -> None:
    """Raise :class:`UsageError` for what lockstep runs can do and the compiled loop cannot.

    Keys that it knows nothing of must have their defaults. Frames that keep their order need no ring to
    rewind, so that there is none, and no jitter.
    """
    estimator, law = scenario.estimator.kind, scenario.controller.law
    if estimator not in KINDS:
        raise _unknown(scenario, "estimator.kind", estimator, f"one of {', '.join(KINDS)}")
    if law not in LAWS:
        raise _unknown(scenario, "controller.law", law, f"one of {', '.join(LAWS)}")
    if scenario.mocap.latency_s > LONGEST_LATENCY:
        raise _unknown(scenario, "mocap.latency_s", scenario.mocap.latency_s, f"at most {LONGEST_LATENCY:g}")
    for name, known in _KNOWN.items():
        section: msgspec.Struct = getattr(scenario, name)
        for key in msgspec.structs.fields(section):
            value = getattr(section, key.name)
            if key.name not in known and value != key.default:
                raise _unknown(scenario, f"{name}.{key.name}", value, repr(key.default))


def _unknown(scenario: Scenario, key: str, value: object, expected: str) -> UsageError:
    return UsageError(
        f"scenario {scenario.name}: {key} is {value!r}, but a sweep takes {expected}; "
        "set it so, or use abreast run --lockstep"
    )


def evaluation_ns(scenario: Scenario) -> tuple[int, int]:
    """From when to when a run is judged, counted from the leader's start; as ``hil.judge.evidence``."""
    to_ns = round(scenario.run.duration_s * 1e9)
    from_ns = round(scenario.run.evaluate_from_s * 1e9)
    return (from_ns if from_ns < to_ns else to_ns // 2), to_ns


def rules_of(scenario: Scenario, *, every_estimate: bool) -> dict[str, float]:
    """All that is fixed in a run, by the fields of ``engine_kernels.RULES``.

    ``every_estimate``: as for :class:`hil.sweep.engine.Engine`.
    """
    latency_ns = round(scenario.mocap.latency_s / _NS)
    return {
        "latency_ns": latency_ns,
        "duration_ns": evaluation_ns(scenario)[1],
        "after_ns": STOPPING_NS if every_estimate else min(latency_ns, STOPPING_NS),
        "from_ns": -1 if every_estimate else evaluation_ns(scenario)[0],
        **_lab(scenario),
        **_eye(scenario),
        **_hand(scenario),
    }


def _lab(scenario: Scenario) -> dict[str, float]:
    robot, mocap = scenario.robot, scenario.mocap
    kind, numbers = _program(scenario)
    return {
        "program": kind,
        **{f"p{k}": number for k, number in enumerate(numbers)},
        "lag": robot.lag_s,
        "v_max": robot.v_max,
        "u_max": robot.u_max,
        "v_resolution": robot.v_resolution,
        "u_resolution": robot.u_resolution,
        "sigma_position": mocap.sigma_position,
        "sigma_heading": mocap.sigma_heading,
        "static_fraction": mocap.static_fraction,
        "odometry_sigma_v": robot.odometry_sigma_v,
        "odometry_sigma_u": robot.odometry_sigma_u,
        "loss": mocap.loss,
    }


def _eye(scenario: Scenario) -> dict[str, float]:
    given, leader = scenario.estimator, scenario.leader
    noise = process_noise(scenario)
    return {
        "kind": KINDS[given.kind],
        "reacquire_frames": given.reacquire_frames,
        "q_v": noise.q_v,
        "q_u": noise.q_u,
        "q_start": noise.q_start,
        "v_eps": noise.v_eps,
        "k_v": leader.k_v,
        "k_u": leader.k_u,
        "sd_position": given.sigma_position,
        "sd_heading": given.sigma_heading,
        "sd_v2": given.sigma_v2,
        "sd_u2": given.sigma_u2,
        "gate": -2.0 * math.log1p(-given.gate_probability),
        "coast_after": given.coast_after_s,
        "lost_after": given.lost_after_s,
        **settling(given.kind)._asdict(),
        "doubt_for": TrackSettings().doubt_for,
        "cutoff": given.difference_cutoff_s,
    }


def _hand(scenario: Scenario) -> dict[str, float]:
    given = scenario.controller
    transport_ns = round(given.transport_s / _NS)
    return {
        "law": LAWS[given.law],
        "tick_ns": round(1.0 / given.tick_hz / _NS),
        "transport_ns": transport_ns,
        "ahead_ns": transport_ns + round(given.lag_s / _NS),
        "max_age_ns": round(given.max_age_s / _NS),
        "max_age": given.max_age_s,
        "assumed_lag": given.lag_s,
        "mu1": given.mu1,
        "mu2": given.mu2,
        "mu_rho": given.mu_rho,
        "rho_0": scenario.formation.rho_0,
        "v_limit": given.v_max,
        "u_limit": given.u_max,
        "v_step": given.v_resolution,
        "u_step": given.u_resolution,
        "spread": foresight(scenario).spread,
    }


def _program(scenario: Scenario) -> tuple[int, tuple[float, ...]]:
    """Kind of the leader's program, and the numbers of its formula."""
    given = scenario.leader.program
    if isinstance(given, ConstantProgram):
        return kernels.CONSTANT, (given.v, given.u)
    if isinstance(given, SinusoidProgram):
        return kernels.SINUSOID, (given.v, given.u_mean, given.u_amplitude, given.omega)
    if isinstance(given, ImpulseProgram):
        return kernels.IMPULSE, (given.v, given.u_amplitude, given.t_centre, given.t_width)
    return kernels.TABLE, ()
