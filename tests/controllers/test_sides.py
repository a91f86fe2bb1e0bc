"""Following on the left is the mirror image of following on the right, and other bearings are stable too."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.laws import LAWS, Gains, constant_bearing, ideal_speed
from controllers.limits import Limits
from formation.closed_loop import FollowerLaw, Trajectory, simulate_pair
from formation.leader import Constant, Sinusoid
from formation.pose import Motion, Pose
from formation.shape import Shape, follower_pose, shape_rates
from formation.spacing import Spacing, lyapunov
from formation.station import Side, Station

angles = st.floats(-math.pi, math.pi, exclude_min=True)
shapes = st.builds(Shape, st.floats(0.05, 5.0), angles, angles)
leaders = st.builds(Motion, st.floats(0.01, 1.0), st.floats(-2.0, 2.0))
bearings = st.floats(0.2, 2.9)
spacings = st.builds(Spacing, st.floats(0.1, 1.0), st.floats(0.1, 30.0))
LIMITS = Limits(0.22, 2.84)


@st.composite
def gains_drawn(draw: st.DrawFn) -> Gains:
    station = Station(Side.RIGHT, draw(st.one_of(st.just(math.pi / 2), bearings)))
    mu1, mu2, tilt = draw(st.floats(0.1, 5.0)), draw(st.floats(0.1, 5.0)), draw(st.floats(0.0, 1.5))
    return Gains(mu1, mu2, draw(spacings), station, tilt)


def on_the_left(gains: Gains) -> Gains:
    return replace(gains, station=Station(Side.LEFT, gains.station.bearing))


def mirrored(shape: Shape) -> Shape:
    return Shape(shape.rho, -shape.alpha1, -shape.alpha2)


@pytest.mark.parametrize("limits", [None, LIMITS], ids=["free", "limited"])
@pytest.mark.parametrize("name", sorted(LAWS))
@given(shape=shapes, leader=leaders, gains=gains_drawn())
def test_the_left_hand_law_is_the_mirror_image_to_the_last_bit(
    name: str, limits: Limits | None, shape: Shape, leader: Motion, gains: Gains
) -> None:
    right = LAWS[name](shape, leader.v, leader.u, gains, limits)
    left = LAWS[name](mirrored(shape), leader.v, -leader.u, on_the_left(gains), limits)
    assert (left.v, left.u) == (right.v, -right.u)


@given(shape=shapes, gains=gains_drawn())
def test_the_lyapunov_function_sees_no_side(shape: Shape, gains: Gains) -> None:
    right = lyapunov(shape, gains.spacing, gains.station)
    assert lyapunov(mirrored(shape), gains.spacing, on_the_left(gains).station) == right


def run_of(shape: Shape, leader: Pose, program: Constant | Sinusoid, law: FollowerLaw) -> Trajectory:
    return simulate_pair(leader, follower_pose(shape, leader), program, law, np.linspace(0.0, 30.0, 61))


@pytest.mark.parametrize("name", sorted(LAWS))
def test_whole_runs_mirror(name: str) -> None:
    gains = Gains(1.0, 2.0, Spacing(0.5, 2.0))
    shape = Shape(1.0, 0.7, 1.2)
    right = run_of(
        shape, Pose(0, 0, 0.3), Sinusoid(0.5, 0.3, 0.6, 2.0), lambda s, v, u: LAWS[name](s, v, u, gains)
    )
    left = run_of(
        mirrored(shape),
        Pose(0, 0, -0.3),
        Sinusoid(0.5, -0.3, -0.6, 2.0),
        lambda s, v, u: LAWS[name](s, v, u, on_the_left(gains)),
    )
    np.testing.assert_allclose(left.rho, right.rho, rtol=1e-9)
    np.testing.assert_allclose(left.follower, right.follower * [1.0, -1.0, -1.0], atol=1e-8)


@given(shapes, leaders, gains_drawn())
def test_at_any_station_alpha1_and_alpha2_move_as_derived(shape: Shape, leader: Motion, gains: Gains) -> None:
    """On alpha2 = desired: alpha1_dot = sign v1 f - mu1 sin(off); under steering alpha2_dot = -mu2 sin."""
    station, spacing = gains.station, gains.spacing
    at = Shape(shape.rho, shape.alpha1, station.alpha2)
    v2 = ideal_speed(at, leader.v, leader.u, gains)
    rates = shape_rates(at, leader, Motion(v2, 0.0))
    off = station.offset(at.alpha1)
    wanted = leader.v * spacing.f(at.rho) - gains.mu1 * math.sin(off)
    assert rates.alpha1_dot == pytest.approx(wanted, rel=1e-7, abs=1e-6)
    u2 = constant_bearing(shape, leader.v, v2, gains)
    turning = shape_rates(shape, leader, Motion(v2, u2)).alpha2_dot
    expected = -gains.mu2 * math.sin(shape.alpha2 - station.alpha2)
    assert turning == pytest.approx(expected, rel=1e-6, abs=1e-6 * (1.0 + abs(v2) / shape.rho))


@given(st.floats(0.05, 5.0), angles, leaders, gains_drawn())
def test_behind_the_beam_v1_falls_wherever_the_derivation_says_so(
    rho: float, alpha1: float, leader: Motion, gains: Gains
) -> None:
    """V1_dot <= 0 for 0 <= mu1 rho cos(bearing) <= 4 v1 behind a leader that drives straight."""
    station, spacing = gains.station, gains.spacing
    if not 0.0 <= gains.mu1 * rho * station.cos <= 4.0 * leader.v:
        return
    shape = Shape(rho, alpha1, station.alpha2)
    straight = Motion(leader.v, 0.0)
    v2 = ideal_speed(shape, leader.v, 0.0, gains)
    rates = shape_rates(shape, straight, Motion(v2, 0.0))
    f, off = spacing.f(rho), station.offset(alpha1)
    V1_dot = math.sin(off) * rates.alpha1_dot + abs(station.sin) * f * rates.rho_dot
    assert V1_dot <= 1e-9 * (1.0 + f * f) * (1.0 + abs(v2) / rho)


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("bearing", [0.4, 0.9, 1.3, 1.8, 1.95])
def test_other_bearings_settle(side: Side, bearing: float) -> None:
    """Up to cot(bearing) = -mu1 / (2 mu_rho v1), 116.6 deg here."""
    station = Station(side, bearing)
    gains = Gains(1.0, 2.0, Spacing(0.5, 2.0), station)
    shape = Shape(0.6, station.alpha1 + 0.3, station.alpha2 - 0.3)
    times = np.linspace(0.0, 120.0, 3)
    run = simulate_pair(
        Pose(0, 0, 0),
        follower_pose(shape, Pose(0, 0, 0)),
        Constant(0.5, 0.0),
        lambda s, v, u: LAWS["independent"](s, v, u, gains),
        times,
    )
    assert run.rho[-1] == pytest.approx(0.5, abs=2e-3)
    assert station.offset(float(run.alpha1[-1])) == pytest.approx(0.0, abs=2e-3)


def test_too_far_ahead_of_the_beam_nothing_settles() -> None:
    station = Station(Side.RIGHT, 2.2)
    gains = Gains(1.0, 2.0, Spacing(0.5, 2.0), station)
    start = Pose(0, 0, 0)
    near = Shape(0.5, station.alpha1 + 0.01, station.alpha2)
    run = simulate_pair(
        start,
        follower_pose(near, start),
        Constant(0.5, 0.0),
        lambda s, v, u: LAWS["ideal"](s, v, u, gains),
        np.linspace(0.0, 20.0, 201),
    )
    assert float(np.abs(run.rho - 0.5).max()) > 0.1
