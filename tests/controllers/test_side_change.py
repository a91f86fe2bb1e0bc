"""Changing sides at random instants: no collision, and all settle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.side_change_trial import SETTINGS, Setting, random_run
from controllers.laws import LAWS, Gains
from controllers.limits import Limits
from controllers.side_change import CORRECTION, SideChange, change_step, change_to
from controllers.side_change_run import run_with_changes
from controllers.station_keeper import StationKeeper
from formation.leader import Constant
from formation.line import line_of
from formation.pose import Pose
from formation.shape import Shape, follower_pose
from formation.spacing import Spacing, lyapunov
from formation.station import ABREAST, Side, Station

GAINS, LIMITS = Gains(1.0, 2.0, Spacing(0.5, 2.0)), Limits(1.5, 2.84)


@pytest.mark.parametrize("knows_turn", [False, True])
@pytest.mark.parametrize("setting", SETTINGS, ids=lambda setting: setting.name)
def test_random_changes_end_in_formation_without_a_collision(setting: Setting, knows_turn: bool) -> None:
    for seed in range(3):
        result = random_run(setting, seed, knows_turn=knows_turn)
        assert result.nearest > 0.5
        assert result.settled


def test_a_leader_that_turns_harder_than_allowed_for_may_be_met() -> None:
    """The limit is real: three times the share and unknown to the follower, some runs come too close."""
    hard = [random_run(SETTINGS[0], seed, knows_turn=False, share=3.0 * CORRECTION) for seed in range(3)]
    assert min(result.nearest for result in hard) < 0.5


@pytest.mark.parametrize("first", Side)
def test_the_follower_goes_round_behind_the_leader(first: Side) -> None:
    station, start = Station(first), Pose(0.0, 0.0, 0.0)
    gains = Gains(1.0, 2.0, Spacing(0.5, 2.0), station)
    follower = follower_pose(Shape(0.5, station.alpha1, station.alpha2), start)
    times = np.linspace(0.0, 60.0, 1201)
    run = run_with_changes(
        start,
        follower,
        Constant(0.5, 0.0),
        StationKeeper(gains, LIMITS, knows_turn=False, may_change=True),
        [(5.0, first.other)],
        times,
    )
    assert run.alpha1[-1] == pytest.approx(-station.alpha1, abs=1e-3)
    assert run.alpha2[-1] == pytest.approx(-station.alpha2, abs=1e-3)
    assert run.rho[-1] == pytest.approx(0.5, abs=1e-3)
    changing = np.abs(np.cos(run.alpha1)) > 0.5
    assert np.all(np.cos(run.alpha1[changing]) < 0.0)
    assert float(run.rho.min()) > 0.35


@given(st.floats(0.3, 1.0), st.floats(-3.1, 3.1), st.floats(-3.1, 3.1))
def test_it_hands_over_inside_the_proved_region_only(rho: float, alpha1: float, alpha2: float) -> None:
    shape = Shape(rho, alpha1, alpha2)
    line = line_of(shape)
    state, motion = change_step(change_to(Side.LEFT.sign, line), GAINS.settings(LIMITS), line, 0.5, 0.0, 0.05)
    assert math.isfinite(motion.v)
    assert math.isfinite(motion.u)
    if state.arrived:
        assert lyapunov(shape, GAINS.spacing, Station(Side.LEFT)) < 2.0


def test_at_its_side_already_it_drives_by_the_law() -> None:
    at = Shape(0.6, ABREAST.alpha1 + 0.1, ABREAST.alpha2 - 0.1)
    line = line_of(at)
    state, motion = change_step(
        change_to(Side.RIGHT.sign, line), GAINS.settings(LIMITS), line, 0.5, 0.2, 0.05
    )
    assert state == SideChange(Side.RIGHT.sign, state.phase, True)
    assert state.phase == pytest.approx(at.alpha1)
    assert motion == LAWS["ideal"](at, 0.5, 0.2, GAINS, LIMITS)
