"""How a scenario's estimates are certified: by the frames or sightings that its estimator believed."""

from __future__ import annotations

from dataclasses import dataclass, replace

from estimation.bounds import certified
from estimation.bounds.certified import Certain, Failed
from estimation.bounds.certified_positions import PositionCertifier
from estimation.bounds.certified_sightings import SightingCertifier, SightingErrors, velocity_error
from estimation.bounds.guarantees import leader_acceleration
from estimation.bounds.sample_window import EMPTY_WINDOW, SampleWindow
from estimation.own_motion.odometry_history import History
from formation.pose import Pose
from hil.errors import UsageError
from hil.scenario.noise_bounds import NOISE_SIGMAS, position_bound
from hil.scenario.schema import Scenario


@dataclass(frozen=True, slots=True, eq=False)
class Believed:
    """Measurements of late that the estimator believed: frames and, on the body front end, sightings."""

    frames: SampleWindow = EMPTY_WINDOW
    sightings: SampleWindow = EMPTY_WINDOW


class Certifying:
    """Keeps what was believed and says what that makes certain. Holds no state of its own between calls.

    Raises :class:`UsageError` for a body front end whose sensor and odometry are too coarse to guarantee
    anything that the leader's limits do not.
    """

    def __init__(self, scenario: Scenario) -> None:
        certified.load()
        leader, step = scenario.leader, 1.0 / scenario.mocap.rate_hz
        A, speeds = float(leader_acceleration(leader.k_v, leader.k_u)), (leader.v_eps, leader.k_v)
        self.by_frames = PositionCertifier(position_bound(scenario), A, speeds, step)
        self.by_sightings: SightingCertifier | None = None
        if scenario.estimator.front_end == "body":
            _refuse_coarse(scenario, A)
            rho, v2 = scenario.formation.rho_0, scenario.controller.v_max
            delay = scenario.estimator.input_delay_s
            self.by_sightings = SightingCertifier(_errors(scenario), A, speeds, rho, v2, step, delay)

    def heard_frame(
        self, believed: Believed, capture_ns: int, leader: tuple[float, float], follower: Pose
    ) -> Believed:
        """What is believed with one frame more."""
        frames = self.by_frames.add(believed.frames, capture_ns, leader, (follower.x, follower.y))
        return replace(believed, frames=frames)

    def heard_sighting(self, believed: Believed, capture_ns: int, rho: float, alpha2: float) -> Believed:
        """What is believed with one sighting more, on the body front end."""
        if self.by_sightings is None:
            return believed
        return replace(believed, sightings=self.by_sightings.add(believed.sightings, capture_ns, rho, alpha2))

    def certain(self, believed: Believed, odometry: History, capture_ns: int) -> Certain | Failed:
        """What is certain at the capture time of an estimate, by the newest frame or sighting."""
        if self.by_sightings is not None and believed.sightings.ends_at(capture_ns):
            return self.by_sightings.certain(believed.sightings, odometry, capture_ns)
        return self.by_frames.certain(believed.frames, capture_ns)


def certifying(scenario: Scenario) -> Certifying | None:
    """What certifies a scenario's estimates, None if it does not ask for that; raises as the class does."""
    return Certifying(scenario) if scenario.estimator.certify else None


def _errors(scenario: Scenario) -> SightingErrors:
    given = scenario.estimator
    sigmas = (given.sigma_range, given.sigma_bearing, given.sigma_v2, given.sigma_u2)
    return SightingErrors(*(NOISE_SIGMAS * sigma for sigma in sigmas))


def _refuse_coarse(scenario: Scenario, A: float) -> None:
    given, leader, rho = scenario.estimator, scenario.leader, scenario.formation.rho_0
    instead = 'set it to false, or estimator.front_end to "world" where motion capture shows both robots'
    if given.input_lag_s > 0.0:
        raise UsageError(
            f"estimator.certify: estimator.input_lag_s is {given.input_lag_s:g}, expected 0: commands that "
            f"stand in for odometry tell motion within no bound; {instead}"
        )
    if given.input_time_constant_s > 0.0 or (given.input_scale_v, given.input_scale_u) != (1.0, 1.0):
        raise UsageError(
            f"estimator.certify: estimator.input_time_constant_s is {given.input_time_constant_s:g} and the "
            f"scales {given.input_scale_v:g} and {given.input_scale_u:g}, expected 0, 1 and 1: odometry that "
            f"has to be put right tells motion within no bound; {instead}"
        )
    error = velocity_error(_errors(scenario), A, rho, scenario.controller.v_max)
    if error >= leader.k_v:
        raise UsageError(
            f"estimator.certify: errors of {NOISE_SIGMAS:g} sigma of range, bearing and odometry leave the "
            f"leader's velocity uncertain by {error:.3g} m/s at {rho:g} m, expected less than leader.k_v = "
            f"{leader.k_v:g} m/s, which is known anyway; {instead}"
        )
