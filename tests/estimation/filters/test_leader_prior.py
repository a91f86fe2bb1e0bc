from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.filters.gaussian import Gaussian
from estimation.filters.leader_prior import standing_noise, usual_speed, within_limits
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


def test_a_leader_that_seems_too_fast_comes_to_lie_between_its_limits() -> None:
    after = told_for(belief(0.5, 0.0, 0.0, 0.1, 0.05), 10.0)
    assert 0.1 < after.speed < LIMITS.k_v
    assert math.sqrt(after.vx_vx) < 0.1


def test_no_speed_is_told_to_one_that_seems_slow() -> None:
    """It would hold a velocity that points the wrong way there."""
    slow = belief(0.08, 0.0, 0.0, 0.02, 0.05)
    after = within_limits(slow, 0.1, NOISE, LIMITS)
    assert (after.vx, after.vx_vx) == (slow.vx, slow.vx_vx)


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


@pytest.mark.parametrize("speed", [0.02, 0.08, 0.15, 0.4])
@pytest.mark.parametrize("sd", [0.002, 0.03, 0.2])
def test_a_speed_is_told_with_those_that_leaders_have(speed: float, sd: float) -> None:
    """Bayes' rule by sums over a grid: speed zero, or a normal distribution of the limits' moments."""
    seen = belief(0.6 * speed, 0.8 * speed, 0.1, sd, 0.05)
    middle, known = 0.5 * (LIMITS.k_v + LIMITS.v_eps), (LIMITS.k_v - LIMITS.v_eps) / math.sqrt(12.0)
    speeds = np.linspace(-2.0, 2.0, 400_001)
    stands, drives = LIMITS.v_eps, LIMITS.k_v
    # As often as makes the mean that of all speeds from zero on.
    assert drives / (stands + drives) * middle == pytest.approx(0.5 * LIMITS.k_v)
    prior = drives * np.exp(-0.5 * ((speeds - middle) / known) ** 2)
    prior *= (speeds[1] - speeds[0]) / (known * math.sqrt(2.0 * math.pi))
    prior[len(speeds) // 2] += stands
    weights = prior * np.exp(-0.5 * ((speeds - speed) / sd) ** 2)
    share = 1.0 - np.sum(np.delete(weights, len(speeds) // 2)) / np.sum(weights)
    mean = np.sum(weights * speeds) / np.sum(weights)
    told, standing = usual_speed(seen, LIMITS)
    assert standing == pytest.approx(share, rel=1e-2, abs=1e-12)
    assert told.speed == pytest.approx(mean, rel=1e-4)
    along = 0.36 * told.vx_vx + 0.96 * told.vx_vy + 0.64 * told.vy_vy
    assert along == pytest.approx(np.sum(weights * (speeds - mean) ** 2) / np.sum(weights), rel=1e-3)
    assert math.atan2(told.vy, told.vx) == pytest.approx(math.atan2(0.8, 0.6), rel=1e-9)
    across = 0.64 * told.vx_vx - 0.96 * told.vx_vy + 0.36 * told.vy_vy
    assert across == pytest.approx(sd**2, rel=1e-9)
    assert np.all(np.linalg.eigvalsh(told.covariance) > -1e-12)


def test_who_is_seen_to_drive_does_not_stand() -> None:
    driving = belief(0.15, 0.0, 0.1, 0.005, 0.05)
    told, standing = usual_speed(driving, LIMITS)
    assert standing == 0.0
    assert told.speed == pytest.approx(0.15, rel=0.02)


def test_who_seems_to_stand_still_has_no_direction_to_be_told_a_speed_along() -> None:
    still = belief(0.0, 0.0, 0.1, 0.01, 0.05)
    assert usual_speed(still, LIMITS) == (still, 0.0)


def test_a_leader_of_one_speed_alone_is_left_alone() -> None:
    seen = belief(0.1, 0.0, 0.1, 0.01, 0.05)
    assert usual_speed(seen, LeaderLimits(0.2, 0.2, 0.6)) == (seen, 0.0)
