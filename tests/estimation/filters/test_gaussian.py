from __future__ import annotations

import numpy as np
import pytest

from estimation.filters.gaussian import Gaussian, widened
from estimation.models.coordinated_turn import LeaderLimits

LIMITS = LeaderLimits(0.04, 0.2, 0.7)


def belief(seed: int, size: float) -> Gaussian:
    root = size * np.random.default_rng(seed).standard_normal((5, 5))
    return Gaussian.of(np.arange(5.0), root @ root.T)


@pytest.mark.parametrize("seed", range(3))
def test_a_wider_belief_has_the_same_mean_and_all_covariances_larger_alike(seed: int) -> None:
    before = belief(seed, 1e-3)
    after = widened(before, 9.0, LIMITS)
    assert after.mean.tolist() == before.mean.tolist()
    assert after.covariance == pytest.approx(9.0 * before.covariance)


def test_it_is_no_wider_than_the_limits_and_never_narrower() -> None:
    before = belief(1, 1e-2)
    most = widened(before, 1e9, LIMITS).covariance
    assert max(
        most[2, 2] / LIMITS.k_v**2, most[3, 3] / LIMITS.k_v**2, most[4, 4] / LIMITS.k_u**2
    ) == pytest.approx(1.0)
    wide = belief(2, 10.0)
    assert widened(wide, 4.0, LIMITS) == wide
    assert widened(before, 0.5, LIMITS) == before
