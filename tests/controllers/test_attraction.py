from __future__ import annotations

import math

import numpy as np

from controllers.attraction import settling_map
from controllers.laws import Gains
from controllers.limits import Limits
from formation.shape import ABREAST_ALPHA1, ABREAST_ALPHA2
from formation.spacing import Spacing

GAINS = Gains(1.0, 2.0, Spacing(0.5, 2.0))
FREE = Limits(1e9, 1e9)


def test_on_the_manifold_every_start_settles_but_the_saddle() -> None:
    """V1 never rises and its sublevel sets are bounded: only the saddle and what ends in it stays away."""
    rho = 0.5 * np.geomspace(0.25, 4.0, 9)
    alpha1 = np.linspace(-3.1, 3.1, 12)
    found = settling_map(GAINS, FREE, 0.5, rho, alpha1, ABREAST_ALPHA2, 60.0)
    assert found.settled_s.shape == (9, 12)
    assert found.share == 1.0
    saddle = settling_map(GAINS, FREE, 0.5, np.array([0.5]), np.array([0.5 * math.pi]), ABREAST_ALPHA2, 20.0)
    assert saddle.share == 0.0


def test_at_the_station_it_has_settled() -> None:
    at = settling_map(GAINS, FREE, 0.5, np.array([0.5]), np.array([ABREAST_ALPHA1]), ABREAST_ALPHA2, 5.0)
    assert at.settled_s.item() == 0.0


def test_off_the_manifold_robots_collide_unless_limits_hold_the_speed() -> None:
    """A follower that faces away and is told to drive fast meets its leader before it has turned."""
    gains, rho, alpha1 = Gains(1.5, 2.0, Spacing(0.2, 20.0)), np.array([0.05, 0.2]), np.linspace(-3.0, 3.0, 9)
    free = settling_map(gains, FREE, 0.08, rho, alpha1, 2.5, 60.0)
    limited = settling_map(gains, Limits(0.22, 2.84), 0.08, rho, alpha1, 2.5, 60.0)
    assert free.share < 0.9
    assert limited.share == 1.0
