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
    LawSettings,
    constant_bearing,
    ideal,
    ideal_speed,
    independent,
    independent_speed,
    law,
    lean,
)
from controllers.limits import Limits, clip
from formation.kernel import entry
from formation.line import Line, line_of
from formation.pose import Motion
from formation.shape import (
    ABREAST_ALPHA1,
    ABREAST_ALPHA2,
    Shape,
    leader_velocity,
    polar_velocity,
    shape_rates,
)
from formation.spacing import Spacing, lyapunov
from formation.station import Side, Station
from tests.bits import same_bits
from tests.formation.shape_rates import reduced_rates

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


@entry
def law_compiled(settings: LawSettings, line: Line, v1: float, u1: float) -> Motion:
    return law(settings, line, v1, u1)


stations = st.builds(Station, st.sampled_from(Side), st.floats(0.2, 2.9))
tilted = st.builds(
    Gains, st.floats(0.1, 5), st.floats(0.1, 5), st.builds(Spacing, st.floats(0.1, 1), st.floats(0.1, 30)),
    stations, st.floats(0.0, 1.5),
)  # fmt: skip


@given(shapes, leaders, tilted)
def test_compiled_and_interpreted_are_the_same(shape: Shape, leader: Motion, gains: Gains) -> None:
    numbers, line = gains.settings(Limits(0.22, 2.84)), line_of(shape)
    same_bits(law_compiled(numbers, line, *leader), law(numbers, line, *leader))


@given(shapes, leaders, gains_drawn)
def test_abreast_on_the_right_it_is_the_papers_to_the_last_bit(
    shape: Shape, leader: Motion, gains: Gains
) -> None:
    """Eqs. (4), (6) and (8) as the paper writes them, f factored."""
    (rho, alpha1, alpha2), (v1, u1), spacing = shape, leader, gains.spacing
    f = spacing.mu_rho * ((rho - spacing.rho_0) / rho) * ((rho + spacing.rho_0) / rho)
    eight = -v1 * math.sin(alpha1) + rho * (v1 * f - gains.mu1 * math.cos(alpha1))
    six = eight + rho * u1
    for name, v2 in (("independent", eight), ("ideal", six)):
        u2 = -gains.mu2 * math.cos(alpha2) + (v1 * math.sin(alpha1) + v2 * math.sin(alpha2)) / rho
        found = LAWS[name](shape, v1, u1, gains)
        assert found.v == v2
        # The cosine enters as 1 * cos + 0 * sin, and a product by -mu2 as one by mu2 of the opposite.
        assert found.u == u2


def test_who_wants_to_stand_does_not_lean() -> None:
    """The share of the speed that a limit takes has the wanted speed for its divisor."""
    gains = Gains(1.5, 2.0, Spacing(0.2, 20.0), tilt=1.0)
    line = Line(0.4, 0.0, -1.0, 0.6, 0.8)
    tilted, plain = gains.settings(Limits(0.22, 2.84)), GAINS.settings(Limits(0.22, 2.84))
    assert law(tilted, line, 0.0, 0.0) == law(plain, line, 0.0, 0.0) == Motion(0.0, -1.2)
    assert lean(tilted, 0.4, 0.0, 0.0) == 0.0


@pytest.mark.parametrize("rho", [0.1, 0.4])
@pytest.mark.parametrize("wanted", [-0.5, 0.5])
def test_who_cannot_drive_as_fast_leans_by_the_share_that_the_limit_takes(rho: float, wanted: float) -> None:
    gains = Gains(1.5, 2.0, Spacing(0.2, 20.0), tilt=1.0)
    driven = math.copysign(0.2, wanted)
    share = math.copysign(0.6, wanted) * max(-1.0, min(1.0, 1.0 - (0.2 / rho) ** 2))
    for side in Side:
        numbers = Gains(1.5, 2.0, gains.spacing, Station(side), 1.0).settings()
        assert lean(numbers, rho, wanted, driven) == pytest.approx(side.sign * share)
    assert lean(GAINS.settings(), rho, wanted, driven) == 0.0


placed = st.builds(Station, st.sampled_from(Side), st.floats(0.3, math.pi - 0.3))


@given(shapes, leaders, st.floats(-3, 3), placed, st.floats(-1.0, 1.0))
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


@given(shapes, leaders, placed)
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
