"""Moving-horizon estimation: a least-squares fit of the leader's motion to the last measurements.

Rao, Rawlings and Mayne, IEEE Trans. Automatic Control 48(2), 2003: what came before the window enters as the
arrival cost, measurements and process noise are weighed by their covariances, and Gauss-Newton steps solve
for all states of the window. Each step is a linear least-squares problem whose structure is a chain, so that
a Kalman filter forward and a smoother backward solve it exactly; the next step linearises where they came
out. With one step for each new measurement every state is still linearised anew as long as it is in the
window (the real-time iteration of Diehl and others, J. Process Control 12(4), 2002).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from estimation.filters.belief import Belief, Model
from estimation.filters.estimator import Estimator
from estimation.filters.filter_states import Horizon, Stage
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import Measurement
from estimation.models.motion import STATE_SIZE, Matrix, Vector

_AT_ONCE = FollowerMotion(0.0, 0.0, 0.0, 0.0)
_NO_DRIVE = np.zeros((STATE_SIZE, STATE_SIZE))


class MovingHorizon(Estimator):
    """Gauss-Newton over the last ``window`` measurements, ``iterations`` steps for each new one.

    When the window is full its oldest measurement is absorbed by the arrival cost, linearised where the
    whole window puts it: at no other place is anything that lies in the window fixed.
    """

    def __init__(self, model: Model, window: int = 12, iterations: int = 1) -> None:
        self.model = model
        self.window = window
        self.iterations = iterations

    def start(self, measurement: Measurement) -> Belief:
        """Belief from the first measurement alone, which is the arrival cost of the first window."""
        base = self.model.start(measurement)
        stage = Stage(0.0, _AT_ONCE, _NO_DRIVE, base.mean)
        return base._replace(filter_state=Horizon(base.mean, base.covariance, (stage,)))

    def predict(self, belief: Belief, dt: float, follower: FollowerMotion) -> Belief:
        """Belief after dt [s], the follower having moved as given."""
        model = self.model
        mean = model.propagate(belief.mean, dt, follower)
        move = model.transition(belief.mean, dt, follower)
        drive = model.behind(belief).process_noise(belief.mean, dt, follower)
        covariance = move @ belief.covariance @ move.T + drive
        told = model.within_limits(Belief(mean, 0.5 * (covariance + covariance.T)), dt)
        stage = Stage(dt, follower, drive, told.mean)
        horizon = _horizon_of(belief)
        grown = replace(horizon, stages=(*horizon.stages, stage))
        return told._replace(filter_state=grown)

    def update(self, belief: Belief, measurement: Measurement) -> Belief:
        """Belief after a measurement: the last state of the window fitted anew."""
        horizon = _horizon_of(belief)
        newest = replace(horizon.stages[-1], seen=measurement.position, noise=measurement.covariance)
        horizon = replace(horizon, stages=(*horizon.stages[:-1], newest))
        covariance = belief.covariance
        for _ in range(self.iterations):
            states, covariance = self._solved(horizon)
            moved = (replace(stage, state=state) for stage, state in zip(horizon.stages, states, strict=True))
            horizon = replace(horizon, stages=tuple(moved))
        while len(horizon.stages) > self.window:
            horizon = self._without_oldest(horizon)
        return Belief(horizon.stages[-1].state, covariance, filter_state=horizon)

    def _solved(self, horizon: Horizon) -> tuple[list[Vector], Matrix]:
        """States of the window (n of (5,)) by one Gauss-Newton step, and the last one's covariance (5, 5)."""
        mean, covariance = _seen(horizon.stages[0], horizon.mean, horizon.covariance)
        known, predicted, spreads, shared = [mean], [], [], []
        for before, stage in pairwise(horizon.stages):
            ahead, spread, cross = self._moved(before, stage, mean, covariance)
            mean, covariance = _seen(stage, *self._told(stage, ahead, spread))
            known.append(mean)
            predicted.append(ahead)
            spreads.append(spread)
            shared.append(cross)
        states = [mean]
        if shared:
            gains = np.linalg.solve(np.stack(spreads), np.stack(shared)).transpose(0, 2, 1)
            for k in range(len(gains) - 1, -1, -1):
                states.append(known[k] + gains[k] @ (states[-1] - predicted[k]))
        return states[::-1], covariance

    def _without_oldest(self, horizon: Horizon) -> Horizon:
        """Window without its oldest moment, which the arrival cost absorbs."""
        oldest, second = horizon.stages[0:2]
        mean, covariance = _seen(oldest, horizon.mean, horizon.covariance)
        mean, covariance, _ = self._moved(oldest, second, mean, covariance)
        mean, covariance = self._told(second, mean, 0.5 * (covariance + covariance.T))
        return Horizon(mean, covariance, horizon.stages[1:])

    def _told(self, stage: Stage, mean: Vector, covariance: Matrix) -> tuple[Vector, Matrix]:
        """Mean and covariance at a stage with what the leader's limits say of the time since the last one.

        It is told like a measurement, by where the pass is: for the smoother it comes after the motion.
        """
        told = self.model.within_limits(Belief(mean, covariance), stage.dt)
        return told.mean, told.covariance

    def _moved(
        self, before: Stage, stage: Stage, mean: Vector, covariance: Matrix
    ) -> tuple[Vector, Matrix, Matrix]:
        """Mean and covariance carried to a stage, and F P, all linearised at the state before it."""
        move = self.model.transition(before.state, stage.dt, stage.follower)
        ahead = self.model.propagate(before.state, stage.dt, stage.follower) + move @ (mean - before.state)
        cross = move @ covariance
        return ahead, cross @ move.T + stage.drive, cross


def _seen(stage: Stage, mean: Vector, covariance: Matrix) -> tuple[Vector, Matrix]:
    """Take in the stage's measurement, if it has one (Joseph form)."""
    if stage.seen is None or stage.noise is None:
        return mean, covariance
    (a, b), (_, d) = (covariance[0:2, 0:2] + stage.noise).tolist()
    gain = covariance[:, 0:2] @ (np.array([[d, -b], [-b, a]]) / (a * d - b * b))
    rest = np.eye(STATE_SIZE)
    rest[:, 0:2] -= gain
    updated = rest @ covariance @ rest.T + gain @ stage.noise @ gain.T
    return mean + gain @ (stage.seen - mean[0:2]), 0.5 * (updated + updated.T)


def _horizon_of(belief: Belief) -> Horizon:
    if not isinstance(belief.filter_state, Horizon):
        raise TypeError(f"filter state is {type(belief.filter_state).__name__}, expected Horizon")
    return belief.filter_state
