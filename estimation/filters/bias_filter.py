"""EKF of the body front end with two more states: the offsets of range and bearing, random constants.

What can be told of them, for a leader that turns steadily. Let a frame ride with the leader, its x axis along
the leader's velocity; the leader is a constant in it.

- A *range* offset b moves the apparent leader by b along the line of sight, which in that frame has the
  direction alpha1. While alpha1 stays, the apparent leader is a fixed point of the frame too: it drives
  another steady turn, and nothing tells the two apart. So b is observable as far as alpha1 changes.
- A *bearing* offset turns all that the follower sees about itself. With R that turn and V the follower's
  velocity, the leader's velocity seems to be R w + (I - R) V. While V is constant in the frame, this is
  a steady turn as well. So the offset is observable as far as the follower's velocity changes, in length or
  in direction, as seen from the leader.

A follower that stands tells nothing of the bearing, a formation that is kept tells nothing of either, and a
leader that stands can be taken for one that drives in a circle. There the offsets are left as they are: they
get no gain (Schmidt's filter, Jazwinski, Stochastic Processes and Filtering Theory, 1970, 8.2), while what
their uncertainty does to the leader's states stays in the covariance. Otherwise the nonlinearity, and leaders
that do not drive quite as the model says, would soon pass for knowledge.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from estimation.filters.belief import Belief, Model
from estimation.filters.estimator import Estimator, MatrixStep
from estimation.filters.filter_states import Excitation, SensorOffsets
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import FrontEnd, Measurement
from estimation.models.motion import STATE_SIZE, Matrix, Vector

_MEMORY = 10.0  # seconds over which the pair must have moved against each other
_CLEAR = 3.0  # how many standard deviations of the leader's direction a change must be worth
_SETTLED = 0.25  # sd [rad] of its direction from which on the leader's frame is known
_ROWS = STATE_SIZE + 2


class BiasedExtended(Estimator):
    """EKF (5 + 2 states) for sightings; ``sd_range`` [m], ``sd_bearing`` [rad]: of the offsets beforehand.

    The belief is that of the leader's states, the offsets travel in its filter state. Raises
    :class:`ValueError` for a model of the world front end, which has no such sensor.
    """

    def __init__(self, model: Model, sd_range: float, sd_bearing: float) -> None:
        if model.front_end is not FrontEnd.BODY:
            raise ValueError(f"front end is {model.front_end.value!r}, expected 'body'")
        self.model = model
        self._prior = np.array([sd_range, sd_bearing]) ** 2

    def start(self, measurement: Measurement) -> Belief:
        """Belief from the first measurement alone, which knows the position up to the offsets."""
        base = self.model.start(measurement)
        _, by_position, by_offset = _predicted(base.mean, np.zeros(2))
        back = -np.linalg.solve(by_position, by_offset)
        covariance = base.covariance.copy()
        covariance[0:2, 0:2] += (back * self._prior) @ back.T
        cross = np.zeros((STATE_SIZE, 2))
        cross[0:2] = back * self._prior
        return Belief(
            base.mean, covariance, filter_state=SensorOffsets(np.zeros(2), np.diag(self._prior), cross)
        )

    def predict(self, belief: Belief, dt: float, follower: FollowerMotion) -> Belief:
        """Belief after dt [s], the follower having moved as given; the offsets stay."""
        offsets, model = offsets_of(belief), self.model
        move = model.transition(belief.mean, dt, follower)
        drive = model.behind(belief).process_noise(belief.mean, dt, follower)
        covariance = move @ belief.covariance @ move.T + drive
        ahead = Belief(model.propagate(belief.mean, dt, follower), 0.5 * (covariance + covariance.T))
        told = model.within_limits(ahead, dt)
        # The limits are told to the leader's states alone, so what they leave of it is that of P' = rest P.
        rest = np.linalg.solve(ahead.covariance, told.covariance).T
        moved = replace(
            offsets,
            cross=rest @ move @ offsets.cross,
            excitation=_aged(offsets.excitation, math.exp(-dt / _MEMORY)),
        )
        return told._replace(filter_state=moved)

    def update(self, belief: Belief, measurement: Measurement) -> Belief:
        """Belief after a measurement (Joseph form); offsets that cannot be told get no gain."""
        return self._taken_in(belief, measurement, math.inf)[0]

    def step(
        self, belief: Belief, dt: float, follower: FollowerMotion, measurement: Measurement, gate: float
    ) -> MatrixStep:
        """As :meth:`Estimator.step`; the NIS knows of the offsets."""
        return MatrixStep(*self._taken_in(self.predict(belief, dt, follower), measurement, gate))

    def _taken_in(self, belief: Belief, measurement: Measurement, gate: float) -> tuple[Belief, float]:
        offsets = offsets_of(belief)
        seen, by_position, by_offset = _predicted(belief.mean, offsets.mean)
        joint = np.block([[belief.covariance, offsets.cross], [offsets.cross.T, offsets.covariance]])
        slope = np.zeros((2, _ROWS))
        slope[:, 0:2], slope[:, STATE_SIZE:] = by_position, by_offset
        residual = measurement.position - seen
        spread = slope @ joint @ slope.T + measurement.covariance
        nis = float(residual @ np.linalg.solve(spread, residual))
        if not nis <= gate:
            return belief, nis
        gain = np.linalg.solve(spread, slope @ joint).T
        gain[STATE_SIZE:][
            [not observable for observable in (offsets.range_observable, offsets.bearing_observable)]
        ] = 0.0
        mean = np.concatenate([belief.mean, offsets.mean]) + gain @ residual
        rest = np.eye(_ROWS) - gain @ slope
        after = rest @ joint @ rest.T + gain @ measurement.covariance @ gain.T
        after = 0.5 * (after + after.T)
        known = SensorOffsets(
            mean[STATE_SIZE:], after[STATE_SIZE:, STATE_SIZE:], after[:STATE_SIZE, STATE_SIZE:]
        )
        updated = Belief(mean[:STATE_SIZE], after[:STATE_SIZE, :STATE_SIZE], filter_state=known)
        excited = _with_moment(offsets.excitation, updated, measurement.motion.v2)
        sure = _CLEAR * excited.sd_direction
        known = replace(
            known,
            excitation=excited,
            range_observable=excited.sight_spread > sure,
            bearing_observable=excited.own_spread > sure,
        )
        return updated._replace(filter_state=known), nis


def offsets_of(belief: Belief) -> SensorOffsets:
    """What a belief of :class:`BiasedExtended` knows of the sensor."""
    if not isinstance(belief.filter_state, SensorOffsets):
        raise TypeError(f"filter state is {type(belief.filter_state).__name__}, expected SensorOffsets")
    return belief.filter_state


def _predicted(mean: Vector, offsets: Vector) -> tuple[Vector, Matrix, Matrix]:
    """Position (2,) that the sensor shows of the leader, its slopes (2, 2) by position and by the offsets."""
    x, y = mean[0:2].tolist()
    rho = max(math.hypot(x, y), 1e-6)
    shown, angle = rho + float(offsets[0]), math.atan2(y, x) + float(offsets[1])
    along, true_along = np.array([math.cos(angle), math.sin(angle)]), np.array([x, y]) / rho
    across, true_across = np.array([-along[1], along[0]]), np.array([-true_along[1], true_along[0]])
    by_position = np.outer(along, true_along) + shown / rho * np.outer(across, true_across)
    return shown * along, by_position, np.column_stack([along, shown * across])


def _aged(excitation: Excitation, share: float) -> Excitation:
    """What has been seen so far, worth that much less."""
    return Excitation(
        share * excitation.weight,
        share * excitation.sight,
        share * excitation.own,
        share * excitation.own_squared,
        share * excitation.direction_variance,
    )


def _with_moment(excitation: Excitation, belief: Belief, v2: float) -> Excitation:
    """Add how the line of sight and the follower's velocity lie in the leader's frame, once it is known.

    Known but for what the offsets do to it: as constants they cannot feign a change.
    """
    offsets = offsets_of(belief)
    by_offsets = offsets.cross @ np.linalg.solve(offsets.covariance, offsets.cross.T)
    sd_heading = belief._replace(covariance=belief.covariance - by_offsets).sd_heading
    if sd_heading > _SETTLED:
        return excitation
    x, y, wx, wy, _ = belief.mean.tolist()
    leader = complex(wx, wy) / math.hypot(wx, wy)
    sight = complex(x, y) / max(math.hypot(x, y), 1e-6) * leader.conjugate()
    return Excitation(
        excitation.weight + 1.0,
        excitation.sight + sight,
        excitation.own + v2 * leader.conjugate(),
        excitation.own_squared + v2 * v2,
        excitation.direction_variance + sd_heading**2,
    )
