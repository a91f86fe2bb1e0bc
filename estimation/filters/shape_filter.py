"""The peer to compare with: an EKF on the shape [rho, alpha1, alpha2, v1, u1], with v2, u2 as inputs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from estimation.filters.belief import Belief, Model
from estimation.filters.estimator import Estimator
from estimation.filters.filter_states import Guess, ShapeState
from estimation.filters.shape_motion import cartesian, drive_through, range_and_bearing
from estimation.models import motion
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import FrontEnd, Measurement
from estimation.models.motion import Matrix, Vector
from formation.angles import wrap
from formation.pose import Pose, advance

_SURE_ENOUGH = 0.35  # sd of the direction [rad] at which a guess can be linearised around
_OLDEST_ANCHOR = 0.5  # seconds after which a guess begins anew: a leader that stood may have set off since
_SEEN = np.eye(5)[[0, 2]]


class ShapeFilter(Estimator):
    """Five-state EKF on Eq. (3) of the paper; range and bearing are measured, in both front ends.

    Its equations divide by rho and know no direction where v1 is zero: it is singular at rho = 0 and v1 = 0,
    and poor near both. So it cannot start from no knowledge. Differences of the first measurements, over as
    long as it takes to tell a direction, give the guess of alpha1 and v1 that it needs; until then, and again
    when it believes the leader slower than v_eps / 2, the belief is that guess.

    The result is a belief in the frame of the front end. In the world frame it carries the noise of the
    follower's pose too, as if this were independent of the shape: the NIS comes out a little low.
    """

    def __init__(self, model: Model) -> None:
        self.model = model

    def start(self, measurement: Measurement) -> Belief:
        """Belief from the first measurement alone, the anchor of the first guess."""
        base = self.model.start(measurement)
        return base._replace(filter_state=Guess(measurement.position, measurement.covariance))

    def predict(self, belief: Belief, dt: float, follower: FollowerMotion) -> Belief:
        """Belief after dt [s], the follower having moved as given."""
        filter_state = belief.filter_state
        if isinstance(filter_state, ShapeState):
            state, covariance = drive_through(
                filter_state.state, filter_state.covariance, dt, follower, self.model
            )
            pose = filter_state.pose
            if pose is not None:
                pose = advance(pose, follower.v2, follower.u2, dt)
            return _reported(replace(filter_state, state=state, covariance=covariance, pose=pose))
        model = self.model
        move = model.transition(belief.mean, dt, follower)
        covariance = move @ belief.covariance @ move.T + model.process_noise(belief.mean, dt, follower)
        mean = model.propagate(belief.mean, dt, follower)
        aged = _aged(_guess_of(belief), dt, follower, model)
        return Belief(mean, 0.5 * (covariance + covariance.T), filter_state=aged)

    def update(self, belief: Belief, measurement: Measurement) -> Belief:
        """Belief after a measurement of the leader's position."""
        if isinstance(belief.filter_state, ShapeState):
            updated = _corrected(belief.filter_state, measurement)
            if updated.state[3] > 0.5 * self.model.limits.v_eps:
                return _reported(updated)
            return self.start(measurement)
        guess = _guess_of(belief)
        if guess.elapsed <= 0.0:
            return belief
        guess = replace(guess, samples=guess.samples + 1)
        found = self._guessed(guess, measurement)
        known = found.speed > 0.5 * self.model.limits.v_eps and found.sd_heading < _SURE_ENOUGH
        if known and guess.samples >= 3:
            return _reported(_shape_of_guess(found, measurement))
        if guess.elapsed > _OLDEST_ANCHOR:
            return found._replace(filter_state=Guess(measurement.position, measurement.covariance))
        return found

    def _guessed(self, guess: Guess, measurement: Measurement) -> Belief:
        """Velocity by the difference to the anchor, weighed against v1 <= k_v."""
        limits, age = self.model.limits, guess.elapsed
        spread = measurement.covariance + guess.covariance + guess.drift**2 * np.eye(2)
        weight = limits.k_v**2 * np.linalg.inv(limits.k_v**2 * np.eye(2) + spread / age**2)
        base = self.model.start(measurement)
        mean, covariance = base.mean, base.covariance
        mean[2:4] = weight @ (measurement.position - guess.anchor) / age
        covariance[2:4, 2:4] = limits.k_v**2 * (np.eye(2) - weight)
        covariance[2:4, 0:2] = weight @ measurement.covariance / age
        covariance[0:2, 2:4] = covariance[2:4, 0:2].T
        return Belief(mean, 0.5 * (covariance + covariance.T), filter_state=guess)


def _guess_of(belief: Belief) -> Guess:
    if not isinstance(belief.filter_state, Guess):
        raise TypeError(f"filter state is {type(belief.filter_state).__name__}, expected Guess or ShapeState")
    return belief.filter_state


def _aged(guess: Guess, dt: float, follower: FollowerMotion, model: Model) -> Guess:
    """Guess after dt [s]: in the body frame the anchor moves as the follower turns and drives away.

    The follower's own errors last for the model's correlation time, so that they add up as squares.
    """
    if model.front_end is FrontEnd.WORLD:
        return replace(guess, elapsed=guess.elapsed + dt)
    standing = np.array([*guess.anchor.tolist(), 0.0, 0.0, 0.0])
    turn = motion.transition_body(standing, dt, follower)[0:2, 0:2]
    reach, strayed = math.hypot(*guess.anchor.tolist()), math.sqrt(2.0 * model.input_correlation * dt)
    return replace(
        guess,
        anchor=motion.propagate_body(standing, dt, follower)[0:2],
        covariance=turn @ guess.covariance @ turn.T,
        elapsed=guess.elapsed + dt,
        drift=math.hypot(guess.drift, strayed * math.hypot(follower.sd_v2, reach * follower.sd_u2)),
    )


def _shape_of_guess(found: Belief, measurement: Measurement) -> ShapeState:
    """Shape state of a guess, its parts taken as independent."""
    seen, noise = range_and_bearing(measurement)
    pose = measurement.pose
    heading = math.atan2(found.mean[3], found.mean[2]) - (pose.theta if pose is not None else 0.0)
    speed, rho, alpha2 = found.speed, float(seen[0]), float(seen[1])
    along = found.mean[2:4] / speed
    across = np.array([-along[1], along[0]])
    velocity = found.covariance[2:4, 2:4]
    sideways = float(across @ velocity @ across) / speed**2 + float(noise[0, 0]) / rho**2
    state = np.array([rho, wrap(alpha2 + math.pi - heading), alpha2, speed, 0.0])
    covariance = np.diag(
        [noise[0, 0], sideways, noise[1, 1], float(along @ velocity @ along), found.covariance[4, 4]]
    )
    return _at(measurement, ShapeState(state, covariance))


def _corrected(filter_state: ShapeState, measurement: Measurement) -> ShapeState:
    """EKF update by range and bearing (Joseph form); a speed below zero is one the other way."""
    seen, noise = range_and_bearing(measurement)
    covariance = filter_state.covariance
    gain = covariance @ _SEEN.T @ np.linalg.inv(_SEEN @ covariance @ _SEEN.T + noise)
    residual = np.array([seen[0] - filter_state.state[0], wrap(float(seen[1] - filter_state.state[2]))])
    rho, alpha1, alpha2, v1, u1 = (filter_state.state + gain @ residual).tolist()
    alpha1 = wrap(alpha1 + math.pi) if v1 < 0.0 else wrap(alpha1)
    rest = np.eye(5) - gain @ _SEEN
    updated = rest @ covariance @ rest.T + gain @ noise @ gain.T
    state = np.array([max(rho, 1e-6), alpha1, wrap(alpha2), abs(v1), u1])
    return _at(measurement, replace(filter_state, state=state, covariance=0.5 * (updated + updated.T)))


def _at(measurement: Measurement, filter_state: ShapeState) -> ShapeState:
    """State with the follower's pose as measured now."""
    noise = measurement.pose_noise
    if measurement.pose is None or noise is None:
        return filter_state
    return replace(
        filter_state, pose=measurement.pose, position_noise=noise.position, heading_noise=noise.heading
    )


def _reported(filter_state: ShapeState) -> Belief:
    """Belief in the frame of the front end."""
    mean, jacobian = cartesian(filter_state.state)
    covariance: Matrix = jacobian @ filter_state.covariance @ jacobian.T
    if filter_state.pose is not None:
        mean, covariance = _in_world(mean, covariance, filter_state, filter_state.pose)
    return Belief(mean, 0.5 * (covariance + covariance.T), filter_state=filter_state)


def _in_world(
    mean: Vector, covariance: Matrix, filter_state: ShapeState, pose: Pose
) -> tuple[Vector, Matrix]:
    cos_t, sin_t = math.cos(pose.theta), math.sin(pose.theta)
    rotation = np.eye(5)
    rotation[0:2, 0:2] = rotation[2:4, 2:4] = [[cos_t, -sin_t], [sin_t, cos_t]]
    px, py, wx, wy, _ = (turned := rotation @ mean).tolist()
    by_heading = np.array([-py, px, -wy, wx, 0.0]) * filter_state.heading_noise
    spread = rotation @ covariance @ rotation.T + np.outer(by_heading, by_heading)
    spread[0, 0] += filter_state.position_noise**2
    spread[1, 1] += filter_state.position_noise**2
    return turned + np.array([pose.x, pose.y, 0.0, 0.0, 0.0]), spread
