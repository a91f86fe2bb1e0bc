"""Leaders that move as the filters' own model says: what estimators are tried on."""

from __future__ import annotations

import numpy as np

from estimation.models.coordinated_turn import ProcessNoise
from estimation.models.motion import Matrix, Vector, process_noise, propagate


def random_leader(
    generator: np.random.Generator, start: Vector, steps: int, dt: float, noise: ProcessNoise
) -> Matrix:
    """States (steps, 5) of :mod:`estimation.models.motion`, dt [s] apart, from ``start`` (5,) on.

    Coordinated turns that are disturbed at every step by the process noise of that moment.
    """
    states = [start]
    for _ in range(steps - 1):
        state = states[-1]
        shock = np.linalg.cholesky(process_noise(state, dt, noise)) @ generator.standard_normal(len(state))
        states.append(propagate(state, dt) + shock)
    return np.array(states)
