"""What a scenario says of its leader and of how it is estimated: limits, noise, filter, track, own motion."""

from __future__ import annotations

from estimation.consistency.noise_estimate import NoiseLearning
from estimation.consistency.process_estimate import ProcessLearning
from estimation.filters.belief import Model
from estimation.filters.estimator import Estimator
from estimation.filters.estimators import make_estimator, settling
from estimation.filters.filter import Filter
from estimation.filters.lever_arm import Lever, is_centred
from estimation.models.coordinated_turn import LeaderLimits, ProcessNoise
from estimation.models.measurement import FrontEnd, PoseNoise
from estimation.own_motion.odometry_history import InputTrust
from estimation.own_motion.own_track import ODOMETRY_CORRELATION, TRACK_CORRELATION, OwnNoise
from estimation.tracking.track_settings import TrackSettings, gate_of
from formation.mount import Mount
from hil.errors import UsageError
from hil.extensions.estimators import own_estimator
from hil.extensions.reference import is_reference
from hil.scenario.schema import Scenario


def leader_limits(scenario: Scenario) -> LeaderLimits:
    """What is known of the leader."""
    leader = scenario.leader
    return LeaderLimits(leader.v_eps, leader.k_v, leader.k_u)


def process_noise(scenario: Scenario) -> ProcessNoise:
    """Noise of the leader's motion, by rule."""
    given = scenario.estimator
    return ProcessNoise.by_rule(leader_limits(scenario), given.turn_bandwidth, given.speed_bandwidth)


def finds_process_noise(scenario: Scenario) -> bool:
    """Whether process noise is found by what is seen: only the filters that are records take another one."""
    given = scenario.estimator
    return given.process_noise == "estimated" and given.kind in ("ekf", "ukf") and not given.bias_states


def process_learning(scenario: Scenario) -> ProcessLearning:
    """How the leader's process noise is found, if it is."""
    limits = leader_limits(scenario)
    speed, turn = limits.k_v * limits.k_v, limits.k_u * limits.k_u
    return ProcessLearning(finds_process_noise(scenario), process_noise(scenario), speed, turn)


def leader_model(scenario: Scenario) -> Model:
    """How the leader's state moves, in the frame of the scenario's front end."""
    given = scenario.estimator
    correlation = ODOMETRY_CORRELATION if given.own_motion in ("odometry", "auto") else TRACK_CORRELATION
    front_end = FrontEnd(given.front_end)
    return Model(
        front_end, leader_limits(scenario), process_noise(scenario), correlation, leader_lever(scenario)
    )


def leader_filter(scenario: Scenario) -> Filter | Estimator:
    """Estimator of a scenario.

    Raises :class:`UsageError` if it is to have states for the sensor's offsets and cannot, or if one of one's
    own cannot be had.
    """
    given, model = scenario.estimator, leader_model(scenario)
    refuse_bias_states(scenario)
    refuse_leader_lever(scenario)
    if is_reference(given.kind):
        return own_estimator(given.kind, model)
    if not given.bias_states:
        return make_estimator(given.kind, model, given.difference_cutoff_s)
    from estimation.filters.bias_filter import BiasedExtended

    return BiasedExtended(model, given.sigma_range_bias, given.sigma_bearing_bias)


def leader_mount(scenario: Scenario) -> Mount:
    """Where the leader's body sits on it, as far as is known."""
    return Mount(*map(float, scenario.leader.mount))


def follower_mount(scenario: Scenario) -> Mount:
    """Where the follower's body sits on it, as far as is known."""
    return Mount(*map(float, scenario.follower.mount))


def leader_lever(scenario: Scenario) -> Lever:
    """How far the leader's body is off the middle of its wheel axis."""
    mount = leader_mount(scenario)
    return Lever(mount.x, mount.y)


def refuse_leader_lever(scenario: Scenario) -> None:
    """Raise :class:`UsageError` for a leader's body off its wheel axis where the estimator knows none."""
    given, lever = scenario.estimator, leader_lever(scenario)
    if is_centred(lever):
        return
    without = given.kind not in ("ekf", "ukf") or given.bias_states or given.certify
    if without:
        what = "certify" if given.certify else "bias_states" if given.bias_states else f"kind {given.kind!r}"
        raise UsageError(
            f"leader.mount is {list(scenario.leader.mount)}: estimator.{what} knows no body off the wheel "
            "axis, expected kind 'ekf' or 'ukf' alone; choose one, or set x and y of leader.mount to 0"
        )


def refuse_bias_states(scenario: Scenario) -> None:
    """Raise :class:`UsageError` if the scenario asks for states of offsets where there are none."""
    given = scenario.estimator
    if given.bias_states and (given.kind, given.front_end) != ("ekf", "body"):
        raise UsageError(
            f"estimator.bias_states: kind {given.kind!r} on the {given.front_end} front end has none, "
            "expected 'ekf' on the body front end; set it to false, or take the offsets of: abreast calibrate"
        )


def track_settings(scenario: Scenario) -> TrackSettings:
    """When a measurement is believed, and when the estimate."""
    given, settled = scenario.estimator, settling(scenario.estimator.kind)
    if given.settled_heading > 0.0:
        least = float(given.settled_heading)
        settled = settled._replace(settled_heading=least, unsettled_heading=least + 0.25)
    return TrackSettings(
        gate=gate_of(given.gate_probability),
        reacquire_frames=given.reacquire_frames,
        coast_after=float(given.coast_after_s),
        lost_after=float(given.lost_after_s),
        window=float(given.window_s),
        notices_manoeuvres=finds_process_noise(scenario),
        **settled._asdict(),
    )


def pose_noise(scenario: Scenario) -> PoseNoise:
    """Noise of a mocap pose, as the estimator is told."""
    return PoseNoise(float(scenario.estimator.sigma_position), float(scenario.estimator.sigma_heading))


def noise_learning(scenario: Scenario) -> NoiseLearning:
    """Whether the noise of poses is put right by what frames tell of it."""
    given, told = scenario.estimator, pose_noise(scenario)
    # The literal way to compare with takes all as it is told.
    learns = given.noise == "estimated" and given.kind != "difference"
    return NoiseLearning(learns, told, float(scenario.leader.v_eps))


def finds_slip(scenario: Scenario) -> bool:
    """Whether what odometry is worth is found by what is seen from on board; only filters as records can."""
    given = scenario.estimator
    records = given.kind in ("ekf", "ukf") and not given.bias_states
    return given.front_end == "body" and given.noise == "estimated" and records


def own_noise(scenario: Scenario) -> OwnNoise:
    """What is known of the follower by its own mocap track."""
    limits = scenario.controller
    return OwnNoise(pose_noise(scenario), float(limits.v_max), float(limits.u_max))


def input_trust(scenario: Scenario) -> InputTrust:
    """What is known of the follower's odometry."""
    given, limits = scenario.estimator, scenario.controller
    numbers = (
        given.sigma_v2,
        given.sigma_u2,
        given.input_delay_s,
        given.input_lag_s,
        limits.v_max,
        limits.u_max,
        given.slip_v2 if given.front_end == "body" else 0.0,
        given.slip_u2 if given.front_end == "body" else 0.0,
        given.input_time_constant_s,
        given.input_scale_v,
        given.input_scale_u,
    )
    return InputTrust(*map(float, numbers))
