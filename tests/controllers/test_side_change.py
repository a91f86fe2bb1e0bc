"""Changing sides at random instants: no collision, and all settle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from benchmarks.side_change_trial import SETTINGS, Setting, random_run
from controllers.laws import LAWS, Gains
from controllers.limits import Limits
from controllers.side_change import (
    CORRECTION,
    PACE,
    SLACK,
    Led,
    SideChange,
    change_step,
    change_to,
    gentle,
)
from controllers.side_change_run import run_with_changes
from controllers.station_keeper import StationKeeper
from formation.angles import wrap
from formation.leader import Constant
from formation.line import line_of
from formation.pose import Motion, Pose
from formation.shape import Shape, follower_pose, shape_rates
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


V1, DT = 0.5, 0.05
signs = st.sampled_from([-1.0, 1.0])
angles = st.floats(-math.pi, math.pi)


def led(sign: float, phase: float, shape: Shape, u1: float = 0.0) -> Led:
    """A step on the way, where the law has not taken over."""
    found = change_step(SideChange(sign, phase, False), GAINS.settings(LIMITS), line_of(shape), V1, u1, DT)
    assume(not found.change.arrived)
    return found


@given(signs, angles, st.floats(0.2, 1.5), angles, st.floats(-0.4, 0.4))
def test_driven_as_wanted_the_error_of_the_place_dies_out_and_the_place_moves_on(
    sign: float, phase: float, rho: float, alpha1: float, u1: float
) -> None:
    """Seen from the leader, by complex numbers: with e = q* - q, e_dot = -k e - i u1 e."""
    aside = (u1 - led(sign, phase, Shape(rho, alpha1, 0.3), u1).wanted.u) / GAINS.mu2
    shape = Shape(rho, alpha1, 0.3 + aside)
    change, wanted = led(sign, phase, shape, u1)
    assert wanted.u == pytest.approx(u1, abs=1e-9)
    rates = shape_rates(shape, Motion(V1, u1), wanted)
    place, q = 0.5 * np.exp(1j * phase), rho * np.exp(1j * alpha1)
    q_dot = (rates.rho_dot + 1j * rho * rates.alpha1_dot) * np.exp(1j * alpha1)
    place_dot = 1j * wrap(change.phase - phase) / DT * place
    error = place - q
    gain = min(GAINS.mu1, CORRECTION * V1 / abs(error))
    assert place_dot - q_dot == pytest.approx(-(gain + 1j * u1) * error, abs=1e-8)


@given(signs, angles, st.floats(0.0, 0.2), angles)
def test_the_place_goes_round_behind_at_its_pace_and_waits_for_who_falls_behind(
    sign: float, phase: float, off: float, direction: float
) -> None:
    q = 0.5 * np.exp(1j * phase) + off * np.exp(1j * direction)
    change, _ = led(sign, phase, Shape(float(abs(q)), float(np.angle(q)), 0.3))
    # Measured from ahead of the leader, which is not passed.
    aim, here = (angle % (2.0 * math.pi) for angle in (-sign * 0.5 * math.pi, phase))
    share = min(1.0, max(0.0, 2.0 - 2.0 * off / (SLACK * 0.5)))
    step = min(abs(aim - here), share * PACE * V1 / 0.5 * DT)
    assert wrap(change.phase - phase) == pytest.approx(math.copysign(step, aim - here), abs=1e-9)


@given(signs, angles, st.floats(0.2, 1.5), angles, angles)
def test_who_heads_elsewhere_turns_to_the_way_and_does_not_drive_away_from_it(
    sign: float, phase: float, rho: float, alpha1: float, alpha2: float
) -> None:
    aside = -led(sign, phase, Shape(rho, alpha1, alpha2)).wanted.u / GAINS.mu2
    assume(abs(abs(aside) - math.pi) > 1e-6)
    straight = led(sign, phase, Shape(rho, alpha1, alpha2 + aside)).wanted
    found = led(sign, phase, Shape(rho, alpha1, alpha2)).wanted
    assert abs(aside) <= math.pi
    assert found.v == pytest.approx(straight.v * max(0.0, math.cos(aside)), abs=1e-9)


def test_a_leader_is_gentle_whose_turn_the_correction_outweighs() -> None:
    most = CORRECTION * 0.2 / GAINS.spacing.rho_0
    for u1, expected in ((0.999 * most, True), (-0.999 * most, True), (1.001 * most, False)):
        assert gentle(0.2, u1, GAINS) is expected
        assert gentle(0.2, -u1, GAINS) is expected
    assert gentle(0.0, 0.0, GAINS)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("value", "aside", "taken"),
    [(0.48, 0.0, True), (0.52, 0.0, False), (0.1, 0.48, True), (0.1, -0.48, True), (0.1, 0.52, False)],
)
def test_the_law_takes_over_well_inside_its_region_from_who_heads_nearly_right(
    sign: float, value: float, aside: float, taken: bool
) -> None:
    station = Station(Side.of(sign))
    shape = Shape(0.5, station.alpha1 + math.acos(1.0 - value), station.alpha2 + aside)
    assert lyapunov(shape, GAINS.spacing, station) == pytest.approx(value)
    begun = SideChange(sign, shape.alpha1, False)
    found = change_step(begun, GAINS.settings(LIMITS), line_of(shape), V1, 0.0, DT)
    assert found.change.arrived is taken
