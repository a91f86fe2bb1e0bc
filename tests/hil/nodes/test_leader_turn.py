"""What is fed forward of the leader's turn rate, and what that comes to in the closed loop."""

from __future__ import annotations

import math

import pytest

from benchmarks.feedforward import distances_mm
from estimation.tracking.turn_prediction import NO_TREND, TurnPrediction, TurnTrend
from hil.nodes.leader_turn import TurnSource, TurnSpread, trend_with, turn_when_acting, turned_further

PREDICTION = TurnPrediction.of(k_u=0.7, diffusion=0.245)
TREND = TurnTrend(True, 5_000, 0.3, 0.01, 0.25, PREDICTION.diffusion)
AHEAD = 0.1


@pytest.mark.parametrize("u1", [-0.3, 0.0, 9.9e5])
@pytest.mark.parametrize("variance", [0.0, 0.02, 9.9e5])
def test_a_sound_estimate_joins_the_trend(u1: float, variance: float) -> None:
    for before in (NO_TREND, TREND):
        expected = PREDICTION.heard(before, 9_000, u1, variance, AHEAD)
        assert trend_with(PREDICTION, before, 9_000, u1, TurnSpread(variance, -0.001), AHEAD) == expected
        assert expected.known


@pytest.mark.parametrize(
    ("u1", "variance"),
    [
        *((u1, 0.01) for u1 in (math.nan, math.inf, -math.inf, 1e6, -1e6)),
        *((0.3, variance) for variance in (math.nan, math.inf, 1e6, -1e-9)),
    ],
)
def test_one_that_no_sound_estimator_gives_ends_the_trend(u1: float, variance: float) -> None:
    assert trend_with(PREDICTION, TREND, 9_000, u1, TurnSpread(variance, -0.001), AHEAD) == NO_TREND


def test_a_law_that_is_told_or_knows_nothing_takes_what_was_commanded() -> None:
    for source in (TurnSource.NOWHERE, TurnSource.TOLD):
        for trend in (NO_TREND, TREND):
            assert turn_when_acting(source, PREDICTION, trend, 0.42, AHEAD) == 0.42


def test_what_is_predicted_is_fed_forward_in_full_or_by_its_worth_and_not_before_it_is_known() -> None:
    full, faded = TurnSource.PREDICTED, TurnSource.FADED
    predicted, worth = PREDICTION.predicted(TREND), PREDICTION.weight(TREND.variance, AHEAD)
    assert 0.0 < worth < 1.0
    assert turn_when_acting(full, PREDICTION, TREND, 0.42, AHEAD) == predicted
    assert turn_when_acting(faded, PREDICTION, TREND, 0.42, AHEAD) == predicted * worth
    for source in (full, faded):
        assert math.isnan(turn_when_acting(source, PREDICTION, NO_TREND, 0.42, AHEAD))


@pytest.mark.parametrize("source", TurnSource)
def test_the_heading_is_turned_on_but_where_the_turn_rate_is_fed_forward_in_full(source: TurnSource) -> None:
    further = PREDICTION.further(TREND, AHEAD)
    assert further > 0.0
    expected = 0.0 if source is TurnSource.PREDICTED else further
    assert turned_further(source, PREDICTION, TREND, AHEAD) == expected
    assert turned_further(source, PREDICTION, TREND._replace(known=False), AHEAD) == 0.0


def test_with_good_motion_capture_the_pair_strays_half_as_far() -> None:
    found = distances_mm((0.03, 0.2, 0.3), seeds=2)
    assert 1.0 < found["feedforward"] < 0.4 * found["independent"]
    assert 1.0 < found["faded"] < 0.4 * found["independent"]


def test_what_noise_spoils_is_faded_out() -> None:
    found = distances_mm((0.3, 1.0, 5.0), seeds=2)
    assert found["feedforward"] > 2.0 * found["independent"]
    assert found["faded"] < 1.02 * found["independent"]


def test_between_both_the_fade_is_better_than_either() -> None:
    found = distances_mm((0.03, 1.0, 2.0), seeds=2)
    assert found["faded"] < 0.95 * min(found["independent"], found["feedforward"])
