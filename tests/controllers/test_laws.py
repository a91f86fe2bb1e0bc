from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.laws import (
    LAWS,
    Gains,
    constant_bearing,
    ideal,
    ideal_speed,
    independent,
    independent_speed,
    leaning,
)
from controllers.limits import Limits, clip
from formation.pose import Motion
from formation.shape import (
    ABREAST_ALPHA1,
    ABREAST_ALPHA2,
    Shape,
    leader_velocity,
    polar_velocity,
    reduced_rates,
    shape_rates,
)
from formation.spacing import Spacing, lyapunov
from formation.station import Side, Station

angles = st.floats(-math.pi, math.pi, exclude_min=True)
shapes = st.builds(Shape, st.floats(0.05, 5), angles, angles)
gains_drawn = st.builds(
    Gains,
    st.floats(0.1, 5),
    st.floats(0.1, 5),
    st.builds(Spacing, st.floats(0.1, 1), st.floats(0.1, 30)),
)
leaders = st.builds(Motion, st.floats(0.01, 1), st.floats(-2, 2))
GAINS = Gains(1.5, 2.0, Spacing(0.2, 20.0))


@given(shapes, leaders, st.floats(-3, 3), gains_drawn)
@settings(deadline=None)
def test_steering_leaves_alpha2_to_itself(shape: Shape, leader: Motion, v2: float, gains: Gains) -> None:
    """Under (4) alpha2_dot = mu2 cos(alpha2), whatever the speed is."""
    u2 = constant_bearing(shape, leader.v, v2, gains)
    alpha2_dot = shape_rates(shape, leader, Motion(v2, u2)).alpha2_dot
    assert alpha2_dot == pytest.approx(gains.mu2 * math.cos(shape.alpha2), abs=1e-9)


@given(shapes, leaders, gains_drawn)
@settings(deadline=None)
def test_ideal_speed_gives_the_papers_closed_loop(shape: Shape, leader: Motion, gains: Gains) -> None:
    v2 = ideal_speed(shape, leader.v, leader.u, gains)
    rho_dot, alpha1_dot = reduced_rates(shape.rho, shape.alpha1, leader, v2)
    wanted = -gains.mu1 * math.cos(shape.alpha1) + leader.v * gains.spacing.f(shape.rho)
    assert alpha1_dot == pytest.approx(wanted, rel=1e-9, abs=1e-9)
    # Prop. 1: along it V1 falls at the rate mu1 cos^2(alpha1).
    V1_dot = math.cos(shape.alpha1) * alpha1_dot + gains.spacing.f(shape.rho) * rho_dot
    assert V1_dot == pytest.approx(-gains.mu1 * math.cos(shape.alpha1) ** 2, rel=1e-9, abs=1e-6)


@given(shapes, leaders, gains_drawn)
@settings(deadline=None)
def test_speed_laws_differ_by_the_leaders_turning_only(shape: Shape, leader: Motion, gains: Gains) -> None:
    with_it = ideal_speed(shape, leader.v, leader.u, gains)
    without = independent_speed(shape, leader.v, gains)
    assert with_it - without == pytest.approx(shape.rho * leader.u, abs=1e-9)
    assert independent(shape, leader.v, math.nan, gains) == independent(shape, leader.v, leader.u, gains)


@given(leaders, gains_drawn)
@settings(deadline=None)
def test_abreast_the_ideal_follower_drives_a_parallel_track(leader: Motion, gains: Gains) -> None:
    rho_0 = gains.spacing.rho_0
    motion = ideal(Shape(rho_0, ABREAST_ALPHA1, ABREAST_ALPHA2), leader.v, leader.u, gains)
    assert motion.v == pytest.approx(leader.v + rho_0 * leader.u, abs=1e-12)
    assert motion.u == pytest.approx(leader.u, abs=1e-9)


@pytest.mark.parametrize("name", sorted(LAWS))
@given(shape=shapes, leader=leaders, gains=gains_drawn)
@settings(deadline=None)
def test_turn_rate_suits_the_speed_that_the_limits_let_through(
    name: str, shape: Shape, leader: Motion, gains: Gains
) -> None:
    limits = Limits(0.22, 2.84)
    wanted = LAWS[name](shape, leader.v, leader.u, gains, limits)
    assert wanted.v == LAWS[name](shape, leader.v, leader.u, gains).v
    driven = Motion(clip(wanted.v, limits.v_max), wanted.u)
    alpha2_dot = shape_rates(shape, leader, driven).alpha2_dot
    assert alpha2_dot == pytest.approx(gains.mu2 * math.cos(shape.alpha2), abs=1e-9)


@pytest.mark.parametrize(
    "shape", [Shape(math.nan, 0.0, 0.0), Shape(0.2, math.nan, 0.0), Shape(0.2, 0.0, math.nan)]
)
def test_an_estimate_that_is_nan_shows_in_the_command(shape: Shape) -> None:
    motion = independent(shape, 0.08, 0.0, GAINS, Limits(0.22, 2.84))
    assert math.isnan(motion.v) or math.isnan(motion.u)


def test_first_command_of_the_papers_experiment() -> None:
    """Worked out by hand from (8) and (4) at the start shape of the robots."""
    shape = Shape(0.832346, -0.596867, -0.611459)
    motion = independent(shape, 0.08, 0.2, GAINS)
    f = 20.0 * (0.832346**2 - 0.04) / 0.832346**2
    v2 = 0.08 * math.sin(0.596867) + 0.832346 * (-1.5 * math.cos(0.596867) + 0.08 * f)
    u2 = -2.0 * math.cos(0.611459) + (-0.08 * math.sin(0.596867) - v2 * math.sin(0.611459)) / 0.832346
    assert (motion.v, motion.u) == pytest.approx((v2, u2), rel=1e-12)
    assert lyapunov(shape, GAINS.spacing) == pytest.approx(10.05, abs=5e-3)


def command_errors(lag: int, measured: bool, steps: int = 60) -> list[float]:
    """|u2 commanded - u2 wanted| over samples of a shape that is held still, acted on after ``lag`` samples.

    The follower works the leader's motion out of rates and its own turn rate: as measured, or as commanded.
    """
    shape, v1, v2 = Shape(0.25, -1.4, 1.5), 0.08, 0.1
    wanted = constant_bearing(shape, v1, v2, GAINS)
    commands = [wanted] * lag + [wanted + 0.01]
    for _ in range(steps):
        driven = commands[-1 - lag]
        rates = shape_rates(shape, Motion(v1, 0.0), Motion(v2, driven))
        used = Motion(v2, driven if measured else commands[-1])
        seen = polar_velocity(
            *leader_velocity(shape.rho, shape.alpha2, rates.rho_dot, rates.alpha2_dot, used)
        )
        commands.append(constant_bearing(Shape(shape.rho, seen[1], shape.alpha2), seen[0], v2, GAINS))
    return [abs(command - wanted) for command in commands[lag + 1 :]]


@pytest.mark.parametrize("lag", [1, 2, 3, 5])
def test_a_command_in_the_place_of_the_measured_turn_rate_feeds_back_on_itself(lag: int) -> None:
    """Its error e obeys e[k] = e[k-1] - e[k-1-lag]: no root of z^(lag+1) - z^lag + 1 lies inside |z| = 1."""
    assert max(command_errors(lag, measured=True)) < 1e-12
    errors = command_errors(lag, measured=False)
    growth = float(np.abs(np.roots([1.0, -1.0, *[0.0] * (lag - 1), 1.0])).max())
    assert growth >= 1.0 - 1e-12
    assert max(errors[-2 * lag - 4 :]) >= 0.01 * 0.9
    assert max(errors[-20:]) > max(errors[:20]) or lag == 1


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_gains_without_sense_are_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="mu1"):
        Gains(bad, 2.0, GAINS.spacing)
    with pytest.raises(ValueError, match="mu2"):
        Gains(1.5, bad, GAINS.spacing)


stations = st.builds(Station, st.sampled_from(Side), st.floats(0.3, math.pi - 0.3))


@given(shapes, leaders, st.floats(-3, 3), stations, st.floats(-1.0, 1.0))
@settings(deadline=None)
def test_steering_turns_towards_the_stations_bearing_less_the_leaning(
    shape: Shape, leader: Motion, v2: float, station: Station, lean: float
) -> None:
    gains = replace(GAINS, station=station)
    for leaning_by in (lean, 0.0):
        u2 = constant_bearing(shape, leader.v, v2, gains, leaning_by)
        alpha2_dot = shape_rates(shape, leader, Motion(v2, u2)).alpha2_dot
        off = shape.alpha2 - (station.alpha2 - leaning_by)
        assert alpha2_dot == pytest.approx(-2.0 * math.sin(off), abs=1e-8)


@given(shapes, leaders, stations)
@settings(deadline=None)
def test_across_the_line_the_speed_is_that_of_eq_8_at_every_station(
    shape: Shape, leader: Motion, station: Station
) -> None:
    gains = replace(GAINS, station=station)
    side = 1.0 if station.side is Side.RIGHT else -1.0
    f = 20.0 * (1.0 - (0.2 / shape.rho) ** 2)
    restoring = side * leader.v * f - 1.5 * math.sin(shape.alpha1 - station.alpha1)
    across = -leader.v * math.sin(shape.alpha1) + shape.rho * restoring
    v2 = independent_speed(shape, leader.v, gains)
    assert v2 * math.sin(station.alpha2) == pytest.approx(across, rel=1e-9, abs=1e-9)
    more = ideal_speed(shape, leader.v, leader.u, gains) - v2
    assert more * math.sin(station.alpha2) == pytest.approx(shape.rho * leader.u, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("rho", "pull"), [(0.4, 0.75), (0.2, 0.0), (0.16, -0.5625), (0.1, -1.0)])
def test_the_leaning_is_the_tilt_by_the_share_that_is_missing_and_by_the_pull(
    side: Side, sign: float, rho: float, pull: float
) -> None:
    gains = replace(GAINS, station=Station(side), tilt=0.4)
    towards = 1.0 if side is Side.RIGHT else -1.0
    found = leaning(rho, sign * 0.5, sign * 0.2, gains)
    assert found == pytest.approx(towards * 0.4 * sign * 0.6 * pull, rel=1e-12, abs=1e-15)
    assert leaning(rho, sign * 0.5, sign * 0.5, gains) == 0.0
    assert leaning(rho, sign * 0.5, sign * 0.2, replace(gains, tilt=0.0)) == 0.0


def test_who_is_to_stand_does_not_lean() -> None:
    assert leaning(0.4, 0.0, 0.0, replace(GAINS, tilt=0.4)) == 0.0
    # At rho_0 and abeam of a leader that stands, exactly nothing is wanted.
    standing = Shape(0.2, ABREAST_ALPHA1, 1.0)
    plain = independent(standing, 0.0, 0.0, GAINS, Limits(0.22, 2.84))
    assert independent(standing, 0.0, 0.0, replace(GAINS, tilt=0.4), Limits(0.22, 2.84)) == plain


def test_a_follower_that_cannot_keep_up_turns_towards_a_far_leader() -> None:
    shape, limits, tilted = Shape(0.8, -1.2, 1.4), Limits(0.1, 2.84), replace(GAINS, tilt=0.3)
    wanted = independent(shape, 0.08, 0.0, tilted, limits)
    assert wanted.v > limits.v_max
    lean = leaning(0.8, wanted.v, limits.v_max, tilted)
    assert lean > 0.0
    alpha2_dot = shape_rates(shape, Motion(0.08, 0.0), Motion(limits.v_max, wanted.u)).alpha2_dot
    assert alpha2_dot == pytest.approx(-2.0 * math.sin(1.4 - (ABREAST_ALPHA2 - lean)), abs=1e-12)
    assert independent(shape, 0.08, 0.0, tilted).u == independent(shape, 0.08, 0.0, GAINS).u


@pytest.mark.parametrize("tilt", [-1e-9, 0.5 * math.pi, math.nan, math.inf])
def test_a_tilt_to_behind_is_refused(tilt: float) -> None:
    with pytest.raises(ValueError, match="tilt"):
        replace(GAINS, tilt=tilt)
    assert replace(GAINS, tilt=math.nextafter(0.5 * math.pi, 0.0)).tilt > 1.5
