"""Interacting multiple models: a gentle and an agile leader, each with a filter of its own, weighed together.

Blom and Bar-Shalom, IEEE Trans. Automatic Control 33(8), 1988. The leader switches between the modes as a
Markov chain in continuous time; before each prediction the filters exchange what they know, and after each
measurement every mode is weighed by how well it had predicted it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from estimation.filters.belief import Belief, Model, Modes, innovation
from estimation.filters.estimator import Estimator
from estimation.models.coordinated_turn import FollowerMotion
from estimation.models.measurement import Measurement
from estimation.models.motion import Matrix

TURN_BANDWIDTHS = (0.03, 0.5)
"""Turn-rate bandwidth of a gentle and of an agile leader: q_u = bandwidth * k_u^2 per second."""

_LEAST_PROBABILITY = 1e-6  # a mode never dies out, so that it can come back


class InteractingModels(Estimator):
    """One filter for each turn-rate bandwidth; the belief is their mixture, matched in its two moments.

    ``make_filter`` builds the filter of a mode. ``sojourn`` [s]: mean time that a leader stays in a mode.
    The filters' beliefs and the probabilities of the modes travel as :class:`Modes` in the belief.
    """

    def __init__(
        self,
        model: Model,
        make_filter: Callable[[Model], Estimator],
        bandwidths: Sequence[float] = TURN_BANDWIDTHS,
        sojourn: float = 2.0,
    ) -> None:
        self.model = model
        self.sojourn = sojourn
        k_u = model.limits.k_u
        self._filters = [
            make_filter(replace(model, noise=model.noise._replace(q_u=bandwidth * k_u**2)))
            for bandwidth in bandwidths
        ]

    def start(self, measurement: Measurement) -> Belief:
        """Belief from the first measurement alone: all modes are equally likely."""
        count = len(self._filters)
        return mixture([each.start(measurement) for each in self._filters], [1.0 / count] * count)

    def predict(self, belief: Belief, dt: float, follower: FollowerMotion) -> Belief:
        """Belief after dt [s]: the modes mix by the chance to have switched, then each moves by its own."""
        modes = _modes_of(belief)
        switch = self._switching(dt)
        shares = np.array(modes.probabilities)[:, None] * switch
        predicted = shares.sum(axis=0)
        moved = []
        for each, column, total in zip(self._filters, shares.T, predicted, strict=True):
            mixed = mixture(modes.beliefs, (column / total).tolist())
            moved.append(each.predict(Belief(mixed.mean, mixed.covariance), dt, follower))
        return mixture(moved, predicted.tolist())

    def update(self, belief: Belief, measurement: Measurement) -> Belief:
        """Belief after a measurement: each mode takes it in and is weighed by its likelihood."""
        modes = _modes_of(belief)
        fits = np.array([_log_likelihood(each, measurement) for each in modes.beliefs])
        weights = np.array(modes.probabilities) * np.exp(fits - fits.max())
        weights = np.maximum(weights / weights.sum(), _LEAST_PROBABILITY)
        updated = [
            each.update(known, measurement) for each, known in zip(self._filters, modes.beliefs, strict=True)
        ]
        return mixture(updated, (weights / weights.sum()).tolist())

    def _switching(self, dt: float) -> Matrix:
        """Probabilities (n, n) to be in the mode of the column dt [s] after that of the row."""
        count = len(self._filters)
        if count == 1:
            return np.ones((1, 1))
        away = (1.0 - math.exp(-dt / self.sojourn * count / (count - 1))) / count
        switch = np.full((count, count), away)
        np.fill_diagonal(switch, 1.0 - (count - 1) * away)
        return switch


def mixture(beliefs: Sequence[Belief], probabilities: Sequence[float]) -> Belief:
    """Belief with mean and covariance of the mixture, which keeps its parts as its modes."""
    weights = np.array(probabilities)
    means = np.stack([each.mean for each in beliefs])
    mean = weights @ means
    apart = means - mean
    within = np.einsum("k,kij->ij", weights, np.stack([each.covariance for each in beliefs]))
    covariance = within + (apart.T * weights) @ apart
    modes = Modes(tuple(beliefs), tuple(probabilities))
    return Belief(mean, 0.5 * (covariance + covariance.T), filter_state=modes)


def _modes_of(belief: Belief) -> Modes:
    if not isinstance(belief.filter_state, Modes):
        raise TypeError(f"filter state is {type(belief.filter_state).__name__}, expected Modes")
    return belief.filter_state


def _log_likelihood(belief: Belief, measurement: Measurement) -> float:
    found = innovation(belief, measurement)
    (a, b), (_, d) = found.covariance.tolist()
    return -0.5 * (found.nis + math.log(a * d - b * b))
