from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_are

from estimation.tracking.turn_prediction import NO_TREND, TurnPrediction, TurnTrend

PREDICTION = TurnPrediction.of(k_u=0.7, diffusion=0.245)
MS = 1_000_000
rates = st.floats(-0.7, 0.7)
variances = st.floats(0.0, 1.0)


def after(u1: list[float], variance: float, ahead: float, step_ms: float = 1.0) -> TurnTrend:
    trend = NO_TREND
    for number, each in enumerate(u1):
        trend = PREDICTION.heard(trend, round(number * step_ms * MS), each, variance, ahead)
    return trend


@pytest.mark.parametrize(("noise", "v1"), [(1e-9, 0.08), (1e-4, 0.2), (1.0, 1.0)])
def test_a_filter_lags_behind_a_ramp_by_its_variance_over_the_diffusion(noise: float, v1: float) -> None:
    """The steady-state filter of the module's docstring, solved as a Riccati equation."""
    motion = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, v1], [0.0, 0.0, 0.0]])
    seen = np.array([[1.0, 0.0, 0.0]])
    q = PREDICTION.diffusion
    covariance = solve_continuous_are(motion.T, seen.T, np.diag([0.0, 0.0, q]), np.array([[noise]]))
    gain = covariance @ seen.T / noise
    # Errors of position, velocity across and turn rate that no longer change under u1 rising by 1 per second.
    _, across, turn = np.linalg.solve(motion - gain @ seen, [0.0, 0.0, -1.0])
    assert turn == pytest.approx(covariance[2, 2] / q, rel=1e-5)
    assert across / v1 == pytest.approx(0.5 * turn**2, rel=1e-5)


@given(rates, variances, st.floats(0.0, 1.0))
def test_a_steady_turn_is_predicted_as_it_is(u1: float, variance: float, ahead: float) -> None:
    trend = after([u1] * 5, variance, ahead)
    assert PREDICTION.predicted(trend) == u1
    assert PREDICTION.further(trend, ahead) == 0.0


@pytest.mark.parametrize("behind", [0.05, 0.2])
def test_a_ramp_is_carried_on_by_what_its_estimate_is_behind(behind: float) -> None:
    variance = 0.25 * behind * PREDICTION.diffusion
    seen = [0.1 * (0.001 * n - behind) for n in range(3000)]
    predicted = PREDICTION.predicted(after(seen, variance, 0.75 * behind))
    assert predicted == pytest.approx(0.1 * 2.999, abs=1e-4)


@pytest.mark.parametrize("behind", [0.02, 0.1])
def test_on_a_ramp_the_leader_turns_further_by_the_square_of_that(behind: float) -> None:
    variance = 0.25 * behind * PREDICTION.diffusion
    seen = [0.1 * (0.001 * n - behind) for n in range(3000)]
    further = PREDICTION.further(after(seen, variance, 0.75 * behind), 0.75 * behind)
    removed = 1.0 - 25.0 / 36.0 * behind * PREDICTION.diffusion / PREDICTION.spread
    assert further == pytest.approx(removed * 0.5 * 0.1 * behind**2, rel=0.05)


def test_what_is_left_of_a_swing_is_of_second_order() -> None:
    """The errors of the module's docstring: w D held, (w D)^2 carried on."""
    omega, behind = 1.0, 0.05
    times = 0.001 * np.arange(8000)
    seen = 0.5 * np.sin(omega * (times - behind))
    trends = [
        after(seen[: n + 1].tolist(), behind * PREDICTION.diffusion, 0.0) for n in range(5000, 8000, 500)
    ]
    now = 0.5 * np.sin(omega * times[5000:8000:500])
    held = np.array([trend.u1 for trend in trends]) - now
    left = np.array([PREDICTION.predicted(trend) for trend in trends]) - now
    assert np.max(np.abs(held)) == pytest.approx(0.5 * omega * behind, rel=0.1)
    assert np.max(np.abs(left)) == pytest.approx(0.5 * (omega * behind) ** 2, rel=0.25)


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=5), variances)
def test_no_more_is_predicted_than_the_leader_can_turn(u1: list[float], variance: float) -> None:
    assert abs(PREDICTION.predicted(after(u1, variance, 0.1, 10.0))) <= PREDICTION.k_u


@given(variances, variances, st.floats(0.0, 2.0))
def test_the_more_uncertain_the_less_is_fed_forward(one: float, other: float, ahead: float) -> None:
    less, more = sorted((one, other))
    assert 1.0 >= PREDICTION.weight(less, ahead) >= PREDICTION.weight(more, ahead) >= 0.0
    assert PREDICTION.weight(0.0, 0.0) == 1.0
    assert PREDICTION.weight(PREDICTION.spread, ahead) == 0.0


@given(rates, rates, st.floats(0.0, 2.0))
def test_an_estimate_that_says_little_is_not_turned_further(u1: float, slow: float, ahead: float) -> None:
    assert (
        PREDICTION.further(TurnTrend(True, 0, u1, 1.5 * PREDICTION.spread, slow, PREDICTION.diffusion), ahead)
        == 0.0
    )


def test_an_estimate_heard_again_changes_nothing() -> None:
    trend = after([0.0, 0.1, 0.3], 0.01, 0.1, 8.0)
    assert PREDICTION.heard(trend, trend.capture_ns, trend.u1, trend.variance, 0.2) == trend


@pytest.mark.parametrize(("k_u", "diffusion"), [(0.0, 1.0), (math.inf, 1.0), (1.0, 0.0), (1.0, math.nan)])
def test_nonsense_is_refused(k_u: float, diffusion: float) -> None:
    with pytest.raises(ValueError, match="expected a positive finite number"):
        TurnPrediction.of(k_u, diffusion)


def test_before_anything_is_seen_the_leader_swings_to_its_limit() -> None:
    swing = 0.7 * np.sin(np.linspace(0.0, 2.0 * math.pi, 1000, endpoint=False))
    made = TurnPrediction.of(0.7, 0.245)
    assert (made.k_u, made.diffusion) == (0.7, 0.245)
    assert made.spread == pytest.approx(np.mean(swing**2))
    assert not NO_TREND.known
