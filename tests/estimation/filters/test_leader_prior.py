from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.filters.gaussian import Gaussian
from estimation.filters.leader_prior import standing_noise, within_limits
from estimation.models.coordinated_turn import LeaderLimits, ProcessNoise

LIMITS = LeaderLimits(0.04, 0.2, 0.6)
NOISE = ProcessNoise.by_rule(LIMITS, 0.5, 0.01)


def belief(vx: float, vy: float, u: float, sd_v: float, sd_u: float) -> Gaussian:
    variances = np.diag([1e-4, 1e-4, sd_v**2, sd_v**2, sd_u**2])
    return Gaussian.of(np.array([1.0, 0.5, vx, vy, u]), variances)


def told_for(b: Gaussian, seconds: float, dt: float = 0.01) -> Gaussian:
    """Nothing is measured, while process noise drives speed and turn rate."""
    for _ in range(round(seconds / dt)):
        b = b._replace(
            vx_vx=b.vx_vx + NOISE.q_v * dt, vy_vy=b.vy_vy + NOISE.q_v * dt, u_u=b.u_u + NOISE.q_u * dt
        )
        b = within_limits(b, dt, NOISE, LIMITS)
    return b


def test_without_measurements_the_turn_rate_comes_to_rest_at_what_the_limits_say() -> None:
    after = told_for(belief(0.1, 0.0, 0.5, 0.01, 0.05), 60.0)
    assert after.u == pytest.approx(0.0, abs=1e-3)
    assert math.sqrt(after.u_u) == pytest.approx(LIMITS.k_u / math.sqrt(3.0), rel=0.02)


def test_without_measurements_the_speed_comes_to_lie_between_its_limits() -> None:
    # Its direction is known: what is uncertain is the speed alone.
    b = belief(0.2, 0.0, 0.0, 0.01, 0.05)._replace(vy_vy=0.0)
    for _ in range(20_000):
        b = within_limits(b._replace(vx_vx=b.vx_vx + NOISE.q_v * 0.01), 0.01, NOISE, LIMITS)
    assert b.vx == pytest.approx(0.5 * (LIMITS.v_eps + LIMITS.k_v), abs=2e-3)
    assert math.sqrt(b.vx_vx) == pytest.approx((LIMITS.k_v - LIMITS.v_eps) / math.sqrt(12.0), rel=0.02)


def test_what_is_known_well_is_left_alone() -> None:
    known = belief(0.15, 0.05, 0.4, 2e-3, 0.02)
    after = within_limits(known, 0.01, NOISE, LIMITS)
    assert after.speed == pytest.approx(known.speed, abs=1e-6)
    assert after.u == pytest.approx(known.u, abs=1e-4)


def test_a_speed_whose_direction_nobody_knows_says_nothing_of_the_velocity() -> None:
    lost = belief(0.05, 0.02, 0.0, 0.2, 0.05)
    after = within_limits(lost, 0.1, NOISE, LIMITS)
    assert (after.vx, after.vy) == (lost.vx, lost.vy)


def test_nobody_stands_who_is_not_known_to() -> None:
    assert standing_noise(belief(0.0, 0.0, 0.0, 1e-4, 0.1), NOISE).q_start == pytest.approx(
        NOISE.q_start, rel=1e-4
    )
    assert standing_noise(belief(0.0, 0.0, 0.0, 0.05, 0.1), NOISE).q_start == 0.0


def test_no_time_changes_nothing() -> None:
    b = belief(0.1, 0.0, 0.5, 0.05, 0.05)
    assert within_limits(b, 0.0, NOISE, LIMITS) == b
