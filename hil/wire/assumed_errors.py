"""Error bounds that estimates go out with: what the scenario's assumptions give."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.bounds.error_bounds import InputErrors, Perceived, RateErrors
from estimation.bounds.guarantees import guaranteed_rate, guaranteed_window, leader_acceleration
from estimation.bounds.live_bounds import ErrorBounds, LawConstants, Moment, MomentBounds, bounds_at
from estimation.bounds.window_velocity import WindowVelocity
from estimation.bounds.world_bounds import PositionBounds, position_errors, world_bounds_at
from estimation.models.coordinated_turn import FollowerMotion
from estimation.own_motion.steady_noise import steady_noise
from estimation.tracking.estimate import Estimate
from formation.angles import FloatArray
from formation.kernel import kernel
from formation.spacing import Spacing
from hil.scenario.leader_model import own_noise
from hil.scenario.parts import station
from hil.scenario.schema import Scenario

_SIGMAS = 3.0


class AssumedErrors(NamedTuple):
    """Error bounds taken for granted where the truth is not known: three standard deviations of each input.

    ``rate`` [m/s] is the guaranteed error of the leader's velocity by noise and acceleration bounds.
    ``positions``: of the mocap frame; ``in_world``: whether the leader is tracked there, so that v1 and
    alpha1 rest on these alone.
    """

    rate: float
    sd_range: float
    sd_bearing: float
    bearing_grows: bool
    E_v2: float
    E_u2: float
    law: LawConstants
    in_world: bool
    positions: PositionBounds

    @staticmethod
    def of(scenario: Scenario) -> AssumedErrors:
        """Assumptions that follow from a scenario's noise and leader limits."""
        given, leader = scenario.estimator, scenario.leader
        mocap = given.front_end == "world"
        sd_range = math.sqrt(2.0) * given.sigma_position if mocap else given.sigma_range
        sd_bearing = given.sigma_heading if mocap else given.sigma_bearing
        sd_v2, sd_u2 = _own_motion_noise(scenario)
        acceleration = float(leader_acceleration(leader.k_v, leader.k_u))
        return AssumedErrors(
            rate=float(guaranteed_rate(_SIGMAS * sd_range, acceleration)),
            sd_range=sd_range,
            sd_bearing=sd_bearing,
            bearing_grows=mocap,
            E_v2=_SIGMAS * sd_v2,
            E_u2=_SIGMAS * sd_u2,
            law=LawConstants.of(
                leader.v_eps,
                scenario.controller.mu1,
                Spacing(scenario.formation.rho_0, scenario.controller.mu_rho),
                station(scenario),
            ),
            in_world=mocap,
            positions=position_bounds(scenario),
        )

    @kernel
    def errors(self, rho: float) -> ErrorBounds:
        """Bounds on the errors of rates and inputs at a distance rho [m] > 0."""
        sd_bearing, across = self.sd_bearing, self.sd_range / rho
        if self.bearing_grows:
            sd_bearing = math.sqrt(across * across + sd_bearing * sd_bearing)
        return ErrorBounds(
            self.rate + self.E_v2,
            self.rate / rho + self.E_u2,
            _SIGMAS * self.sd_range,
            _SIGMAS * sd_bearing,
            self.E_v2,
            self.E_u2,
        )

    def bearing_errors(self, rho: FloatArray) -> FloatArray:
        """E_alpha2 of :meth:`errors` at many distances."""
        if not self.bearing_grows:
            return np.full(len(rho), _SIGMAS * self.sd_bearing)
        across = self.sd_range / rho
        return _SIGMAS * np.sqrt(across * across + self.sd_bearing * self.sd_bearing)

    def at(self, rho: float) -> tuple[RateErrors, InputErrors]:
        """The same as :meth:`errors`, for the bounds on arrays."""
        errors = self.errors(rho)
        inputs = InputErrors(errors.E_rho, errors.E_alpha2, errors.E_v2, errors.E_u2)
        return RateErrors(errors.M_rho, errors.M_alpha2), inputs


def position_bounds(scenario: Scenario) -> PositionBounds:
    """What a scenario lets assume of positions: three standard deviations on each axis, the leader's limits.

    In the direction in which both axes err that is a root of two more.
    """
    eps, leader = math.sqrt(2.0) * _SIGMAS * scenario.estimator.sigma_position, scenario.leader
    acceleration = float(leader_acceleration(leader.k_v, leader.k_u))
    return PositionBounds(
        leader=eps,
        follower=eps,
        acceleration=acceleration,
        k_v=leader.k_v,
        longest=float(guaranteed_window(eps, acceleration)),
    )


def _own_motion_noise(scenario: Scenario) -> tuple[float, float]:
    """Standard deviations of v2 [m/s] and u2 [rad/s], by where the estimator has them from."""
    given = scenario.estimator
    if given.own_motion in ("odometry", "auto"):
        return given.sigma_v2, given.sigma_u2
    odometry = (
        FollowerMotion(0.0, 0.0, given.sigma_v2, given.sigma_u2) if given.own_motion == "fused" else None
    )
    return steady_noise(own_noise(scenario), 1.0 / scenario.mocap.rate_hz, odometry)


def perceived(estimate: Estimate) -> Perceived:
    """What the bounds need of an estimate."""
    return Perceived(
        rho=estimate.rho,
        alpha2=estimate.alpha2,
        rho_dot=estimate.rho_dot,
        alpha2_dot=estimate.alpha2_dot,
        v1=estimate.v1,
        alpha1=estimate.alpha1,
        v2=estimate.v2,
        u2=estimate.u2,
    )


@kernel
def bounds_of(estimate: Estimate, assumed: AssumedErrors, window: WindowVelocity) -> MomentBounds:
    """Bounds of v1 [m/s], alpha1 [rad] and h [rad/s] of an estimate, its jump included.

    In the mocap frame by the positions of the window behind it, else in the extended form.
    """
    seen = Moment(
        estimate.rho,
        estimate.alpha2,
        estimate.alpha2_dot,
        estimate.v1,
        estimate.alpha1,
        estimate.v2,
        estimate.u2,
    )
    if assumed.in_world:
        found = position_errors(seen, window, assumed.positions)
        if estimate.jump.since_ns != 0:
            aside = estimate.jump.position / window.span if window.jumped else 0.0
            found = found._replace(
                speed=found.speed + aside,
                velocity=found.velocity + aside,
                line=found.line + estimate.jump.position,
            )
        return world_bounds_at(seen, found, assumed.law)
    rho = max(estimate.rho, 1e-6)
    errors = assumed.errors(rho)
    if estimate.jump.since_ns != 0:
        errors = _with_jump(errors, estimate, rho)
    return bounds_at(seen, errors, assumed.law)


@kernel
def _with_jump(errors: ErrorBounds, estimate: Estimate, rho: float) -> ErrorBounds:
    """Errors that allow for a jump too.

    It moves the leader by up to ``position`` and turns the line to it by up to position / rho, and the
    relative velocity, at most v1 + |v2|, is split along and across that line.
    """
    turned = estimate.jump.position / rho
    rate = (estimate.v1 + abs(estimate.v2)) * (turned + estimate.jump.heading)
    return ErrorBounds(
        errors.M_rho + rate,
        errors.M_alpha2 + rate / rho,
        errors.E_rho + estimate.jump.position,
        errors.E_alpha2 + turned + estimate.jump.heading,
        errors.E_v2,
        errors.E_u2,
    )
