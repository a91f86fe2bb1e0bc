"""Bounds in the mocap frame against adversaries: true states anywhere that the errors admit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation.bounds.bound_check import SpeedInputs, h_of
from estimation.bounds.live_bounds import LawConstants, Moment
from estimation.bounds.window_velocity import NO_WINDOW, WindowVelocity
from estimation.bounds.world_bounds import (
    PositionBounds,
    PositionErrors,
    position_errors,
    world_bounds_at,
)
from formation.spacing import Spacing
from formation.station import Side, Station

SPACING = Spacing(0.2, 20.0)
MU1, V_EPS = 1.5, 0.04
KNOWN = PositionBounds(1.2e-3, 1.2e-3, 0.07, 0.1, 0.27)
AHEAD = Moment(0.2, 0.5 * math.pi, 0.0, 0.08, -0.5 * math.pi, 0.1, 0.3)


@st.composite
def trials(draw: st.DrawFn) -> tuple[Moment, PositionErrors, Station, int]:
    rho = draw(st.floats(0.1, 0.6))
    seen = AHEAD._replace(rho=rho, v1=draw(st.floats(0.0, 0.2)), alpha1=draw(st.floats(-math.pi, math.pi)))
    velocity = draw(st.floats(0.0, 0.1))
    line = draw(st.floats(0.0, 0.5)) * rho
    station = Station(draw(st.sampled_from(Side)), draw(st.sampled_from([0.5 * math.pi, 1.2])))
    return seen, PositionErrors(velocity, velocity, line), station, draw(st.integers(0, 2**32 - 1))


@given(trials())
def test_nothing_that_the_errors_admit_breaks_a_bound(
    trial: tuple[Moment, PositionErrors, Station, int],
) -> None:
    """In the believed line's frame: true velocities on the disc's edge and in it, true lines likewise."""
    seen, errors, station, seed = trial
    random, n = np.random.default_rng(seed), 400
    bound = world_bounds_at(seen, errors, LawConstants.of(V_EPS, MU1, SPACING, station))
    edge = np.where(random.random(n) < 0.7, 1.0, random.random(n))
    velocity = seen.v1 * np.exp(1j * seen.alpha1)
    velocity = velocity + errors.velocity * edge * np.exp(2j * math.pi * random.random(n))
    line = seen.rho + errors.line * random.random(n) * np.exp(2j * math.pi * random.random(n))
    v1, rho = np.abs(velocity), np.abs(line)
    possible = v1 >= V_EPS
    alpha1 = np.angle(velocity * np.exp(1j * np.angle(line)))
    off = np.abs(np.angle(np.exp(1j * (alpha1 - seen.alpha1))))
    assert np.all(np.abs(v1 - seen.v1) <= bound.v1 + 1e-12)
    assert np.all((off <= bound.alpha1 + 1e-9)[possible])
    truth, believed = SpeedInputs(rho, v1, alpha1), SpeedInputs(seen.rho, seen.v1, seen.alpha1)
    wrong = h_of(truth, believed, MU1, SPACING, station) - h_of(truth, truth, MU1, SPACING, station)
    assert np.all((np.abs(wrong) <= bound.h + 1e-9)[possible])


def test_in_formation_the_bound_of_h_is_nearly_reached() -> None:
    """One disc for all terms: a twentieth above what the worst velocity in it does, the line being known."""
    law = LawConstants.of(V_EPS, MU1, SPACING)
    bound = world_bounds_at(AHEAD, PositionErrors(0.02, 0.02, 0.0), law)
    velocity = -0.08j + 0.02 * np.exp(1j * np.linspace(-math.pi, math.pi, 20_001))
    truth = SpeedInputs(0.2, np.abs(velocity), np.angle(velocity))
    believed = SpeedInputs(0.2, 0.08, -0.5 * math.pi)
    wrong = np.abs(h_of(truth, believed, MU1, SPACING) - h_of(truth, truth, MU1, SPACING))
    assert bound.h / 1.10 < wrong.max() <= bound.h
    assert bound.alpha1 == pytest.approx(math.asin(0.25), rel=1e-12)


def test_the_errors_are_those_of_the_difference_and_the_distance_from_it() -> None:
    window = WindowVelocity(0.075, 0.006, 4e-4, 0.2, 0.0, False)
    found = position_errors(AHEAD, window, KNOWN)
    difference = 2.0 * 1.2e-3 / 0.2 + 0.5 * 0.07 * 0.2
    assert found.velocity == pytest.approx(difference + 0.006, rel=1e-12)
    assert found.speed == pytest.approx(difference + 0.005, rel=1e-12)
    assert found.line == pytest.approx(4e-4 + 2.4e-3, rel=1e-12)
    later = position_errors(AHEAD, window._replace(since=0.1), KNOWN)
    assert later.velocity == pytest.approx(found.velocity + 0.007, rel=1e-12)
    assert later.line == pytest.approx(found.line + 0.1 * (difference + 0.0035), rel=1e-12)


def test_without_a_window_the_leaders_limit_is_all_that_is_known() -> None:
    found = position_errors(AHEAD, NO_WINDOW, KNOWN)
    assert found == PositionErrors(0.08 + 0.1, 0.08 + 0.1, math.inf)
    law = LawConstants.of(V_EPS, MU1, SPACING)
    assert world_bounds_at(AHEAD, found, law) == (0.08 + 0.1, math.pi, math.inf)
